# SciPy has no types.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""Which end of a tube joins which other tube, and where.

An end joins the tube that most of the voxels ahead of it are of, if these are at least half a
section and a ray from the end along its axis comes near the other's axis. Tubes that only touch are
not joined. Where two ends meet the thicker tube is the parent; where an end meets a side, the one
with the side.
"""

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from organ_geometry.images.label_volume import LabelVolume
from organ_geometry.tubes.tube_axis import TubeAxis

JoinPlace: TypeAlias = Literal["begin", "end", "middle"]
Floats = NDArray[np.float64]

_REACH_RADII = 1.6  # ahead of an end, of its radius, where voxels of another tube are looked for
_BEHIND_RADII = 0.8
_RAY_RADII = 1.5  # how far an end's ray goes, of the other's radius
_MISS_RADII = 1.1  # how near it comes to the other's axis
_END_RADII = 1.2  # so near to an end of the other, in radii there, it is joined to that end
# Two ends that found each other so near to the ends meet end to end.
_MUTUAL_RADII = 3.0
_SECTION_FRACTION = 0.5
_FEWEST_VOXELS = 4


@dataclass(frozen=True, slots=True)
class TubeJoin:
    """An end of a tube on another tube."""

    tube: str
    end: Literal[0, 1]
    to: str
    place: JoinPlace
    station: float  # along the other tube's axis, mm
    miss: float  # distance by which the end's ray misses that axis, mm
    voxels: int  # of the other tube, ahead of the end


@dataclass(frozen=True, slots=True, eq=False)
class _Ahead:
    """What is ahead of an end: voxels by label, and whether the volume ends there."""

    point: Floats
    radius: float  # there, mm
    counts: dict[int, int]
    cut: bool


def found_joins(
    volume: LabelVolume, tubes: dict[int, TubeAxis]
) -> tuple[list[TubeJoin], list[str]]:
    """Return the joins of tubes by label, and sentences on ends that nearly join.

    Parameters
    ----------
    volume
        The labels.
    tubes
        Tubes by their labels.

    Returns
    -------
    tuple[list[TubeJoin], list[str]]
        One join for each end at most, and doubts.
    """
    found: list[TubeJoin] = []
    doubts: list[str] = []
    ends: tuple[Literal[0, 1], ...] = (0, 1)
    for label, tube in tubes.items():
        for end in ends:
            ahead = _ahead(volume, tubes, label, end)
            if not ahead.counts:
                continue
            other = max(ahead.counts, key=lambda key: ahead.counts[key])
            join = _join(volume, tube, end, tubes[other], ahead, ahead.counts[other])
            if isinstance(join, TubeJoin):
                found.append(join)
            elif join:
                doubts.append(join)
    return acyclic_joins(found, {tube.name: tube for tube in tubes.values()}), doubts


def _end(tube: TubeAxis, end: int) -> tuple[Floats, Floats, float]:
    """Return an end's place, mm, the direction out of it, and the radius there, mm."""
    inner = min(tube.radius, 0.25 * tube.length)
    radius = tube.radius_at(tube.length - inner if end else inner)
    return tube.places[-end], tube.frames[-end, :, 2] * (1.0 if end else -1.0), radius


def _ahead(volume: LabelVolume, tubes: dict[int, TubeAxis], label: int, end: int) -> _Ahead:
    point, out, radius = _end(tubes[label], end)
    largest = float(volume.sizes.max())
    looked = max(radius, 1.5 * largest)
    reach = _REACH_RADII * looked + 1.5 * largest
    middle, half = volume.indices(point), reach / volume.sizes
    shape = np.array(volume.values.shape[::-1])
    low = np.clip(np.floor(middle - half), 0, shape - 1).astype(int)
    high = np.clip(np.ceil(middle + half) + 1, 1, shape).astype(int)
    box = volume.values[low[2] : high[2], low[1] : high[1], low[0] : high[0]]
    mine = box == label
    around = ndimage.binary_dilation(mine, np.ones((3, 3, 3))) & ~mine
    indices = np.argwhere(around)[:, ::-1]
    off = volume.places(indices + low) - point
    wanted = (off @ out > -_BEHIND_RADII * looked) & (np.linalg.norm(off, axis=1) < reach)
    labels = box[around][wanted]
    counts = {int(one): int((labels == one).sum()) for one in np.unique(labels) if one in tubes}
    at = volume.indices(point)
    cut = bool(((at < 1.5) | (at > shape - 2.5)).any())
    return _Ahead(point, radius, counts, cut)


def join_of(tube: TubeAxis, end: Literal[0, 1], other: TubeAxis, voxels: int = 0) -> TubeJoin:
    """Return the join of an end to another tube, where its ray comes nearest to that one's axis."""
    point, out, radius = _end(tube, end)
    near, _ = other.nearest(point)
    theirs = other.radius_at(near)
    station, _ = other.nearest(point + theirs * out)
    ray = point + np.linspace(0.0, _RAY_RADII * theirs, 13)[:, np.newaxis] * out
    miss = min(other.nearest(place)[1] for place in ray)
    at_end = other.radius_at(0.0 if station < 0.5 * other.length else other.length)
    close = _END_RADII * max(min(other.radius, at_end), radius)
    place: JoinPlace = "middle"
    if min(station, other.length - station) < close:
        place = "begin" if station < other.length - station else "end"
    return TubeJoin(tube.name, end, other.name, place, station, miss, voxels)


def _join(
    volume: LabelVolume,
    tube: TubeAxis,
    end: Literal[0, 1],
    other: TubeAxis,
    ahead: _Ahead,
    count: int,
) -> TubeJoin | str | None:
    """Return an end's join, or a sentence why it is none, or nothing where it hardly touches."""
    if count < _FEWEST_VOXELS:
        return None
    join = join_of(tube, end, other, count)
    theirs = other.radius_at(other.nearest(ahead.point)[0])
    face = float(volume.sizes.prod()) ** (2.0 / 3.0)
    needed = _SECTION_FRACTION * np.pi * min(ahead.radius, theirs) ** 2 / face
    limit = _MISS_RADII * theirs + 0.5 * float(volume.sizes.max())
    if ahead.cut or count < needed or (join.place == "middle" and join.miss > limit):
        why = f"its axis misses the other by {join.miss:.1f} mm"
        if ahead.cut:
            why = "the volume ends there"
        if not ahead.cut and count < needed:
            why = f"they touch in {count} voxels, half a section has {needed:.0f}"
        return f"end {end} of {tube.name} touches {other.name} and does not join it: {why}"
    return join


def acyclic_joins(found: list[TubeJoin], tubes: dict[str, TubeAxis]) -> list[TubeJoin]:
    """Return joins, one for each pair of ends that meet: from the thinner to the thicker tube."""
    by_end = {(join.tube, join.end): join for join in found}
    kept: dict[tuple[str, int], TubeJoin] = {}
    for join in found:
        other = tubes[join.to]
        meets: Literal[0, 1] = 0 if join.station < 0.5 * other.length else 1
        back = by_end.get((join.to, meets))
        mutual = back is not None and back.to == join.tube
        gap = other.length - join.station if meets else join.station
        if join.place == "middle" and not (mutual and gap < _MUTUAL_RADII * other.radius):
            kept[join.tube, join.end] = join
        elif other.radius >= tubes[join.tube].radius:
            kept[join.tube, join.end] = replace(join, place="end" if meets else "begin")
        elif back is None or mutual:
            # The thinner tube's end joins the thicker one's, whichever found the other.
            turned = TubeJoin(
                tube=join.to,
                end=meets,
                to=join.tube,
                place="end" if join.end else "begin",
                station=tubes[join.tube].length if join.end else 0.0,
                miss=join.miss,
                voxels=join.voxels,
            )
            kept.setdefault((turned.tube, turned.end), turned)
    return list(kept.values())


def parents_first(
    names: list[str], joins: list[TubeJoin]
) -> tuple[list[str], list[TubeJoin], list[str]]:
    """Return tubes, each after those it joins, joins less the last of every ring, and doubts."""
    kept: list[TubeJoin] = []
    doubts: list[str] = []
    for join in joins:
        if not _reaches(kept, join.to, join.tube):
            kept.append(join)
        else:
            doubts.append(
                f"{join.tube} does not join {join.to}, which joins it or what it joins: tubes "
                f"would be parents of each other"
            )
    order: list[str] = []

    def add(name: str) -> None:
        if name not in order:
            for join in kept:
                if join.tube == name:
                    add(join.to)
            order.append(name)

    for name in names:
        add(name)
    return order, kept, doubts


def _reaches(joins: list[TubeJoin], start: str, goal: str) -> bool:
    return start == goal or any(
        _reaches(joins, join.to, goal) for join in joins if join.tube == start
    )
