# SciPy has no types.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""An anatomy as a volume of labels: what a segmentation of its images would be."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.anatomy.anatomy_geometry import TubeLine
from app.anatomy.tables import HEAD_RIGHT_FRONT, Anatomy
from app.anatomy.tube_kinds import wall_of
from organ_geometry import LabelVolume

Floats = NDArray[np.float64]

_MARGIN_MM = 3.0
_MOST_VOXELS = 300_000_000
_LEAST_MM, _MOST_MM = 0.05, 5.0  # of a voxel
# Between the places of an axis that voxels are compared with, of a voxel.
_STEP_FRACTION = 0.2


def labels_suffix(path: Path) -> None:
    """Raise a ValueError if a file's name is not that of segments with names."""
    if path.suffix.lower() != ".nrrd":
        raise ValueError(
            f"labels with names are written as .seg.nrrd, which 3D Slicer reads, not {path.name!r}"
        )


def anatomy_labels(
    anatomy: Anatomy,
    lines: dict[str, TubeLine],
    voxel_mm: float | tuple[float, float, float],
) -> LabelVolume:
    """Return a volume in which each voxel is of the tube that its centre lies in.

    Where tubes run into each other the thickest has the voxel; ends are cut off flat.

    Parameters
    ----------
    anatomy, lines
        The anatomy and its tubes' axes, which are round here, with an organ or without.
    voxel_mm
        Size of the voxels, mm: of cubes, or along x, y and z of LPS.

    Returns
    -------
    LabelVolume
        Labels from 1 in the order of the file, with names and kinds, in LPS.

    Raises
    ------
    ValueError
        If the voxels are too many, or of no size.
    """
    sizes = np.broadcast_to(np.array(voxel_mm, dtype=np.float64), 3).copy()
    for size in sizes.tolist():
        if not _LEAST_MM <= size <= _MOST_MM:
            raise ValueError(f"voxels are {_LEAST_MM:g} to {_MOST_MM:g} mm large, not {size:g} mm")
    rows, origin = np.array(HEAD_RIGHT_FRONT), np.zeros(3)
    if anatomy.place is not None:
        rows, origin = np.array(anatomy.place.rows_LPS), np.array(anatomy.place.origin_LPS_mm)
    lps = {name: line.places @ rows + origin for name, line in lines.items()}
    widest = {name: float(line.radius.max()) for name, line in lines.items()}
    low = np.min([lps[name].min(axis=0) - widest[name] for name in lps], axis=0) - _MARGIN_MM
    high = np.max([lps[name].max(axis=0) + widest[name] for name in lps], axis=0) + _MARGIN_MM
    counts = np.ceil((high - low) / sizes).astype(np.intp) + 1
    if counts.prod(dtype=np.float64) > _MOST_VOXELS:
        raise ValueError(
            f"voxels of {sizes.min():g} mm would be {' x '.join(map(str, counts))}: give larger "
            f"ones"
        )
    values = np.zeros(counts[::-1], dtype=np.int32)
    order = list(lines)
    for name in sorted(order, key=lambda each: widest[each]):
        first = np.floor((lps[name].min(axis=0) - widest[name] - low) / sizes).astype(np.intp)
        last = np.ceil((lps[name].max(axis=0) + widest[name] - low) / sizes).astype(np.intp) + 1
        x, y, z = (low[n] + sizes[n] * np.arange(first[n], last[n]) for n in range(3))
        grid = np.stack(np.meshgrid(z, y, x, indexing="ij")[::-1], axis=-1)
        inside = _inside(lps[name], lines[name], grid.reshape(-1, 3), float(sizes.min()))
        box = tuple(slice(first[n], last[n]) for n in (2, 1, 0))
        values[box][inside.reshape(grid.shape[:3])] = order.index(name) + 1
    labels = {number + 1: tube for number, tube in enumerate(anatomy.tube)}
    return LabelVolume(
        source=Path(anatomy.name),
        values=values,
        sizes=sizes,
        origin=low,
        axes=np.eye(3),
        names={label: tube.name for label, tube in labels.items()},
        terms={label: wall_of(tube.kind).term for label, tube in labels.items()},
    )


def _inside(places: Floats, line: TubeLine, centres: Floats, voxel: float) -> NDArray[np.bool_]:
    """Return which centres lie in a tube along an axis."""
    from scipy.spatial import KDTree  # of an extra: who makes no labels needs none

    count = max(2, round(line.length / (_STEP_FRACTION * voxel)) + 1)
    stations = np.linspace(0.0, line.length, count)
    axis = np.stack([np.interp(stations, line.stations, each) for each in places.T], axis=1)
    radii = np.interp(stations, line.stations, line.radius)
    away, nearest = KDTree(axis).query(centres, distance_upper_bound=float(radii.max()))
    inside = np.zeros(len(centres), dtype=bool)
    there = np.flatnonzero(np.isfinite(away))
    near = np.asarray(nearest)[there]
    ahead = ((centres[there] - axis[near]) * np.gradient(axis, axis=0)[near]).sum(axis=1)
    beyond = ((near == 0) & (ahead < 0.0)) | ((near == count - 1) & (ahead > 0.0))
    inside[there] = (np.asarray(away)[there] < radii[near]) & ~beyond
    return inside
