"""What a page needs each frame to draw a network on its bed: few numbers, packed.

A frame is `HEADER` numbers, six of each node (its place, mm, and the vector part of its rotation),
and half a number of each strand: how taut it is in 11 bits, two strands in the 22 bits that a
float32 holds exactly. Nothing else of a strand changes: the page has its two arms, and finds both
its ends from the nodes. `page/state.js` reads it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.trainer.scope.pose import Pose
from kernel_cache import SameTypes, njit
from physics.bed import BeamOnBed, kernels

Floats32 = NDArray[np.float32]

HEADER = 85
HANDS, WELLS, CLIPS, TEARS, NICKS = 2, 4, 8, 4, 4
"""Of a frame at most: hands, places where something flows out, clips, torn elements, and nicks."""
# Where they begin in the header, and how many numbers each has.
POSE, POOL, HAND, WELL, CLIP, TEAR, NICK, SOIL = 0, 6, 8, 24, 44, 60, 68, 84
NODE_NUMBERS = 6
# How taut, from fully slack to parting: -0.5 to 1 becomes 1 to 1001, and 0 is parted.
STEPS = 1000
SLACKEST, SCALE = -0.5, STEPS / 1.5


@dataclass(frozen=True, slots=True)
class DrawnHand:
    """An instrument in the picture."""

    instrument: int  # its number among those that the page was given; -1 for none
    tip: tuple[float, float, float]  # mm
    opening: float = 0.0  # between the ends of its jaws, mm
    roll: float = 0.0  # about its shaft, rad
    holds: bool = False


@dataclass(frozen=True, slots=True)
class Well:
    """A place where blood or bile flows out, or did."""

    place: tuple[float, float, float]  # mm
    rate: float  # mm^3/s
    bile: bool = False


@dataclass(frozen=True, slots=True)
class Frame:
    """What a frame shows besides nodes and strands."""

    pose: Pose
    hands: Sequence[DrawnHand] = ()
    wells: Sequence[Well] = ()
    clips: Sequence[tuple[int, float]] = ()  # a tube's number, a place along it in elements
    torn: Sequence[tuple[int, int]] = ()  # a tube's number, an element's
    pools: tuple[float, float] = (0.0, 0.0)  # blood and bile that lie in the field, mm^3
    # A tube's number, a place along it in elements, an angle round it from up, rad, and a depth,
    # of its height.
    nicks: Sequence[tuple[int, float, float, float]] = ()
    soil: float = 0.0  # how soiled the lens is, 0 to 1


class Packing:
    """Frames of one network; `numbers`, (n, 3), is written anew by each `write`."""

    def __init__(self, bed: BeamOnBed) -> None:
        self._counts = nodes, strands = bed.places.shape[0], bed.strands.count
        size = HEADER + NODE_NUMBERS * nodes + -(-strands // 2)
        self.numbers = np.zeros((-(-size // 3), 3), np.float32)
        flat = self.numbers.reshape(-1)
        self._head = flat[:HEADER]
        self._nodes = flat[HEADER : HEADER + NODE_NUMBERS * nodes].reshape(nodes, NODE_NUMBERS)
        self._strands = flat[HEADER + NODE_NUMBERS * nodes : size]

    def write(self, bed: BeamOnBed, frame: Frame, angle: float) -> None:
        """Write a frame as a scope of an `angle`, rad, sees it; of too many rows the last.

        Raises
        ------
        ValueError
            If the bed is another network's.
        """
        if (bed.places.shape[0], bed.strands.count) != self._counts:
            raise ValueError("these are frames of another network")
        head = self._head
        head[:] = 0.0
        head[POSE : POSE + 5] = frame.pose.numbers
        head[POSE + 5] = angle
        head[POOL : POOL + 2] = frame.pools
        head[SOIL] = frame.soil
        for i in range(HANDS):
            hand = frame.hands[i] if i < len(frame.hands) else DrawnHand(-1, (0.0, 0.0, 0.0))
            at = HAND + 8 * i
            head[at : at + 3] = hand.tip
            head[at + 3 : at + 7] = hand.opening, hand.roll, hand.instrument, hand.holds
        for i, well in enumerate(frame.wells[-WELLS:]):
            at = WELL + 5 * i
            head[at : at + 3] = well.place
            head[at + 3 : at + 5] = well.rate, 2.0 if well.bile else 1.0
        for start, rows, most in ((CLIP, frame.clips, CLIPS), (TEAR, frame.torn, TEARS)):
            for i, (tube, place) in enumerate(rows[-most:]):
                head[start + 2 * i : start + 2 * i + 2] = tube + 1, place
        for i, (tube, *nick) in enumerate(frame.nicks[-NICKS:]):
            head[NICK + 4 * i : NICK + 4 * i + 4] = tube + 1, *nick
        _WRITE(bed.state, self._nodes, self._strands)


@njit(cache=True, nogil=True)
def packed_tautness(taut: float) -> int:
    """Return the 11 bits of how taut a whole strand is."""
    return 1 + int(min(max((taut - SLACKEST) * SCALE + 0.5, 0.0), 1.0 * STEPS))


@njit(cache=True, nogil=True)
def _write(s: kernels.State, nodes: Floats32, strands: Floats32) -> None:
    for n in range(s.x.shape[0]):
        # One of two quaternions of a rotation, the one whose scalar is not negative.
        sign = 1.0 if s.q[n, 0] >= 0.0 else -1.0
        for k in range(3):
            nodes[n, k] = s.x[n, k]
            nodes[n, 3 + k] = sign * s.q[n, 1 + k]
    first, code = 0, 0
    for group in range(s.first.size - 1):
        n, other = kernels.group_nodes(s.pair, group, s.x.shape[0])
        for i in range(s.first[group], s.first[group + 1]):
            code = 0
            if s.damage[i] < 1.0:
                end, foot = kernels.strand_ends(s.x, s.q, s.strand, n, other, i)
                length = np.sqrt(
                    (end[0] - foot[0]) ** 2 + (end[1] - foot[1]) ** 2 + (end[2] - foot[2]) ** 2
                )
                longer = length - s.strand[kernels.LENGTH, i]
                row = kernels.FAILURE if longer > 0.0 else kernels.LENGTH
                code = packed_tautness(longer / s.strand[row, i])
            if i % 2 == 0:
                first = code
                strands[i // 2] = 2048 * code
            else:
                strands[i // 2] = 2048 * first + code


_WRITE = SameTypes(_write)
