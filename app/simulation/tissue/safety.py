"""What is safe at the hepatocystic triangle, from the state alone (docs/anatomy-file.md).

The critical view of safety [Strasberg & Brunt 2010] has three parts of 0 to 2 points each: two and
only two structures enter the gallbladder; the hepatocystic triangle is cleared; the lower third of
the cystic plate is freed. A part is judged by the share of its strands that have parted:
`TWO_POINTS` for 2 points, `ONE_POINT` for 1. Once a structure has torn nothing is safe: what the
tear parted does not count, and no part has a point.
"""

import math

import numpy as np
from numpy.typing import NDArray

from app.simulation.exercises.critical_view import (
    ONE_POINT,
    TWO_POINTS,
    Closing,
    CriticalView,
    Part,
    Tenting,
)
from app.simulation.inputs.inputs import Structure
from app.simulation.specimen.structures import LOWER_FRACTION, entering_tubes, named_structures
from app.simulation.tissue.spatial_tissue import SpatialTissue
from physics import RuptureCheck
from physics.bed import BeamOnBed

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

STRUCTURE_MM = 6.0
"""Length of each structure, next to the gallbladder, that must be free all round."""
MARGIN_MM = 2.0
"""How far the triangle reaches beyond that of the tubes' axes, mm."""
COVERED = 1.0 / 3.0
"""Of the cystic duct's length, next to the common duct, whose tissue may stay: the view does not
ask for the common duct to be exposed [Strasberg & Brunt 2010]."""
HILUM = 0.9
"""Where the triangle ends, as a fraction of the common duct's length."""
BIN_MM = 1.0
ALONG_MM = 10.0
"""Length of duct, to either side of the junction, over which its direction is taken."""


class Safety:
    """What is judged of a tissue whose anatomy has a gallbladder, a cystic and a common duct.

    Parameters
    ----------
    tissue
        The tubes; their anatomy says what joins the gallbladder.

    Raises
    ------
    ValueError
        If the anatomy has no gallbladder, or no duct that leads from it to another.
    """

    def __init__(self, tissue: SpatialTissue) -> None:
        anatomy = tissue.specimen.anatomy
        if anatomy is None:
            raise ValueError("a critical view of safety needs an anatomy, not a single duct")
        self.tissue = tissue
        """What is judged."""

        self.gallbladder, self.cystic, self.common = named_structures(anatomy)
        entering = entering_tubes(anatomy, self.gallbladder)
        names, strands = tissue.tubes.names, tissue.tubes.strands
        tubes = tissue.tubes.network.tubes
        holder, foot = strands.tubes, strands.to

        def on(name: str, low: float, high: float) -> Mask:
            """Return which strands hold a stretch of a tube, at either end."""
            number = names.index(name)
            return ((holder == number) & (strands.stations >= low) & (strands.stations <= high)) | (
                (foot == number) & (strands.to_stations >= low) & (strands.to_stations <= high)
            )

        def at_end(name: str, end: int, far: float) -> Mask:
            """Return which strands hold a tube so far, mm, from its first or last end."""
            span = tubes[name].span
            return on(name, 0.0, far) if end == 0 else on(name, span - far, span)

        self._about = {name: at_end(name, end, STRUCTURE_MM) for name, end in entering.items()}
        bladder = names.index(self.gallbladder)
        whole = on(self.gallbladder, 0.0, tubes[self.gallbladder].span)
        self._neck = whole & (foot >= 0)
        self._plate = (
            (holder == bladder)
            & (foot < 0)
            & (strands.stations <= LOWER_FRACTION * tubes[self.gallbladder].span)
        )
        from_common = any(j.tube == self.cystic and j.end == 0 for j in anatomy.join)
        self._corners = (
            (self.cystic, 0.0 if from_common else tubes[self.cystic].span),
            (self.gallbladder, 0.0),
            (self.common, HILUM * tubes[self.common].span),
        )
        covered = COVERED * tubes[self.cystic].span
        self._triangle = self._inside() & ~at_end(self.cystic, 0 if from_common else 1, covered)
        self._viewed: tuple[BeamOnBed, int, list[RuptureCheck | None], int] | None = None
        self._view: CriticalView
        self.entering = entering
        """Each structure that enters the gallbladder, and the end of it that does."""

        kinds = {each.name: each.kind for each in anatomy.tube}
        self.tubes_of: dict[Structure, set[str]] = {
            "cystic duct": {self.cystic},
            "cystic artery": {name for name in self.entering if kinds[name] == "artery"},
            "common duct": {self.common},
        }
        """The tubes that each structure is."""

    def closings(self) -> list[Closing]:
        """Return how far each structure that enters the gallbladder is marked and closed."""
        tissue, out = self.tissue, list[Closing]()
        for name, end in self.entering.items():
            own = [each for each in tissue.events if each.tube == name]
            clips = [each.station for each in own if each.kind == "clip"]
            cuts = [each.station for each in own if each.kind == "division"]
            # Before it is divided, nothing is on the side that goes.
            stay = clips if not cuts else [at for at in clips if (at < cuts[0]) == (end == 1)]
            marked = any(
                each.tube == name and name in self.tubes_of[each.structure] for each in tissue.marks
            )
            out.append(Closing(name, marked, len(stay), len(clips) - len(stay), bool(cuts)))
        return out

    def corners(self) -> Floats:
        """(3, 3) mm where junction, neck and hilum are now, the corners of the triangle."""
        at = [self.tissue.beam.places_at(np.array([at]), name)[0] for name, at in self._corners]
        return np.stack(at)

    def _inside(self) -> Mask:
        """Return which strands lie in the triangle of junction, neck and hilum at rest."""
        tissue, strands = self.tissue, self.tissue.tubes.strands
        tubes, names = tissue.tubes.network.tubes, tissue.tubes.names
        rest = [tubes[name].places_at(np.array([at]))[0][0] for name, at in self._corners]
        corners = np.stack(rest)[:, :2]
        between = strands.to >= 0
        middle = np.where(between[:, None], 0.5 * (strands.ends + strands.feet), strands.ends)
        sides = np.roll(corners, -1, axis=0) - corners
        turn = _cross(sides[0], sides[1])
        inside = np.ones(strands.count, dtype=np.bool_)
        for corner, side in zip(corners, sides, strict=True):
            off = middle[:, :2] - corner
            away = math.copysign(1.0, float(turn)) * _cross(side, off) / math.hypot(*side)
            inside &= away > -MARGIN_MM
        # Of strands to the bed those of the structures alone: the common duct stays in its own.
        free = [names.index(each) for each in self._about]
        return inside & (between | np.isin(strands.tubes, free))

    def critical_view(self) -> CriticalView:
        """Return the critical view of safety as it is now."""
        tissue = self.tissue
        # Nothing else changes it.
        now = tissue.beam, tissue.beam.broken, tissue.tears.copy(), len(tissue.events)
        if now != self._viewed:
            self._viewed, self._view = now, self._looked()
        return self._view

    def _looked(self) -> CriticalView:
        tissue = self.tissue
        parted = tissue.beam.damage >= 1.0

        def fraction(which: Mask) -> float:
            return float(parted[which].mean()) if which.any() else 1.0

        torn = tuple(
            name
            for name, tear in zip(tissue.tubes.names, tissue.tears, strict=True)
            if tear is not None
        )
        divided = {each.tube for each in tissue.events if each.kind == "division"}
        structures = {name: fraction(which) for name, which in self._about.items()}
        neck, triangle, plate = (
            fraction(self._neck),
            fraction(self._triangle),
            fraction(self._plate),
        )
        clear = sum(each >= TWO_POINTS for each in structures.values())
        two = 0
        if not divided & structures.keys():
            if clear == len(structures) and neck >= TWO_POINTS:
                two = 2
            elif clear >= 1 and neck >= ONE_POINT:
                two = 1
        points = two, _points(triangle), _points(plate)
        if torn:
            points = 0, 0, 0
        return CriticalView(*points, structures, neck, triangle, plate, torn)

    def lacking(self, part: Part) -> Mask:
        """Return the strands, parted or not, of what a part of the view does not have yet, (S,)."""
        if part != "tubes":
            return self._triangle if part == "triangle" else self._plate
        view = self.critical_view()
        masks = [self._about[name] for name, free in view.structures.items() if free < TWO_POINTS]
        neck = self._neck & (view.neck < TWO_POINTS)
        return np.any([neck, *masks], axis=0)

    def freed_all_round(self) -> dict[str, float]:
        """Return the longest stretch of each structure that nothing holds any more, mm."""
        tissue, strands = self.tissue, self.tissue.tubes.strands
        whole = tissue.beam.damage < 1.0
        out: dict[str, float] = {}
        for name in self._about:
            number, span = tissue.tubes.names.index(name), tissue.tubes.network.tubes[name].span
            bins = max(1, round(span / BIN_MM))
            count = np.zeros(bins)
            for tubes, stations in (
                (strands.tubes, strands.stations),
                (strands.to, strands.to_stations),
            ):
                at = stations[(tubes == number) & whole]
                place = np.minimum((at * (bins / span)).astype(np.int64), bins - 1)
                count += np.bincount(place, minlength=bins)
            longest = run = 0
            for held in count.tolist():
                run = 0 if held else run + 1
                longest = max(longest, run)
            out[name] = longest * span / bins
        return out

    def tenting(self) -> Tenting:
        """Return how far the common duct is drawn out, and how the cystic duct lines up with it."""
        tissue, beam = self.tissue, self.tissue.beam
        common, own = beam.nodes_of(self.common), beam.nodes_of(self.cystic)
        first = bool((common == own[0]).any())  # which end of the cystic duct the junction is
        shared = int(own[0 if first else -1])
        at = float(beam.stations_of(self.common)[common == shared][0])
        length = float(beam.stations_of(self.cystic)[-1])
        below, junction, above = beam.places_at(
            np.array([at - ALONG_MM, at, at + ALONG_MM]), self.common
        )
        far = beam.places_at(np.array([ALONG_MM if first else length - ALONG_MM]), self.cystic)[0]
        moved = junction - beam.rest_place(shared)
        rest = tissue.tubes.network.tubes[self.common]
        radius = float(np.interp(np.array([at]), rest.stations, rest.radius)[0])
        return Tenting(
            math.sqrt(float((moved**2).sum())) / (2.0 * radius),
            _angle(junction - below, far - junction),
            _angle(junction - below, above - junction),
        )


def _points(fraction: float) -> int:
    return 2 if fraction >= TWO_POINTS else 1 if fraction >= ONE_POINT else 0


def _cross(a: Floats, b: Floats) -> Floats:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _angle(a: Floats, b: Floats) -> float:
    """Return the angle between two directions, degrees."""
    cosine = float((a * b).sum()) / math.sqrt(float((a * a).sum() * (b * b).sum()))
    return math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))
