"""Takes down a motion of a duct on its bed, key by key, and how it tears.

The beam of a torn duct is in its new equilibrium at once. The pieces are drawn swinging to it, as
in the trainer, but rigidly: with Q the transforms there and P those at the break, a driving point
goes to Q + s (P - Q), s the swing, and turns by the rotation nearest to that blend of rotations.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from app.export.motion import RUN_STEP, WHOLE, Motion, MotionKey, recoil_times
from app.export.strands import BedTrack, stubs
from app.simulation import Dissection, Phase, Reading, SurfaceMapping, tear_front, tear_swing
from physics import RuptureCheck
from physics.bed import BeamOnBed

Floats = NDArray[np.float64]


class BedRecorder:
    """Takes down a motion of a duct on its bed; a `divided` one has no second clamp.

    Of several tubes it takes down the one that `surface` is of, and the `strands` that hold it, by
    their numbers.
    """

    def __init__(
        self,
        dissection: Dissection,
        surface: SurfaceMapping,
        *,
        divided: bool = False,
        strands: NDArray[np.int64] | None = None,
    ) -> None:
        self._dissection, self._surface, self._divided = dissection, surface, divided
        held = np.arange(surface.strands.count) if strands is None else strands
        self._held, self._on_tubes = held, np.flatnonzero(surface.strands.to >= 0)
        self._keys: list[MotionKey] = []
        self._states: list[tuple[Floats, Floats, Floats, float, Floats, Floats]] = []
        self._last_whole = dissection.rest_transforms()
        self._tear: float | None = None

    def add(
        self,
        time: float,
        beam: BeamOnBed,
        reading: Reading,
        element: int = -1,
        front: float = WHOLE,
        swing: float = 0.0,
    ) -> None:
        """Take down the duct as it is now, at a time, s.

        A duct in two is without its `element`, the tear has run as far as `front`, and its pieces
        still have the part `swing` of what moved them when it was last whole.
        """
        transforms, second = self._dissection.rest_transforms(), None
        if element >= 0:
            second = self._surface.move(beam, transforms.copy(), 1, element)
            self._surface.move(beam, transforms, 0, element)
            self._tear = self._middle(beam, element)
            if swing:
                transforms, second = (
                    self._swung(self._last_whole, each, swing) for each in (transforms, second)
                )
        else:
            if self._keys:  # the first stays the identity to the bit
                self._surface.move(beam, transforms)
            self._last_whole = transforms
        self._keys.append(MotionKey(time, transforms, reading, front, second))
        self._states.append(self._state(beam))

    def add_tear(self, beam: BeamOnBed, element: int, check: RuptureCheck) -> None:
        """Take down how the duct tears after the last key.

        `beam` is in equilibrium in two, without its `element`.
        """
        last, before = self._keys[-1], self._states[-1]
        tearing = replace(
            last.reading,
            phase=Phase.TEARING,
            check=check,
            holding=(False,) * len(last.reading.holding),
            nicks=(),
        )
        torn = replace(tearing, phase=Phase.TORN, force=0.0, deflection=0.0)
        for elapsed in recoil_times(RUN_STEP).tolist():
            front = tear_front(elapsed)
            reading = tearing if front < 1.0 else torn
            self.add(last.time + elapsed, beam, reading, element, front, tear_swing(elapsed))
            if front < 1.0:
                self._states[-1] = before

    def motion(self, name: str) -> Motion:
        """Return the motion that was taken down."""
        stations, ends, feet = self._surface.strands_at_rest()
        feet, ends = stubs(feet, ends)
        shifts, *states = map(np.array, zip(*self._states, strict=True))
        track = BedTrack(
            self._surface,
            stations,
            feet,
            ends,
            self._on_tubes,
            shifts,
            *states,
            tear=self._tear,
            divided=self._divided,
        )
        return Motion.of(name, self._keys, track)

    def _state(self, beam: BeamOnBed) -> tuple[Floats, Floats, Floats, float, Floats, Floats]:
        surface, strands, held, on_tubes = (
            self._surface, self._surface.strands, self._held, self._on_tubes,
        )  # fmt: skip
        damage, feet = beam.damage[held], beam.strand_feet(held)
        shifts = (feet[on_tubes] - strands.feet[on_tubes]) @ self._dissection.frame.T
        return (
            shifts,
            damage,
            strands.forces(beam.strand_ends(held), feet, damage),
            beam.freed_of(surface.tube),
            beam.stations_of(surface.tube) / surface.scale,
            beam.stresses()[beam.elements_of(surface.tube)],
        )

    def _middle(self, beam: BeamOnBed, element: int) -> float:
        """Return where an element's middle is, mm along the organ's axis."""
        ends = beam.stations_of(self._surface.tube)[element : element + 2]
        return self._dissection.clamps[0] + float(ends.mean() / self._surface.scale)

    def _swung(self, start: Floats, end: Floats, swing: float) -> Floats:
        """Return transforms a part of the way back from `end` to `start`, rigid as both are."""
        at = self._dissection.driving.positions
        blended = end + swing * (start - end)
        moved = np.einsum("dij,dj->di", blended[..., :3], at) + blended[..., 3]
        u, _, v = np.linalg.svd(np.eye(3) + blended[..., :3])
        turned = u @ v - np.eye(3)
        shift = moved - np.einsum("dij,dj->di", turned, at)
        return np.concatenate([turned, shift[..., np.newaxis]], axis=-1)
