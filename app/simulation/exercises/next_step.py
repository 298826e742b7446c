"""What an exercise at an anatomy asks for next, in words of at most 25."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.simulation.inputs.inputs import Instrument

Three = tuple[float, float, float]
Where = Literal["between", "plate", "behind"]
PART: dict[Where, str] = {
    "between": "Next: part the tissue between {} and {}: lead the right hand's {} into the ring.",
    "behind": "Next: part the tissue behind the {}: lead the right hand's {} into the ring.",
    "plate": "Next: part the {} from the liver: lead the right hand's {} into the ring.",
}
"""Where to bring jaws, by where what they part is of the tubes that it holds."""
PASS: dict[Where, str] = {
    "between": "Next: lead the right hand's {} along its tip between {} and {}, into the ring.",
    "behind": "Next: pass the right hand's {} along its tip behind the {}, into the ring.",
}
"""Where to pass a bent tip then."""
TURN = "Next: turn the right hand's {} (J, L) to lie along the ring's bar."
OPEN = "Next: open the right hand's {} (G): its jaws part what lies in the ring."
OPENS = "Next: the right hand's {} opens; wait until its jaws stand still."
BETWEEN_BLADES = "Next: lead the right hand's open {} between {} and {}, into the ring."
CUT = "Next: cut what lies between its blades with the right hand's {} (G)."
OUT_AS = "Next: draw the right hand's {} out of the tissue (wheel back): {}."
NOTHING_BETWEEN = "nothing lies between its blades"
TUBE_BETWEEN = "the {} lies between its blades"
STRAINS = "it strains the {}"
PRESSES = "it presses too hard for jaws to part"
BLOCKED = "a wall is in its way"
"""Why it is drawn out that has parted nothing."""
SWEEP = "Next: sweep the right hand's closed {} between {} and {}, slowly, into the ring."
CLOSES = "Next: the right hand's {} closes; wait until its jaws stand still."
CLOSE = "Next: close the right hand's {} (G)."
CLOSE_FEW = "Next: close the right hand's {} (G): few strands have parted, a wall lies in its jaws."
BACK_ALONG = "Next: lead the right hand's {} back along its tip, into the ring."
BACK = "Next: draw the right hand's {} out of the tissue (wheel back), to the ring."
TAKE_HOLD = "Next: take hold of the {} in the ring with the left hand's grasper (G)."
DRAW_ASIDE = (
    "Next: draw the {} aside with the left hand's grasper: drag it slowly into "
    "the ring, stage {} of {}."
)
DRAW_OFF = (
    "Next: draw the {} off the liver with the left hand's grasper: drag it slowly into "
    "the ring, stage {} of {}."
)
DRAW_DOWN = (
    "Next: draw the {} towards the common duct with the left hand's grasper: drag it slowly into "
    "the ring, stage {} of {}."
)
TO_RING = " towards the ring"
"""Where to it is let back, if that is known."""
LET_BACK = (
    "Next: let the {} back into the ring with the left hand: what still holds it may give way at "
    "once."
)
LET_GO = "Next: let go of the {} with the left hand's grasper (G){}."
ELSEWHERE = ", to hold it elsewhere"
PULLS = ": its pull leaves the {} no room"
STAYS_TAUT = ": the {} stays strained"
SLACKEN = (
    "Next: let the {} back{} with the left hand until Highest stress is under {:.0f} %: "
    "the {} is strained."
)
WITHDRAW = (
    "Next: draw the right hand's {} back a little (wheel back, or Shift+Down): it strains the {}."
)
WITHDRAW_ALONG = (
    "Next: lead the right hand's {} back along its tip, into the ring: it strains the {}."
)
PINCHED = "Next: open the right hand's {} again (G): the {} lies between its jaws."
LEAVE = "Next: lead the right hand's {} off the {}, into the ring."
MARK = (
    "Next: mark the {}: choose it under Point at, and press it in the picture. If it is hidden, "
    "look from aside (Z, then Y, J, L)."
)
CLIP = "clip {} of {}, to {}: "
DIVIDE = "divide it between its clips: "
"""For what jaws are brought somewhere."""
INTO_RING = "lead the {} into the ring, past the {}{}."
ALONG_BAR = ", jaws (J, L) along the bar"
"""Where they are to be turned for that."""
CLOSE_NOW: dict[Instrument, str] = {
    "clip applier": "Next: clip it (G): the {} lies between the jaws.",
    "scissors": "Next: divide it (G): the {} lies between the jaws.",
}
BESIDE_JAWS = "Next: wheel the {} back by a notch: the {} lies between its jaws, too."
STAYS_STOPPED = "Next: wait, and touch nothing: it has to stay stopped."


NO_STRANDS = np.zeros(0, dtype=np.int64)


class Strain(NamedTuple):
    """How far a wall may be strained, of its break, by what an exercise asks for."""

    eased: float  # to which what pulls is slackened
    taut: float  # from which on jaws are led no further
    stops_at: float  # from which on what strains it is stopped


GENTLE, FIRM = Strain(0.36, 0.42, 0.48), Strain(0.45, 0.6, 0.7)
"""At first: under half of a break, as errors have it (`tension_on_vessel`); and where little parts
by that, or something closes on a tube."""


class NextStep(NamedTuple):
    """What an exercise asks for next."""

    words: str
    strands: NDArray[np.int64] = NO_STRANDS  # that it is about; none where nothing is to part
    along: Three | None = None  # direction in which jaws part them
    place: Three | None = None  # mm, where to the hand's tip is led
    hand: int | None = None  # that does it; None for either
    tool: Instrument | None = None  # that it takes; None for what it has
    through: bool = False  # whether the tip is led there through tissue, and not in front of it
    leads: bool = False  # whether the tip is still to be led into the ring
    strain: Strain = FIRM  # that it is done by at most
