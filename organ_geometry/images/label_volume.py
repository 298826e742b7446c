"""Volumes of labels: each voxel is of one thing or of none, and things may have names.

Voxels are turned so that their axes run nearest to LPS, whichever way they were stored.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from organ_geometry.atomic_file import write_atomic
from organ_geometry.images.dicom_segments import dicom_segments, segmentation_files
from organ_geometry.images.grey_image import ImageStackError, list_text
from organ_geometry.images.image_planes import check_pixel_size, check_spacing
from organ_geometry.images.medical_file import (
    MedicalHeader,
    check_whole_nifti,
    is_volume_file,
    read_header,
    read_values,
    write_values,
)

# More labels than these are grey levels.
_MOST_LABELS = 4096
# How far axes may be from perpendicular: what files round.
_SKEW = 1e-3
# What 3D Slicer writes of each segment into a NRRD file's header.
_SEGMENT = re.compile(r"Segment(\d+)_(Name|LabelValue|Layer|Tags)$")
# Of a segment's tags: the list it is chosen from, its category, and its type.
_TERM = re.compile(r"TerminologyEntry:[^~|]*~[^~|]*~([^~|]*)")
_ENTRY = (
    "TerminologyEntry:Segmentation category and type - 3D Slicer General Anatomy list"
    "~SCT^123037004^Anatomical Structure~{term}~^^~^^~^^|"
)


@dataclass(frozen=True, slots=True, eq=False)
class LabelVolume:
    """Voxels of labels, where they stand in LPS.

    Attributes
    ----------
    values
        (K, J, I) label of each voxel, 0 for none.
    sizes
        (3,) distance between voxels along I, J and K, mm.
    origin
        (3,) centre of the first voxel, LPS mm.
    axes
        (3, 3) unit directions of I, J and K as columns.
    names
        Names by label, where the file has them.
    terms
        What labels are by a terminology, where the file says it: scheme, code and meaning, as
        ``SCT^51114001^Artery``.
    """

    source: Path
    values: NDArray[np.int32]
    sizes: NDArray[np.float64]
    origin: NDArray[np.float64]
    axes: NDArray[np.float64]
    names: dict[int, str] = field(default_factory=dict[int, str])
    terms: dict[int, str] = field(default_factory=dict[int, str])

    @property
    def labels(self) -> tuple[int, ...]:
        """Labels that some voxel has, but 0."""
        return tuple(self.label_sizes())

    def label_sizes(self) -> dict[int, int]:
        """Return how many voxels each label has, without 0."""
        labels, counts = np.unique(self.values, return_counts=True)
        return {
            int(label): int(count)
            for label, count in zip(labels, counts, strict=True)
            if label != 0
        }

    def around(self, labels: Iterable[int], margin: int) -> "LabelVolume":
        """Return the part of the volume that holds some labels, and so many voxels around it."""
        there = np.isin(self.values, list(labels))
        box: list[slice] = []
        for axis in range(3):
            held = np.flatnonzero(there.any(axis=tuple({0, 1, 2} - {axis})))
            if not len(held):
                return self
            box.append(slice(max(int(held[0]) - margin, 0), int(held[-1]) + 1 + margin))
        first = np.array([each.start for each in box][::-1])
        return replace(
            self,
            values=np.ascontiguousarray(self.values[tuple(box)]),
            origin=self.places(first[np.newaxis])[0],
        )

    def places(self, indices: NDArray[Any]) -> NDArray[np.float64]:
        """Return (N, 3) LPS places, mm, of (N, 3) indices I, J, K, whole or not."""
        return self.origin + (indices * self.sizes) @ self.axes.T

    def indices(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (N, 3) indices I, J, K, not rounded, of (N, 3) LPS places, mm."""
        return ((places - self.origin) @ self.axes) / self.sizes


def read_labels(path: Path) -> LabelVolume:
    """Return the labels in a volume file, a DICOM segmentation, or a folder of one mask a tube.

    A NIfTI, NRRD or MetaImage file holds whole numbers, each a label; segments of 3D Slicer's NRRD
    have their names, in layers too, and so have those of DICOM (SEG), a file or several in a
    folder, images beside them or not. Of another folder each volume file is a mask, not 0 inside,
    named by its file; all have one grid. Where masks or layers overlap, the smaller keeps the
    voxel.

    Parameters
    ----------
    path
        The file or folder.

    Returns
    -------
    LabelVolume
        Turned so that its axes run nearest to LPS.

    Raises
    ------
    ImageStackError
        If it cannot be read, holds no labels, or its masks differ in their grids.
    """
    if not path.exists():
        raise ImageStackError(f"there is no volume of labels at {path}")
    if files := segmentation_files(path):
        segments, header = dicom_segments(files)
        named = [(_Segment(each.name, term=each.term), each.mask) for each in segments]
        return _of_masks(path, named, header)
    return _masks(path) if path.is_dir() else _one_file(path)


def write_labels(volume: LabelVolume, path: Path) -> None:
    """Write labels with their names as 3D Slicer does: NRRD, each label a segment."""
    i, j, k = volume.values.shape[::-1]
    tags: dict[str, str] = {}
    for number, label in enumerate(volume.label_sizes()):
        segment = {
            "ID": f"Segment_{label}",
            "Name": volume.names.get(label, f"label {label}"),
            "LabelValue": str(label),
            "Layer": "0",
            "Extent": f"0 {i - 1} 0 {j - 1} 0 {k - 1}",
        }
        if label in volume.terms:
            segment["Tags"] = _ENTRY.format(term=volume.terms[label])
        tags |= {f"Segment{number}_{key}": value for key, value in segment.items()}
    header = MedicalHeader(
        size=(i, j, k),
        spacing=tuple(volume.sizes.tolist()),
        origin=tuple(volume.origin.tolist()),
        direction=tuple(volume.axes.ravel().tolist()),
        components=1,
        value_bytes=2,
        tags=tags,
    )
    with TemporaryDirectory() as folder:
        made = Path(folder) / "labels.nrrd"
        write_values(made, volume.values.astype(np.uint16), header)
        write_atomic(path, made.read_bytes())


def _one_file(path: Path) -> LabelVolume:
    values, header = _voxels(path)
    segments = _segments(path, header.tags)
    if values.ndim == 3:
        return _turned(path, values, header, {each.label: each for each in segments})
    # Layers of 3D Slicer: segments that overlap.
    masks: list[tuple[_Segment, NDArray[np.bool_]]] = []
    for each in segments:
        if not 0 <= each.layer < values.shape[3]:
            raise ImageStackError(
                f"segment {each.name!r} of {path} is in layer {each.layer}, which it lacks"
            )
        masks.append((each, values[..., each.layer] == each.label))
    if not masks:
        raise ImageStackError(
            f"{path} has {values.shape[3]} values in each voxel and names no segments; labels have "
            f"one"
        )
    return _of_masks(path, masks, header)


def _masks(folder: Path) -> LabelVolume:
    files = sorted(file for file in folder.iterdir() if is_volume_file(file))
    if not files:
        raise ImageStackError(f"{folder} holds no NIfTI, NRRD or MetaImage masks")
    masks: list[tuple[_Segment, NDArray[np.bool_]]] = []
    first: MedicalHeader | None = None
    for file in files:
        values, header = _voxels(file)
        if values.ndim != 3:
            raise ImageStackError(f"{file} has several values in each voxel; a mask has one")
        first = header if first is None else first
        if header.size != first.size or not all(
            np.allclose(getattr(header, name), getattr(first, name), atol=1e-3)
            for name in ("spacing", "origin", "direction")
        ):
            raise ImageStackError(
                f"{file} and {files[0].name} have different grids: masks of one anatomy have one"
            )
        masks.append((_Segment(file.name.split(".")[0]), values != 0))
    assert first is not None  # noqa: S101
    return _of_masks(folder, masks, first)


def _voxels(path: Path) -> tuple[NDArray[np.int32], MedicalHeader]:
    """Return (K, J, I) whole numbers, or (K, J, I, C), and the header."""
    if not is_volume_file(path):
        raise ImageStackError(
            f"{path} is no volume of labels: NIfTI, NRRD, MetaImage and DICOM files are read, or a "
            f"folder of one mask a tube"
        )
    header = read_header(path)
    if len(header.size) != 3:
        raise ImageStackError(f"{path} has {len(header.size)} dimensions; a volume has 3")
    if min(header.size) < 2:
        raise ImageStackError(
            f"{path} is {' x '.join(map(str, header.size))} voxels: labels of tubes need a volume"
        )
    check_whole_nifti(path, header)
    check_pixel_size((header.spacing[0], header.spacing[1]), path)
    check_spacing("slice spacing", header.spacing[2], path)
    values = read_values(path)
    whole = values if values.dtype.kind in "iu" else np.rint(values)
    if values.dtype.kind not in "iuf" or not np.isfinite(values).all() or (whole != values).any():
        raise ImageStackError(f"{path} holds grey values and no labels: labels are whole numbers")
    if len(np.unique(whole)) > _MOST_LABELS or whole.min() < 0 or whole.max() >= 2**31:
        raise ImageStackError(
            f"{path} holds grey values and no labels: labels are 0 and a few numbers above it"
        )
    return whole.astype(np.int32), header


@dataclass(frozen=True, slots=True)
class _Segment:
    """What a header says of a segment."""

    name: str
    label: int = 1
    layer: int = 0
    term: str = ""


def _segments(path: Path, tags: dict[str, str]) -> list[_Segment]:
    """Return the segments that a header names."""
    found: dict[int, dict[str, str]] = {}
    for key, value in tags.items():
        if (match := _SEGMENT.match(key)) is not None:
            found.setdefault(int(match[1]), {})[match[2]] = value
    segments: list[_Segment] = []
    for _, segment in sorted(found.items()):
        if "Name" not in segment:
            continue
        for key in ("LabelValue", "Layer"):
            if not segment.get(key, "0").isdecimal():
                raise ImageStackError(
                    f"segment {segment['Name']!r} of {path} has {key} {segment[key]!r}: it must be "
                    f"a whole number"
                )
        term = _TERM.search(segment.get("Tags", ""))
        made = _Segment(
            segment["Name"],
            int(segment.get("LabelValue", "1")),
            int(segment.get("Layer", "0")),
            "" if term is None else term[1],
        )
        for other in segments:
            if (other.label, other.layer) == (made.label, made.layer):
                raise ImageStackError(
                    f"segments {other.name!r} and {made.name!r} of {path} are the same label "
                    f"{made.label}: each segment of a layer has its own"
                )
        segments.append(made)
    return segments


def _of_masks(
    source: Path, masks: list[tuple[_Segment, NDArray[np.bool_]]], header: MedicalHeader
) -> LabelVolume:
    values = np.zeros(masks[0][1].shape, dtype=np.int32)
    largest_first = sorted(range(len(masks)), key=lambda k: -int(np.count_nonzero(masks[k][1])))
    for number in largest_first:
        values[masks[number][1]] = number + 1
    return _turned(source, values, header, {k + 1: each for k, (each, _) in enumerate(masks)})


def _turned(
    source: Path, values: NDArray[np.int32], header: MedicalHeader, segments: dict[int, _Segment]
) -> LabelVolume:
    """Return a volume whose axes I, J, K run nearest to the left, to the back and to the head."""
    axes = np.array(header.direction, dtype=np.float64).reshape(3, 3)
    sizes, origin = np.array(header.spacing), np.array(header.origin)
    order = list(np.abs(axes).argmax(axis=1))
    if sorted(order) != [0, 1, 2]:
        # Two axes lean equally to one direction: as stored.
        order = [0, 1, 2]
    # From I, J, K to the array's axes, which run the other way round.
    values = values.transpose([2 - order[2 - axis] for axis in range(3)])
    axes, sizes = axes[:, order], sizes[order]
    if np.abs(axes.T @ axes - np.eye(3)).max() > _SKEW:
        raise ImageStackError(
            f"the axes of {source} are not perpendicular ({list_text(np.round(axes, 2).ravel())}), "
            f"as of slices at a tilt: resample it first"
        )
    for axis in range(3):
        if axes[axis, axis] < 0.0:
            count = values.shape[2 - axis]
            origin = origin + (count - 1) * sizes[axis] * axes[:, axis]
            axes[:, axis] *= -1.0
            values = np.flip(values, axis=2 - axis)
    if np.linalg.det(axes) < 0.0:
        raise ImageStackError(
            f"the axes of {source} are mirrored ({list_text(np.round(axes, 2).ravel())}): left is "
            f"not told from right"
        )
    return LabelVolume(
        source,
        np.ascontiguousarray(values),
        sizes,
        origin,
        axes,
        names={label: each.name for label, each in segments.items()},
        terms={label: each.term for label, each in segments.items() if each.term},
    )
