# SciPy has no types.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""One label's tube: its voxels, its axis from end to end, and its wall."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from organ_geometry.images.grey_image import ImageStackError
from organ_geometry.images.label_components import DOUBTED_FRACTION, label_components
from organ_geometry.images.label_volume import LabelVolume
from organ_geometry.reslice.centreline import (
    SMOOTH_RADII,
    TANGENT_RADII,
    NoTube,
    Tube,
    centreline,
)
from organ_geometry.reslice.curve_frames import (
    evenly_spaced,
    rotation_minimising_frames,
    smooth_points,
    smooth_tangents,
)
from organ_geometry.tubes.tube_wall import TubeWall, fitted_wall

Floats = NDArray[np.float64]

# A second part of a label with more than this share of it is refused.
_REFUSED_FRACTION = 0.2
_FEWEST_VOXELS = 12
# Least radius of a tube, in voxels.
_THINNEST = 0.75
_STEP_FRACTION = 0.25  # between points of the axis, of the radius
# Rounds of moving the axis to the middle of its wall; that of a tube of so many voxels of radius
# is there from the start, by its sections.
_ROUNDS, _LARGE_VOXELS = 5, 10.0
# How far from the surface voxels say where it is, in voxels.
_NEAR_VOXELS = 2.5
# How far a voxel of another tube is trusted to be outside this one.
_FOREIGN_TRUST = 0.03
_ACROSS = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True, slots=True, eq=False)
class LabelVoxels:
    """A tube's voxels, and those around it that say where its wall is."""

    name: str
    label: int
    inside: NDArray[np.uint8]  # (K, J, I) 255 inside, in a box around the tube
    corner: NDArray[np.intp]  # (3,) first voxel of the box, I, J, K
    volume: float  # mm^3
    near: Floats  # (V, 3) centres of voxels near the surface, LPS mm
    is_inside: NDArray[np.bool_]  # (V,) whether each is of the tube
    trust: Floats  # (V,) how far that is trusted: little, of voxels that are another tube's
    doubts: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class TubeAxis:
    """A tube's axis, points at equal distances, and its wall around it."""

    voxels: LabelVoxels
    places: Floats  # (N, 3) LPS mm
    frames: Floats  # (N, 3, 3), the third column along the axis
    wall: TubeWall
    radius: float  # of a round tube as long and as large, mm

    @property
    def name(self) -> str:
        """The tube's name."""
        return self.voxels.name

    @property
    def step(self) -> float:
        """Distance between points, mm."""
        return self.length / (len(self.places) - 1)

    @property
    def length(self) -> float:
        """Length of the axis, mm."""
        return float(np.linalg.norm(np.diff(self.places, axis=0), axis=1).sum())

    def radius_at(self, station: float) -> float:
        """Return the mean distance of the wall from the axis at a station, mm."""
        return float(np.interp(station, self.wall.knots, self.wall.coefficients[:, 0]))

    def nearest(self, place: Floats) -> tuple[float, float]:
        """Return the station nearest to a place and the distance there, mm."""
        steps = np.diff(self.places, axis=0)
        fraction = ((place - self.places[:-1]) * steps).sum(axis=1) / (steps**2).sum(axis=1)
        fraction = np.clip(fraction, 0.0, 1.0)
        feet = self.places[:-1] + fraction[:, np.newaxis] * steps
        apart = np.linalg.norm(feet - place, axis=1)
        piece = int(apart.argmin())
        return (piece + float(fraction[piece])) * self.step, float(apart[piece])

    def place(self, station: float) -> Floats:
        """Return the (3,) place at a station, mm."""
        at = station / self.step
        before = min(int(at), len(self.places) - 2)
        fraction = at - before
        return (1.0 - fraction) * self.places[before] + fraction * self.places[before + 1]


def label_voxels(
    volume: LabelVolume, label: int, name: str, tubes: NDArray[np.bool_]
) -> LabelVoxels:
    """Return a label's largest connected part and what is around it.

    Parameters
    ----------
    volume, label, name
        The labels, the tube's and its name.
    tubes
        (K, J, I) which voxels are of any tube.

    Returns
    -------
    LabelVoxels
        With a doubt where smaller parts are left out.

    Raises
    ------
    ImageStackError
        If the label has no voxels, too few, or another part nearly as large.
    """
    mine = volume.values == label
    found: Any = ndimage.find_objects(mine.astype(np.uint8))
    if not found:
        raise ImageStackError(f"label {label} ({name}) is not in {volume.source}")
    box = tuple(
        slice(max(one.start - 8, 0), min(one.stop + 8, size))
        for one, size in zip(found[0], mine.shape, strict=True)
    )
    mine = mine[box]
    components = label_components(mine, volume.sizes)
    inside, voxel = components.largest, float(volume.sizes.prod())
    doubts: list[str] = []
    if components.fraction > _REFUSED_FRACTION:
        raise ImageStackError(
            f"label {label} ({name}) is in {components.count} parts, the second "
            f"{components.gap:.1f} mm from the first and {components.fraction:.0%} of it: "
            "join them, or give each a label of its own"
        )
    if components.fraction > DOUBTED_FRACTION:
        doubts.append(
            f"{name}: a part of {components.second} voxels, {components.gap:.1f} mm away, "
            "is left out of it"
        )
    if int(inside.sum()) < _FEWEST_VOXELS:
        raise ImageStackError(
            f"label {label} ({name}) has {int(inside.sum())} voxels: a tube needs "
            f"{_FEWEST_VOXELS} or more"
        )
    if _cut_fraction(inside, volume.sizes) > 0.5:
        raise ImageStackError(no_side(label, name))
    corner = np.array([one.start for one in box][::-1], dtype=np.intp)
    reach = _NEAR_VOXELS * voxel ** (1.0 / 3.0)
    depth = _away(inside, volume.sizes)
    outside = _away(~inside, volume.sizes)
    near = (depth < reach) & (outside < reach)
    indices = np.argwhere(near)[:, ::-1] + corner
    return LabelVoxels(
        name=name,
        label=label,
        inside=inside.astype(np.uint8) * np.uint8(255),
        corner=corner,
        volume=float(inside.sum()) * voxel,
        near=volume.places(indices),
        is_inside=inside[near],
        trust=np.where((tubes[box] & ~inside)[near], _FOREIGN_TRUST, 1.0),
        doubts=tuple(doubts),
    )


def no_side(label: int, name: str) -> str:
    """Return why a label is refused that the volume cuts on most sides."""
    return f"label {label} ({name}) is no tube: the volume ends where most of its side would be"


def _cut_fraction(inside: NDArray[np.bool_], sizes: Floats) -> float:
    """Return how much of a label's surface is where the volume ends, which alone has no margin."""
    cut = whole = 0.0
    for axis, size in enumerate(sizes[::-1].tolist()):
        ends = np.count_nonzero(inside.take([0, -1], axis=axis)) / size
        cut += ends
        whole += ends + np.count_nonzero(np.diff(inside, axis=axis)) / size
    return cut / whole


def _away(mask: NDArray[np.bool_], sizes: Floats) -> Floats:
    """Return the distance of each voxel in a mask to the nearest outside, mm."""
    return np.asarray(ndimage.distance_transform_edt(mask, sampling=sizes[::-1]))


def tube_axis(volume: LabelVolume, voxels: LabelVoxels) -> TubeAxis:
    """Return the axis of a label's tube, moved to the middle of its wall, and the wall."""
    # Thick slices as several thin ones, if a path from voxel to voxel has too few steps of them.
    thin = np.maximum(1, np.round(volume.sizes / volume.sizes.min())).astype(np.intp)
    for components in (np.ones(3, dtype=np.intp), thin):
        fine = voxels.inside
        for axis in range(3):
            fine = np.repeat(fine, components[axis], axis=2 - axis)
        sizes = volume.sizes / components
        try:
            line = centreline(Tube(fine, sizes))
        except NoTube as error:
            reason = error
        else:
            break
    else:
        raise ImageStackError(
            f"label {voxels.label} ({voxels.name}) is no tube: {reason}; give it the kind shown to "
            f"leave it out"
        )
    indices = (line.points / sizes - 0.5 * (components - 1.0)) / components
    places = volume.places(indices + voxels.corner)
    length = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    radius = float(np.sqrt(voxels.volume / (np.pi * length)))
    voxel = float(volume.sizes.prod() ** (1.0 / 3.0))
    if radius < _THINNEST * voxel:
        raise ImageStackError(
            f"label {voxels.label} ({voxels.name}) is {2 * radius / voxel:.1f} voxels thick: "
            f"{2 * _THINNEST:g} or more are needed"
        )
    if places[0, 2] > places[-1, 2]:
        places = places[::-1]
    return fitted_axis(voxels, places, radius, voxel)


def fitted_axis(voxels: LabelVoxels, places: Floats, radius: float, voxel: float) -> TubeAxis:
    """Return an axis moved to the middle of its wall in a few rounds, and the wall."""
    gap = _STEP_FRACTION * radius
    harmonics = 2 if radius < 3.0 * voxel else 4 if radius < 8.0 * voxel else 6
    for _ in range(_ROUNDS - 1 if radius < _LARGE_VOXELS * voxel else 0):
        places, frames = _smoothed(places, radius, gap)
        wall = fitted_wall(
            places, frames, voxels.near, voxels.is_inside, voxels.trust, radius, voxel, harmonics=1
        )
        stations = np.linspace(0.0, float(wall.knots[-1]), len(places))
        off = np.stack(
            [np.interp(stations, wall.knots, wall.coefficients[:, k]) for k in (1, 2)], axis=1
        )
        off *= np.minimum(1.0, 0.5 * radius / np.maximum(np.hypot(*off.T), 1e-12))[:, np.newaxis]
        places = places + np.einsum("nij,nj->ni", frames[:, :, :2], off)
    places, frames = _smoothed(places, radius, gap)
    wall = fitted_wall(
        places,
        frames,
        voxels.near,
        voxels.is_inside,
        voxels.trust,
        radius,
        voxel,
        harmonics=harmonics,
    )
    return TubeAxis(voxels, places, frames, wall, radius)


def _smoothed(places: Floats, radius: float, gap: float) -> tuple[Floats, Floats]:
    """Return an axis smoothed, points about so far apart, and frames along it."""
    reach = round(SMOOTH_RADII * radius / gap)
    places = evenly_spaced(smooth_points(evenly_spaced(places, gap), reach), gap)
    tangents = smooth_tangents(places, round(TANGENT_RADII * radius / gap))
    return places, rotation_minimising_frames(places, tangents, _ACROSS)
