# highdicom has no complete types.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false, reportMissingImports=false, reportAttributeAccessIssue=false
"""Segments in DICOM segmentations, through highdicom, which is loaded when the first is read."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from organ_geometry.images.grey_image import ImageStackError
from organ_geometry.images.medical_file import MedicalHeader, is_dicom_file

Ints = NDArray[np.int64]

# Slices without a segment are left out of files: so many are put before the first and after the
# last, so that a tube that ends there is not taken for one that the volume cuts off.
_EMPTY_SLICES = 10
# How far grids of several files may be from one, in voxels.
_OFF_GRID = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class DicomSegment:
    """A segment: its name and term, and (K, J, I) whether voxels are in it."""

    name: str
    term: str  # scheme, code and meaning, as SCT^51114001^Artery
    mask: NDArray[np.bool_]


def segmentation_files(path: Path) -> list[Path]:
    """Return the DICOM files of a path: itself, or those in a folder; of no DICOM none."""
    if path.is_dir():
        return sorted(file for file in path.iterdir() if file.is_file() and is_dicom_file(file))
    return [path] if is_dicom_file(path) else []


def dicom_segments(files: list[Path]) -> tuple[list[DicomSegment], MedicalHeader]:
    """Return the segments of DICOM files on one grid; images among them are passed over.

    Parameters
    ----------
    files
        DICOM files, of which one or more are segmentations.

    Returns
    -------
    tuple[list[DicomSegment], MedicalHeader]
        In the order of files and segments, and where their voxels stand.

    Raises
    ------
    ImageStackError
        If highdicom is not installed, none is a segmentation, one cannot be read, or their grids
        differ.
    """
    try:
        import highdicom
        import pydicom
    except ImportError as error:
        raise ImageStackError(
            f"DICOM segmentations are read with {error.name}, which is missing: "
            f"pip install 'bluntdissect[dicom-seg]'"
        ) from error
    found: list[tuple[Path, list[DicomSegment], MedicalHeader]] = []
    kinds: set[str] = set()
    for file in files:
        try:
            kind = str(pydicom.dcmread(file, stop_before_pixels=True).get("Modality", "none"))
            kinds.add(kind)
            if kind == "SEG":
                found.append((file, *_segments(highdicom.seg.segread(file))))
        # What is broken is said in many ways.
        except Exception as error:
            raise ImageStackError(f"cannot read the segmentation {file}: {error}") from error
    if not found:
        raise ImageStackError(
            f"{files[0].parent} holds no DICOM segmentation (SEG) but {', '.join(sorted(kinds))}: "
            f"segment the images first"
        )
    return _on_one_grid(found)


def _segments(file: Any) -> tuple[list[DicomSegment], MedicalHeader]:
    whole: Any = file.get_volume(combine_segments=False)
    values = np.asarray(whole.array)  # (K, J, I, segments)
    header = MedicalHeader(
        size=tuple(int(count) for count in values.shape[2::-1]),
        spacing=tuple(float(each) for each in whole.spacing[::-1]),
        origin=tuple(float(each) for each in whole.position),
        direction=tuple(float(each) for each in np.asarray(whole.direction)[:, ::-1].ravel()),
        components=1,
        value_bytes=1,
        tags={},
    )
    segments: list[DicomSegment] = []
    for place, number in enumerate(file.segment_numbers):
        described: Any = file.get_segment_description(number)
        kind: Any = described.segmented_property_type
        term = f"{kind.scheme_designator}^{kind.value}^{kind.meaning}"
        mask = values[..., place] != 0
        segments.append(DicomSegment(str(described.segment_label), term, mask))
    return segments, header


def _on_one_grid(
    found: list[tuple[Path, list[DicomSegment], MedicalHeader]],
) -> tuple[list[DicomSegment], MedicalHeader]:
    """Return all files' segments on the grid that holds them and some empty slices."""
    one, _, first = found[0]
    axes, sizes = np.array(first.direction).reshape(3, 3), np.array(first.spacing)
    corners: list[Ints] = []
    for file, _, header in found:
        off = (np.subtract(header.origin, first.origin) @ axes) / sizes
        corner = np.rint(off).astype(np.int64)
        same = np.allclose(header.direction, first.direction, atol=1e-3)
        if not (
            same
            and np.allclose(header.spacing, first.spacing, rtol=1e-3)
            and np.abs(off - corner).max() < _OFF_GRID
        ):
            raise ImageStackError(
                f"{file} and {one.name} have different grids: segments of one anatomy have one"
            )
        corners.append(corner)
    low = np.min(corners, axis=0)
    high = np.max([at + each[2].size for at, each in zip(corners, found, strict=True)], axis=0)
    low[2] -= _EMPTY_SLICES
    high[2] += _EMPTY_SLICES
    size = high - low
    segments: list[DicomSegment] = []
    for corner, (_, own, header) in zip(corners, found, strict=True):
        i, j, k = corner - low
        across, down, slices = header.size
        for each in own:
            mask = np.zeros(tuple(size[::-1]), dtype=bool)
            mask[k : k + slices, j : j + down, i : i + across] = each.mask
            segments.append(DicomSegment(each.name, each.term, mask))
    origin = np.array(first.origin) + axes @ (low * sizes)
    return segments, replace(first, size=tuple(size.tolist()), origin=tuple(origin.tolist()))
