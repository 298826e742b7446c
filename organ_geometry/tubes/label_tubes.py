# SciPy has no types.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""From labels to organs that join: each tube's axis led into the tube that it joins, and its organ.

Where a tube runs into another, the voxels there are the other's. So its axis is cut back to where
its rim is free, and led in a smooth curve to the other's axis; its wall goes on along it,
and the two surfaces run into each other. The organ is made of the sections across that axis by the
stages of the organ builder.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.traced_organ import TracedOrgan, TracedSection
from organ_geometry.curves.fitted_organ import fit_organ
from organ_geometry.encoder.encode import ToleranceTooSmall
from organ_geometry.images.grey_image import ImageStackError
from organ_geometry.images.image_planes import ImagePlanes
from organ_geometry.images.image_stack import ImageStack
from organ_geometry.images.label_volume import LabelVolume
from organ_geometry.organ_builder import BuiltOrgan, Promise, build_fitted
from organ_geometry.reslice.resliced_stack import ReslicedSlices
from organ_geometry.tubes.tube_axis import TubeAxis, fitted_axis, no_side
from organ_geometry.tubes.tube_branches import SplitLabels, outside_wall, split_labels
from organ_geometry.tubes.tube_joins import (
    TubeJoin,
    acyclic_joins,
    found_joins,
    join_of,
    parents_first,
)

Floats = NDArray[np.float64]

# Of a section's rim at another tube; a joined end begins where it is less. It is looked for over so
# many radii from the end, and so much of it is always cut off: there an axis is led on straight.
_FOREIGN_FRACTION = 0.05
_CUT_RADII, _LEAST_CUT_RADII = 3.5, 0.5
# An end that is missed by more than this, in its radii, is led to the one that joins it; how far
# beyond the other's axis a ray looks for it.
_MEETS_RADII = 0.7
_RAY_RADII = 1.5
_RIM_POINTS = 48
_SECTION_FRACTION = 0.5  # between sections, of the radius
# RMS distance of the organ to the wall found: of the radius, and in voxels at least.
_OVERALL_FRACTION, _OVERALL_VOXELS = 0.02, 0.08
# Sides of tubes that touch over more than this, in radii, with this share of their rims, and not
# within so many radii of an end, are said.
_TOUCH_RADII, _TOUCH_FRACTION, _FROM_ENDS_RADII = 2.0, 0.04, 2.5
# A part left out of a tube, in cubed radii, so far outside its wall, in radii: a branch.
_BRANCH_VOLUME, _BRANCH_RADII = 2.0, 0.6
_RAISES = 3  # of how near an organ is kept, where that cannot be
_OPEN_FRACTION = 0.02  # of a tube's side, beyond the volume
# Voxels around the tubes that are looked at: where there are none, the volume ends.
_MARGIN = 10
_THIN_VOXELS = 2.5  # of radius: a thinner tube is said


@dataclass(frozen=True, slots=True, eq=False)
class LabelTube:
    """A label's tube: its axis as found, its organ, and which ends are at the volume's edge."""

    name: str
    label: int
    axis: TubeAxis
    built: BuiltOrgan
    cut: tuple[bool, bool]


@dataclass(frozen=True, slots=True, eq=False)
class LabelTubes:
    """The tubes of a volume, each after those it joins.

    Attributes
    ----------
    tubes, joins
        Stations of joins are along the other tube's axis, mm.
    touches
        Pairs that lie against each other and the length over which they do, mm.
    doubts
        What whoever uses them should look at, one sentence each.
    """

    tubes: tuple[LabelTube, ...]
    joins: tuple[TubeJoin, ...]
    touches: tuple[tuple[str, str, float], ...]
    doubts: tuple[str, ...]

    def tube(self, name: str) -> LabelTube:
        """Return a tube by its name."""
        return next(tube for tube in self.tubes if tube.name == name)


@dataclass(frozen=True, slots=True, eq=False)
class _Made:
    """A tube with its organ, what it was made with, and what is said of it."""

    key: tuple[object, ...]
    axis: TubeAxis
    tube: LabelTube
    touches: tuple[tuple[str, str, float], ...]
    doubts: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class FoundTubes:
    """The axes of a volume's tubes as their labels have them, and where their ends join.

    Attributes
    ----------
    joins
        As they were found; `tubes` makes organs with these or with others.
    """

    split: SplitLabels
    joins: tuple[TubeJoin, ...]
    nearly: tuple[str, ...]
    # Made last, by name: another choice makes anew only what it changes.
    _made: dict[str, _Made] = field(default_factory=dict[str, _Made])

    @property
    def axes(self) -> dict[str, TubeAxis]:
        """Of the tubes, by name."""
        return {axis.name: axis for axis in self.split.axes.values()}

    def join(self, tube: str, end: Literal[0, 1], to: str) -> TubeJoin:
        """Return the join of an end to another tube, wherever the two are."""
        axes = self.axes
        (made,) = acyclic_joins([join_of(axes[tube], end, axes[to])], axes)
        return made

    def tubes(
        self,
        joins: Sequence[TubeJoin] | None = None,
        without: Collection[str] = (),
        *,
        done: Callable[[], object] = lambda: None,
    ) -> LabelTubes:
        """Return the tubes with their organs, led into those that they join.

        Parameters
        ----------
        joins
            Other joins than those found; of several that make a ring the first are kept.
        without
            Names of tubes that are left out.
        done
            Called when a tube is made.

        Returns
        -------
        LabelTubes
            In LPS mm.
        """
        split, by_name = self.split, self.axes
        volume, names = split.volume, split.names
        voxel = float(volume.sizes.prod() ** (1.0 / 3.0))
        wanted = [
            join
            for join in (self.joins if joins is None else joins)
            if join.tube not in without and join.to not in without
        ]
        kept = [name for name in names.values() if name not in without]
        order, wanted, rings = parents_first(kept, wanted)
        made: dict[str, _Made] = {}
        for name in order:
            own = tuple(join for join in wanted if join.tube == name)
            into = tuple(join for join in wanted if join.to == name and join.place != "middle")
            key = (own, into, *(made[join.to].key for join in own))
            before = self._made.get(name)
            if before is not None and before.key == key:
                made[name] = before
            else:
                axis = by_name[name]
                foreign = _foreign(volume, axis, names)
                led_before = {other: each.axis for other, each in made.items()}
                goals = _goals(axis, wanted, by_name, led_before)
                to = {join.end: made[join.to].axis for join in own}
                led = _led(axis, goals, to, foreign, voxel)
                doubts = _branches(volume, led, voxel) + _open_sides(volume, axis)
                if axis.radius < _THIN_VOXELS * voxel:
                    doubts.append(
                        f"{name} is {2.0 * axis.radius / voxel:.1f} voxels thick: its radius may "
                        f"be a tenth off"
                    )
                cut = (_is_cut(volume, axis.places[0]), _is_cut(volume, axis.places[-1]))
                built = _organ(volume, led, voxel)
                tube = LabelTube(name, split.first[axis.voxels.label], led, built, cut)
                touches = tuple(_touches(axis, foreign, names))
                made[name] = self._made[name] = _Made(key, led, tube, touches, tuple(doubts))
            done()
        led = {name: each.axis for name, each in made.items()}
        return LabelTubes(
            tuple(each.tube for each in made.values()),
            tuple(_placed(join, led) for join in wanted),
            tuple(
                touch for each in made.values() for touch in each.touches if touch[1] not in without
            ),
            (
                *split.doubts,
                *(doubt for each in made.values() for doubt in each.doubts),
                *rings,
                *(self.nearly if joins is None else ()),
            ),
        )


def found_tubes(
    volume: LabelVolume,
    names: Mapping[int, str],
    *,
    done: Callable[[], object] = lambda: None,
) -> FoundTubes:
    """Return the axes of a volume's tubes, and where they join.

    Parameters
    ----------
    volume
        The labels; of those without a name nothing is taken.
    names
        Names of the tubes by their labels.
    done
        Called when a tube is found.

    Returns
    -------
    FoundTubes
        In LPS mm.

    Raises
    ------
    ImageStackError
        If a label is missing, in pieces, too thin or too short for a tube; its message names it.
    """
    if not names:
        raise ImageStackError(f"none of the labels of {volume.source} is named as a tube")
    split = split_labels(volume.around(names, _MARGIN), names, done=done)
    joins, nearly = found_joins(split.volume, split.axes)
    return FoundTubes(split, tuple(joins), tuple(nearly))


def _placed(join: TubeJoin, led: dict[str, TubeAxis]) -> TubeJoin:
    """Return a join with its station along the other's axis as it is in the end."""
    to = led[join.to]
    station, _ = to.nearest(led[join.tube].places[-join.end])
    if join.place != "middle":
        station = to.length if join.place == "end" else 0.0
    return replace(join, station=station)


def _rim(axis: TubeAxis, more: float) -> Floats:
    """Return (N, P, 3) places at the wall, and so much further out, mm."""
    angles = np.linspace(0.0, 2.0 * np.pi, _RIM_POINTS, endpoint=False)
    stations = np.linspace(0.0, float(axis.wall.knots[-1]), len(axis.places))
    away = axis.wall.radii(stations, angles) + more
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=0)
    across = np.einsum("nij,jp->npi", axis.frames[:, :, :2], directions)
    return axis.places[:, np.newaxis] + away[:, :, np.newaxis] * across


def _labels_at(volume: LabelVolume, places: Floats) -> NDArray[np.int32]:
    """Return the labels of the voxels at places, 0 beyond the volume."""
    indices = np.rint(volume.indices(places.reshape(-1, 3))).astype(np.intp)
    shape = np.array(volume.values.shape[::-1])
    there = ((indices >= 0) & (indices < shape)).all(axis=1)
    i, j, k = np.clip(indices, 0, shape - 1).T
    return np.where(there, volume.values[k, j, i], 0).reshape(places.shape[:-1])


def _foreign(volume: LabelVolume, axis: TubeAxis, names: Mapping[int, str]) -> NDArray[np.int32]:
    """Return (N, P) labels of other tubes at the rim of each section, 0 where there is none."""
    labels = _labels_at(volume, _rim(axis, 0.6 * float(volume.sizes.max())))
    others = [label for label in names if label != axis.voxels.label]
    return np.where(np.isin(labels, others), labels, 0)


def _touches(
    axis: TubeAxis, foreign: NDArray[np.int32], names: Mapping[int, str]
) -> list[tuple[str, str, float]]:
    ends = min(round(_FROM_ENDS_RADII * axis.radius / axis.step), len(foreign) // 2)
    middle = foreign[ends : len(foreign) - ends]
    found: list[tuple[str, str, float]] = []
    for label in (int(one) for one in np.unique(middle) if one != 0):
        length = axis.step * float(((middle == label).mean(axis=1) > _TOUCH_FRACTION).sum())
        if length > _TOUCH_RADII * axis.radius:
            found.append((axis.name, names[label], length))
    return found


def _goals(
    axis: TubeAxis, joins: list[TubeJoin], raw: dict[str, TubeAxis], led: dict[str, TubeAxis]
) -> dict[int, Floats | None]:
    """Return the places that a tube's ends are led to; None for what its own rays say."""
    goals: dict[int, Floats | None] = {}
    for join in joins:
        if join.tube == axis.name:
            to = led[join.to]
            side = join.place == "middle"
            goals[join.end] = None if side else to.places[-1 if join.place == "end" else 0]
        elif join.to == axis.name and join.place != "middle":
            # Its own end bends where its axis goes straight on: to the end that joins it.
            end = 1 if join.place == "end" else 0
            station = axis.length if end else 0.0
            if join.miss > _MEETS_RADII * axis.radius_at(station):
                goals[end] = raw[join.tube].places[-join.end]
    return goals


def _led(
    axis: TubeAxis,
    goals: dict[int, Floats | None],
    to: dict[int, TubeAxis],
    foreign: NDArray[np.int32],
    voxel: float,
) -> TubeAxis:
    """Return a tube with its joined ends led to the axes that they join."""
    if not goals:
        return axis
    places, fraction = axis.places, (foreign != 0).mean(axis=1)
    first, last = 0, len(places) - 1
    leads: dict[int, Floats] = {}
    for end, goal in goals.items():
        radius = min(axis.radius, axis.radius_at(axis.length if end else 0.0))
        most = min(round(_CUT_RADII * radius / axis.step), len(places) // 3)
        least = min(round(_LEAST_CUT_RADII * radius / axis.step), most)
        if end not in to:
            least = min(2 * least, most)
        free = fraction[::-1] if end else fraction
        clear = np.flatnonzero(free[least : most + 1] < _FOREIGN_FRACTION)
        cut = least + (int(clear[0]) if len(clear) else most - least)
        index = len(places) - 1 - cut if end else cut
        out = axis.frames[index, :, 2] * (1.0 if end else -1.0)
        if goal is None:
            goal = _ahead_on(to[end], places[index], out)
        leads[end] = _curve(places[index], out, goal, axis.step)
        if end:
            last = index
        else:
            first = index
    pieces = [places[first : last + 1]]
    if 0 in leads:
        pieces.insert(0, leads[0][::-1])
    if 1 in leads:
        pieces.append(leads[1])
    return fitted_axis(axis.voxels, np.concatenate(pieces), axis.radius, voxel)


def _ahead_on(to: TubeAxis, start: Floats, out: Floats) -> Floats:
    """Return the place on a tube's axis that a ray comes nearest to."""
    near, apart = to.nearest(start)
    far = apart + _RAY_RADII * to.radius_at(near)
    ray = start + np.linspace(0.0, far, 61)[:, np.newaxis] * out
    found = [to.nearest(place) for place in ray]
    station, _ = min(found, key=lambda one: one[1])
    return to.place(station)


def _curve(start: Floats, out: Floats, goal: Floats, step: float) -> Floats:
    """Return points of a curve from a start, along a direction there, to a goal (parabola)."""
    distance = float(np.linalg.norm(goal - start))
    count = max(1, round(distance / step))
    fraction = (np.arange(1, count + 1) / count)[:, np.newaxis]
    bend = start + 0.5 * distance * out
    return (1 - fraction) ** 2 * start + 2 * fraction * (1 - fraction) * bend + fraction**2 * goal


def _open_sides(volume: LabelVolume, axis: TubeAxis) -> list[str]:
    """Return a doubt if the volume ends in a tube's side."""
    indices = volume.indices(_rim(axis, 0.0).reshape(-1, 3))
    inside = (indices > -0.5) & (indices < np.array(volume.values.shape[::-1]) - 0.5)
    beyond = ~inside.all(axis=1).reshape(len(axis.places), -1)
    # Its ends may stand askew on the volume's side.
    ends = min(round(_FROM_ENDS_RADII * axis.radius / axis.step), (len(beyond) - 1) // 2)
    fraction = float(beyond[ends : len(beyond) - ends].mean())
    if fraction < _OPEN_FRACTION:
        return []
    if fraction > 0.5:
        raise ImageStackError(no_side(axis.voxels.label, axis.name))
    return [
        f"{axis.name}: {fraction:.0%} of its side lie outside the volume, which cuts through it: "
        f"what is beyond is made up"
    ]


def _is_cut(volume: LabelVolume, place: Floats) -> bool:
    at = volume.indices(place)
    return bool(((at < 1.0) | (at > np.array(volume.values.shape[::-1]) - 2.0)).any())


def _branches(volume: LabelVolume, axis: TubeAxis, voxel: float) -> list[str]:
    """Return a doubt if much of a label lies outside its tube: a branch, or the rest of a ring."""
    outside, _ = outside_wall(volume, axis, max(_BRANCH_RADII * axis.radius, 2.0 * voxel))
    size = float(outside.sum()) * voxel**3
    if size <= _BRANCH_VOLUME * axis.radius**3:
        return []
    places = volume.places(np.argwhere(outside)[:, ::-1] + axis.voxels.corner)
    x, y, z = np.median(places, axis=0)
    return [
        f"{axis.name}: {size:.0f} mm3 of its label lie outside the tube, near ({x:.0f}, {y:.0f}, "
        f"{z:.0f}): it may branch or be a ring, and a tube has one axis and two ends"
    ]


def _organ(volume: LabelVolume, axis: TubeAxis, voxel: float) -> BuiltOrgan:
    """Return the organ of a tube's wall, by sections across its axis."""
    count = max(6, round(axis.length / max(_SECTION_FRACTION * axis.radius, 0.25 * voxel)) + 1)
    stations = np.linspace(0.0, axis.length, count)
    at = stations / axis.step
    before = np.minimum(at.astype(np.intp), len(axis.places) - 2)
    fraction = (at - before)[:, np.newaxis]
    origins = (1.0 - fraction) * axis.places[before] + fraction * axis.places[before + 1]
    nearest = np.rint(at).astype(np.intp).clip(0, len(axis.places) - 1)
    frames = axis.frames[nearest]
    angles = np.linspace(0.0, 2.0 * np.pi, _RIM_POINTS, endpoint=False)
    scale = float(axis.wall.knots[-1]) / axis.length
    away = axis.wall.radii(stations * scale, angles)
    half = int(np.ceil(away.max() / voxel)) + 4
    side = 2 * half + 1
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    edges = half + away[:, :, np.newaxis] * directions / voxel
    # Frames from the volume's own axes, in which its voxels are cut.
    steps = np.swapaxes(volume.axes.T @ frames[:, :, :2], 1, 2) * voxel / volume.sizes
    stack = ImageStack(
        source=volume.source,
        names=tuple(f"{axis.name} at {station:.2f} mm" for station in stations),
        slices=ReslicedSlices(
            levels=axis.voxels.inside,
            outside_level=0.0,
            centres=volume.indices(origins) - axis.voxels.corner,
            steps=steps,
            shape=(side, side),
        ),
        shape=(side, side),
        planes=ImagePlanes(
            pixel_size=np.array([voxel, voxel]),
            slice_spacing=axis.length / (count - 1),
            origins=origins,
            frames=frames,
        ),
    )
    traced = TracedOrgan(
        sections=tuple(
            TracedSection(index=i, outer=edge, lumen=None, other_component=False, threshold=127.5)
            for i, edge in enumerate(edges)
        ),
        problems={},
        polarity="bright",
        notes=(),
    )
    fitted = fit_organ(stack, traced)
    overall = max(_OVERALL_FRACTION * axis.radius, _OVERALL_VOXELS * voxel)
    tolerance: float | None = None
    for _ in range(_RAISES):
        try:
            asked = Promise(overall_mm=overall, tolerance_mm=tolerance)
            return build_fitted(fitted, asked, name=axis.name)
        except ToleranceTooSmall as error:
            # A section that two degree-6 curves cannot follow, as at a blunt end.
            overall, tolerance = 2.0 * overall, max(1.1 * error.smallest_mm, 8.0 * overall)
    return build_fitted(fitted, name=axis.name)
