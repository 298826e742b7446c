"""Where tubes are clipped and divided, and what is asked for of jaws there.

A tube that bleeds is clipped on the side from which the blood comes. A structure of the critical
view has places for its clips and its division along it, one `SPACE_MM` from the next: from the
gallbladder first the clips that go with it, then the division, then the clips that stay.
"""

import bisect
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.anatomy import tube_title
from app.simulation.exercises.next_step import (
    ALONG_BAR,
    BACK,
    BESIDE_JAWS,
    CLIP,
    CLOSE_NOW,
    DIVIDE,
    FIRM,
    INTO_RING,
    MARK,
    STAYS_STOPPED,
    NextStep,
)
from app.simulation.inputs.inputs import Instrument
from app.simulation.inputs.trocar import TROCARS
from app.simulation.tissue.instruments import CLIP_OPENING, RADIUS
from app.simulation.tissue.jaw_steps import (
    IN_RING_MM,
    MOST_STUCK,
    OUT_MM,
    PUSHES_N,
    RIGHT,
    TURNED,
    three,
    turn_off,
)
from app.simulation.tissue.reached_tube import nearest_wall
from app.simulation.tissue.safety import Safety
from app.simulation.tissue.spatial_tissue import LEAST_FLOW, SpatialTissue

Floats = NDArray[np.float64]
PAST_MM = 1.5
"""How far jaws are led past a tube that they close."""
SITES_MM = (2.0, 3.0, 4.0, 5.0, 6.0, 7.0)
"""Places for a clip, mm from a tear; the one that is clearest of other tubes is asked for."""
LEAST_MM, MOST_MM = 0.5, 10.0
"""Least and largest distance of a well placed clip from a tear, mm."""
SPACE_MM = 3.0
"""Distance between neighbours of a structure's clips and its division, mm."""
ASIDE_MM = (0.0, -0.8, 0.8)
"""Shifts along the tube of each of these places that are tried, mm."""
NECK_MM = 2.0
"""Extra distance of the first place from the gallbladder, whose neck hides the tube, mm."""
MOST_FURTHER_MM = 6
"""Most that all places move away from the gallbladder, to where fewer strands hold the tube, mm."""
HELD_MM = 2.0
"""Strands that hold the tube within this distance of a place leave jaws no room, mm."""
SLIDES_MM = 4.0
"""Jaws around a tube slide along it to a place up to this far away, mm; else they approach anew."""
COMES_MM = 8.0
"""Jaws that are nearer to a place than this may push its tube away, mm."""
PER_MM = 10.0
"""Cost of a mm that a jaw must push another tube aside, as a number of strands."""
SHIFTS_MM = (0.0, 1.5, -1.5, 3.0, -3.0)
"""Shifts of a place along its tube, mm, taken in turn where jaws cannot close."""
MOST_IN_VAIN = 2
"""Attempts at one place before the next shift."""
SPACE_APART_MM = 1.2
"""Least distance of a shifted place from clips and from the tube's ends, mm."""
CANNOT_AFTER = 4
"""Attempts that fail before the left hand is asked to draw the tubes elsewhere."""
OUT_FIRST_MM = 12.0
"""How far jaws are drawn out before that, mm."""
NEAR_MM = 1.5
"""Jaws within this distance of their place are well placed, mm."""
APART_MM = 0.7
"""Least distance of scissors from a clip, mm."""
CLIPS_APART_MM = 1.6
"""Least distance between two clips that scissors go between, mm."""


class Bleeding(NamedTuple):
    """A hole that bleeds, or is about to."""

    tube: str
    station: float  # mm
    up: float  # -1 or 1, along the tube to where the blood comes from

    @classmethod
    def of(cls, tissue: SpatialTissue) -> "Bleeding | None":
        """Return what bleeds most; None if nothing bleeds, nor will with the first touch."""
        holes = tissue.fluids["blood"].holes
        if not holes:  # what opens torn tears in its middle then
            if (tube := tissue.opens_torn) is None:
                return None
            return cls(tube, 0.5 * tissue.tubes.network.tubes[tube].span, -1.0)
        hole = max(holes, key=lambda each: each.flow)
        if hole.flow <= LEAST_FLOW:
            return None
        # The tear's other end lies further from where the blood comes.
        ends = [each.station for each in holes if each.tube == hole.tube]
        return cls(hole.tube, hole.station, -1.0 if max(ends) > hole.station else 1.0)

    def stations(self, before: Iterable[float]) -> list[float]:
        """Return where so many mm before it are, mm."""
        return [self.station + self.up * each for each in before]

    def is_closed_by(self, between: dict[str, float]) -> bool:
        """Return whether a clip on these tubes, at stations in mm, is well placed before it."""
        at = between.get(self.tube, self.station)
        return LEAST_MM <= self.up * (at - self.station) <= MOST_MM


class ClipSite(NamedTuple):
    """Where a clip may be put on a tube, and how the clip applier comes."""

    station: float  # mm
    shaft: Floats  # (3,) direction from the tip back
    across: Floats  # (3,) in which its jaws open
    tip: Floats  # (3,) mm
    between: dict[str, float]  # tubes that would be between its jaws there, and stations, mm

    @classmethod
    def at(cls, tissue: SpatialTissue, tube: str, station: float, jaws: float) -> "ClipSite":
        """Return the site at a station, mm from a tube's first end, of jaws so far open, mm."""
        rest = tissue.tubes.network.tubes[tube]
        at = min(max(station, 0.0), rest.span)
        line = tissue.beam.places_at(np.array([at - 0.5, at, at + 0.5]), tube)
        shaft = TROCARS[RIGHT].shaft(line[1])
        across = np.cross(shaft, line[2] - line[0])
        across /= np.sqrt((across * across).sum())
        tip = line[1] - (float(rest.radius.max()) + PAST_MM) * shaft
        names = tissue.tubes.names
        between = {names[i]: there for i, there in tissue.between_jaws(tip, shaft, jaws)}
        return cls(station, shaft, across, tip, between)

    @classmethod
    def clearest(
        cls,
        tissue: SpatialTissue,
        tube: str,
        stations: Iterable[float],
        jaws: float,
        is_good: Callable[[dict[str, float]], bool],
    ) -> "ClipSite":
        """Return the clearest site at one of some stations, mm, where what is between is good."""
        sites = [cls.at(tissue, tube, each, jaws) for each in stations]
        # A tube that turns back may pass between the jaws elsewhere.
        return max(
            sites, key=lambda each: (is_good(each.between), each.room_in(tissue, tube, jaws))
        )

    def room_in(self, tissue: SpatialTissue, tube: str, jaws: float) -> float:
        """Return how far jaws that are so far open are from the nearest other tube, mm."""
        return min(
            nearest_wall(tissue.beam, self.tip + aside * self.across + back * self.shaft, other)[0]
            for aside in (-0.5 * jaws, 0.5 * jaws)
            for back in (0.0, 4.0, 8.0)
            for other in tissue.tubes.names
            if other != tube
        )


class JawsOnTube:
    """How far somebody has come with open jaws that are to close on a tube."""

    def __init__(self, tissue: SpatialTissue) -> None:
        self._tissue = tissue
        self._site: tuple[object, float] = None, 0.0  # what is asked for, and its station, mm
        self.in_vain = 0
        """How often another tube has come between, too, or the jaws have pushed a tube away."""
        self._beside = 0  # 1 while one is there, 2 with the tube itself

    def next_step(
        self,
        tool: Instrument,
        tube: str,
        stations: Sequence[float],
        is_good: Callable[[dict[str, float]], bool],
        purpose: str = "",
    ) -> NextStep:
        """Return what to do next.

        Parameters
        ----------
        tool, tube
            What closes, and on which tube.
        stations
            mm along it, of which the clearest is asked for.
        is_good
            Whether jaws may close on some tubes, at stations in mm.
        purpose
            What they are brought for, as a step begins.

        Returns
        -------
        NextStep
            To bring the jaws, or to close them.
        """
        tissue, hand = self._tissue, self._tissue.hands[RIGHT]
        jaws = hand.opening if hand.instrument == tool else CLIP_OPENING
        # A site that is good stays: which is the clearest changes as jaws come near.
        asked = tool, tube, purpose
        anew = self._site[0] != asked
        if anew:
            self.in_vain = 0
        site = ClipSite.at(tissue, tube, self._site[1], jaws)
        if anew or not is_good(site.between):
            before, near = site.station, math.dist(site.tip, hand.place) < COMES_MM
            site = ClipSite.clearest(tissue, tube, stations, jaws, is_good)
            self.in_vain += not anew and near and site.station != before
            self._site = asked, site.station
        between: dict[str, float] = {}
        if hand.instrument == tool:
            if tool == "scissors":  # which cut into what is between them in part
                cuts = tissue.blades(RIGHT).tubes(tissue.beam)
                wanted = tissue.tubes.names.index(tube)
                found = [(each.tube, each.station) for each in cuts
                         if each.tube != wanted or each.whole]  # fmt: skip
            else:
                found = tissue.between_jaws(hand.place, np.array(hand.aim), jaws)
            between = {tissue.tubes.names[number]: at for number, at in found}
        title, others = tube_title(tube), [each for each in between if each != tube]
        leads = not is_good(between)
        beside = bool(others) + (bool(others) and tube in between)
        self.in_vain += beside > self._beside
        self._beside = beside
        off = site.tip - hand.place
        if leads and between and float(off @ off) > SLIDES_MM**2:
            # Jaws about a tube would take that along.
            out = hand.place + (OUT_MM + float(off @ site.shaft)) * site.shaft
            return NextStep(BACK.format(tool), place=three(out), hand=RIGHT, tool=tool)
        if leads:
            turn = turn_off(RIGHT, hand, site.across)
            bar = ALONG_BAR * (turn is not None and abs(turn) > TURNED)
            words = f"Next: {purpose}{INTO_RING.format(tool, title, bar)}"
        elif others:
            words = BESIDE_JAWS.format(tool, tube_title(others[0]))
            return NextStep(words, hand=RIGHT, tool=tool)
        else:
            words = CLOSE_NOW[tool].format(title)
        return NextStep(
            words, along=three(site.across), place=three(site.tip), hand=RIGHT, tool=tool,
            leads=leads,
        )  # fmt: skip


class ClipSteps:
    """How far somebody has come with a bleeding."""

    def __init__(self, tissue: SpatialTissue) -> None:
        self._tissue, self._jaws = tissue, JawsOnTube(tissue)

    def next_step(self) -> NextStep | None:
        """Return what to do next; None where nothing has bled."""
        bleeding = Bleeding.of(self._tissue)
        if bleeding is None:
            stopped = NextStep(STAYS_STOPPED)
            return stopped if self._tissue.fluids["blood"].holes else None
        return self._jaws.next_step(
            "clip applier", bleeding.tube, bleeding.stations(SITES_MM), bleeding.is_closed_by
        )


class ClosingSteps:
    """How far somebody has come with the structures of a critical view that are divided."""

    def __init__(self, safety: Safety) -> None:
        self._safety, self._jaws = safety, JawsOnTube(safety.tissue)
        self._further: dict[str, int] = {}  # mm by which a tube's places are further
        self._place = "", 0  # the tube, and the number of the clip or of its division, last asked
        self._out: Floats | None = None  # (3,) mm, where to jaws are drawn out
        self._taut = 0  # judgements in a row at which a wall was taut
        self.stays_strained = False
        """Whether a wall stays taut."""
        self.presses = False
        """Whether jaws strain a wall."""
        self.hindered = 0
        """How often they have strained a wall on their way there, or could not come there."""

    @property
    def in_vain(self) -> int:
        """How often jaws have come there that could not close."""
        return self.hindered + self._jaws.in_vain

    @property
    def cannot_close(self) -> bool:
        """Whether jaws cannot close as the tubes lie."""
        return self.in_vain > CANNOT_AFTER

    def begin_anew(self) -> None:
        """Forget how often jaws have come in vain: the tubes lie otherwise now."""
        self.hindered = self._jaws.in_vain = 0

    def follow(self) -> None:
        """Note whether jaws strain a wall."""
        tissue, before = self._safety.tissue, self.presses
        pushes = math.hypot(*tissue.forces[RIGHT]) >= PUSHES_N
        self.presses = tissue.stress_ratio >= FIRM.taut and pushes
        self.hindered += self.presses and not before
        taut = tissue.stress_ratio >= (FIRM.taut if pushes else FIRM.stops_at)
        self._taut = self._taut + 1 if taut else 0
        self.stays_strained = self._taut > (MOST_STUCK if pushes else 0)

    def come_out(self) -> None:
        """Ask for jaws to be drawn out before anything else."""
        place = self._safety.tissue.hands[RIGHT].place
        self._out = place + OUT_FIRST_MM * TROCARS[RIGHT].shaft(place)

    def drawn_out(self) -> NextStep | None:
        """Return that jaws are drawn out, if they are to be; None once they are."""
        hand = self._safety.tissue.hands[RIGHT]
        if self._out is None or math.dist(hand.place, self._out) <= IN_RING_MM:
            self._out = None
            return None
        tool = hand.instrument
        return NextStep(BACK.format(tool), place=three(self._out), hand=RIGHT, tool=tool)

    def next_step(self, stay: int, go: int) -> NextStep | None:
        """Return what to do next, with so many clips to stay and to go; None once all is done."""
        for each in self._safety.closings():
            if not each.marked:
                return NextStep(MARK.format(tube_title(each.tube)))
            if not each.divided:
                return self._close(each.tube, stay, go)
        return None

    def _close(self, tube: str, stay: int, go: int) -> NextStep:
        tissue, at_end = self._safety.tissue, self._safety.entering[tube]
        span, scale = (
            tissue.tubes.network.tubes[tube].span,
            tissue.tubes.surfaces[tissue.tubes.names.index(tube)].scale,
        )
        clips: list[float] = sorted(
            span - each.station * scale if at_end else each.station * scale
            for each in tissue.events
            if each.tube == tube and each.kind == "clip"
        )
        if tube not in self._further:
            self._further[tube] = self._freest(tube, stay, go)
        far, use = place_to_close(clips, stay, go, span, self._further[tube])
        if self._place != (tube, len(clips)):
            self._place, self.hindered = (tube, len(clips)), 0
        ends = [0.0, *clips, span]
        place = bisect.bisect(ends, far)
        if shift := SHIFTS_MM[self.in_vain // MOST_IN_VAIN % len(SHIFTS_MM)]:
            low, high = ends[place - 1] + SPACE_APART_MM, ends[place] - SPACE_APART_MM
            far = float(np.clip(far + shift, low, high))

        # Between clips that lie too close, where there is room still.
        least = min(APART_MM, 0.3 * (ends[place] - ends[place - 1]))
        if use != "divide":
            least = CLIPS_APART_MM

        def is_good(between: dict[str, float]) -> bool:
            """Return whether jaws are on the tube there, off its clips."""
            if tube not in between:
                return False
            at = span - between[tube] if at_end else between[tube]
            apart = all(abs(at - each) >= least for each in clips)
            # Beyond the next clip, however near, it would leave too few on one side.
            return apart and abs(at - far) <= NEAR_MM and bisect.bisect(ends, at) == place

        stations = [span - far - each if at_end else far + each for each in ASIDE_MM]
        if use == "divide":
            return self._jaws.next_step("scissors", tube, stations, is_good, DIVIDE)
        purpose = CLIP.format(len(clips) + 1, stay + go, use)
        return self._jaws.next_step("clip applier", tube, stations, is_good, purpose)

    def _freest(self, tube: str, stay: int, go: int) -> int:
        """Return by how much further a tube's places are freest of strands and other tubes, mm."""
        tissue = self._safety.tissue
        strands, number = tissue.tubes.strands, tissue.tubes.names.index(tube)
        span, whole = tissue.tubes.network.tubes[tube].span, tissue.beam.damage < 1.0
        held = np.concatenate(
            [
                strands.stations[whole & (strands.tubes == number)],
                strands.to_stations[whole & (strands.to == number)],
            ]
        )
        if self._safety.entering[tube]:
            held = span - held

        def hindered(further: int) -> float:
            """Return by how many strands, and as if by some where a tube is in the way."""
            places = np.array(places_to_close(stay, go, span, further))
            holds = float((np.abs(held - places[:, None]) < HELD_MM).sum())
            for each in (span - places if self._safety.entering[tube] else places).tolist():
                site = ClipSite.at(tissue, tube, each, CLIP_OPENING)
                room = site.room_in(tissue, tube, CLIP_OPENING)
                holds += PER_MM * max(0.0, RADIUS["clip applier"] - room)
            return holds

        room = span - max(places_to_close(stay, go, span)) - SPACE_MM
        return min(range(1 + max(0, min(MOST_FURTHER_MM, int(room)))), key=hindered)


def places_to_close(stay: int, go: int, span: float, further: float = 0.0) -> list[float]:
    """Return places of clips that go, the division and clips that stay, mm from the gallbladder."""
    space = min(SPACE_MM, span / (stay + go + 2))
    first = space + further + min(NECK_MM, 0.25 * (span - space * (stay + go + 2)))
    return [first + space * each for each in range(stay + go + 1)]


def place_to_close(
    clips: Sequence[float], stay: int, go: int, span: float, further: float = 0.0
) -> tuple[float, Literal["stay", "go", "divide"]]:
    """Return where the next clip or the division is, mm from the gallbladder, and what it is for.

    Parameters
    ----------
    clips
        Where clips are, mm from the gallbladder.
    stay, go
        How many are to stay and to go with it.
    span
        mm of the tube.
    further
        mm by which all places are further.

    Returns
    -------
    float, str
        The clips that stay come first, farthest from it; then those that go, then the division.
    """
    if len(clips) >= stay + go:
        ends = [0.0, *sorted(clips), span]
        return 0.5 * (ends[go] + ends[go + 1]), "divide"
    places = places_to_close(stay, go, span, further)
    division = places.pop(go)
    for each in clips:
        places.remove(min(places, key=lambda place: abs(place - each)))
    return max(places), "stay" if max(places) > division else "go"
