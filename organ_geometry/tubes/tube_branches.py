# SciPy has no types.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""The axes of labels' tubes; what of a label leaves its tube's side is a tube of its own.

A tube has one axis. So the part of a label that lies well outside its tube's wall, and is joined to
it in one place away from its ends, is taken for a branch and given a label of its own: it
joins the tube as any other tube would.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree

from organ_geometry.images.grey_image import ImageStackError
from organ_geometry.images.label_volume import LabelVolume
from organ_geometry.tubes.tube_axis import (
    LabelVoxels,
    TubeAxis,
    fitted_axis,
    label_voxels,
    tube_axis,
)

Floats = NDArray[np.float64]

# A branch lies so far outside the wall, in radii, and is at least so large, in cubed radii. It
# begins a voxel outside the wall.
_AWAY_RADII, _LEAST_VOLUME, _BEGINS_VOXELS = 0.6, 1.0, 1.0
# It leaves the tube within so long a stretch, and not so near to an end, in radii.
_MOST_CONTACT, _FROM_END = 4.0, 1.5
_MOST_TUBES = 8  # of one label


@dataclass(frozen=True, slots=True, eq=False)
class SplitLabels:
    """Labels of which each is one tube.

    Attributes
    ----------
    volume, names, axes
        The labels with branches of their own, the tubes' names and axes by label.
    first
        The label, as it was given, of each.
    doubts
        A sentence on each branch, and on each part that was left out.
    """

    volume: LabelVolume
    names: dict[int, str]
    axes: dict[int, TubeAxis]
    first: dict[int, int]
    doubts: tuple[str, ...]


def split_labels(
    volume: LabelVolume,
    names: Mapping[int, str],
    *,
    done: Callable[[], object],
) -> SplitLabels:
    """Return the axes of labels' tubes, those of their branches among them.

    Parameters
    ----------
    volume, names
        The labels, and the names of those that are tubes. A branch is named as its tube with 2, 3
        ... after it.
    done
        Called after each label.

    Returns
    -------
    SplitLabels
        With a volume of its own if there is a branch.

    Raises
    ------
    ImageStackError
        If a label is no tube.
    """
    voxel = float(volume.sizes.prod() ** (1.0 / 3.0))
    any_tube = np.isin(volume.values, list(names))
    found = dict(names)
    axes: dict[int, TubeAxis] = {}
    first: dict[int, int] = {}
    doubts: list[str] = []
    free = int(volume.values.max()) + 1
    changed = False
    for label, name in names.items():
        voxels = label_voxels(volume, label, name, any_tube)
        doubts += voxels.doubts
        axes[label], first[label] = tube_axis(volume, voxels), label
        trunks, count = [label], 1
        while trunks and count < _MOST_TUBES:
            trunk = trunks.pop()
            for indices in _branches(volume, axes[trunk], voxel):
                if not changed:
                    volume, changed = replace(volume, values=volume.values.copy()), True
                made = _branch(volume, axes[trunk], indices, free, voxel)
                if made is None:
                    continue
                count += 1
                named = next(
                    each
                    for number in range(2, 2 + len(found) + _MOST_TUBES)
                    if (each := f"{name}_{number}") not in found.values()
                )
                found[free], first[free] = named, label
                axes[free] = replace(made, voxels=replace(made.voxels, name=named))
                x, y, z = made.places[0]
                doubts.append(
                    f"{axes[trunk].name} branches near ({x:.0f}, {y:.0f}, {z:.0f}): its branch, "
                    f"{made.length:.0f} mm long, is {named}"
                )
                trunks.append(free)
                free += 1
            if any(first[each] == label for each in trunks):
                # Its wall without what is its branch's now.
                again = label_voxels(volume, trunk, axes[trunk].name, any_tube)
                axes[trunk] = fitted_axis(again, axes[trunk].places, axes[trunk].radius, voxel)
        done()
    return SplitLabels(volume, found, axes, first, tuple(doubts))


def outside_wall(
    volume: LabelVolume, axis: TubeAxis, more: float
) -> tuple[NDArray[np.bool_], Floats]:
    """Return which voxels of a tube's box lie so far outside its wall, mm, and all their stations.

    Parameters
    ----------
    volume, axis
        The labels and the tube.
    more
        Distance beyond the wall, mm.

    Returns
    -------
    tuple[NDArray[np.bool_], Floats]
        (K, J, I) masks, and the axis's station nearest to each voxel of the label, NaN elsewhere.
    """
    inside = axis.voxels.inside > 0
    indices = np.argwhere(inside)
    places = volume.places(indices[:, ::-1] + axis.voxels.corner)
    away, nearest = KDTree(axis.places).query(places)
    at = np.asarray(nearest, dtype=np.float64) * axis.step
    wall = np.interp(at, axis.wall.knots, axis.wall.coefficients[:, 0])
    outside = np.zeros(inside.shape, dtype=bool)
    outside[inside] = np.asarray(away) > wall + more
    stations = np.full(inside.shape, np.nan)
    stations[inside] = at
    return outside, stations


def _branches(volume: LabelVolume, axis: TubeAxis, voxel: float) -> list[NDArray[np.intp]]:
    """Return (V, 3) indices K, J, I of the voxels of each branch of a tube."""
    far, stations = outside_wall(volume, axis, max(_AWAY_RADII * axis.radius, 2.0 * voxel))
    needed = _LEAST_VOLUME * axis.radius**3 / voxel**3
    if far.sum() < needed:
        return []
    begun, _ = outside_wall(volume, axis, _BEGINS_VOXELS * voxel)
    every = np.ones((3, 3, 3))
    labelled: Any = ndimage.label(begun, every)
    labels, count = labelled
    found: list[NDArray[np.intp]] = []
    for number in range(1, count + 1):
        component = labels == number
        if (component & far).sum() < needed:
            continue
        around: Any = ndimage.binary_dilation(component, every)
        contact = around & (axis.voxels.inside > 0) & ~begun
        patches: Any = ndimage.label(contact, every)
        sizes = np.bincount(patches[0].ravel())[1:]
        at = stations[contact]
        ends = _FROM_END * axis.radius
        if (
            (sizes > 0.25 * sizes.sum()).sum() == 1
            and np.ptp(np.percentile(at, [5.0, 95.0])) < _MOST_CONTACT * axis.radius
            and ends < np.median(at) < axis.length - ends
        ):
            found.append(np.argwhere(component) + axis.voxels.corner[::-1])
    return found


def _branch(
    volume: LabelVolume, trunk: TubeAxis, indices: NDArray[np.intp], label: int, voxel: float
) -> TubeAxis | None:
    """Give voxels a label of their own and return their tube's axis; None where it is none."""
    k, j, i = indices.T
    volume.values[k, j, i] = label
    any_tube = np.isin(volume.values, [label, trunk.voxels.label])
    try:
        voxels = label_voxels(volume, label, trunk.name, any_tube)
        try:
            axis = tube_axis(volume, voxels)
        except ImageStackError:
            # Too short for paths through its depths: straight away from the trunk.
            axis = _stub(volume, trunk, indices, voxels, voxel)
    except ImageStackError:
        volume.values[k, j, i] = trunk.voxels.label
        return None
    if trunk.nearest(axis.places[0])[1] > trunk.nearest(axis.places[-1])[1]:
        axis = fitted_axis(voxels, axis.places[::-1], axis.radius, voxel)
    return axis


def _stub(
    volume: LabelVolume,
    trunk: TubeAxis,
    indices: NDArray[np.intp],
    voxels: LabelVoxels,
    voxel: float,
) -> TubeAxis:
    """Return the straight axis of a short branch, away from the trunk."""
    places = volume.places(indices[:, ::-1])
    middle = places.mean(axis=0)
    root = trunk.place(trunk.nearest(middle)[0])
    direction = (middle - root) / np.linalg.norm(middle - root)
    along = (places - middle) @ direction
    low, high = float(along.min()), float(along.max())
    radius = float(np.sqrt(voxels.volume / (np.pi * (high - low))))
    if high - low < 2.0 * radius:
        raise ImageStackError(f"a branch of {trunk.name} is too short for a tube")
    line = middle + np.linspace(low, high, 25)[:, np.newaxis] * direction
    return fitted_axis(voxels, line, radius, voxel)
