"""Files of medical images: DICOM, NIfTI, NRRD and MetaImage, through SimpleITK.

SimpleITK belongs to the extra `medical` and is loaded when the first such file is read.
Positions and directions are LPS: x to the patient's left, y to the back, z to the head; a NIfTI's
RAS is turned into that by the reader.
"""

import gzip
import re
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from organ_geometry.images.grey_image import ImageStackError
from organ_geometry.images.meta_image import META_SUFFIXES, whole_meta_values

VOLUME_SUFFIXES = (".nii", ".nii.gz", ".nrrd", ".nhdr", *META_SUFFIXES)
DICOM_SUFFIXES = (".dcm", ".dicom", ".ima")

_HEADER_SUFFIXES = frozenset({".mhd", ".nhdr"})
_DATA_FILE = re.compile(rb"^(?:ElementDataFile *=|data *file *:)([^\r\n]*)", re.I | re.M)
_DICOM_MARK = b"DICM"
_DICOM_MARK_AT = 128
_NIFTI_HEADER_BYTES = 348
_READ_AT_ONCE = 1 << 20


@dataclass(frozen=True, slots=True)
class MedicalHeader:
    """A medical file's header: size, place and type of its voxels."""

    size: tuple[int, ...]  # Number of voxels along each axis, fastest first
    spacing: tuple[float, ...]  # Distance between voxels along each axis, mm
    origin: tuple[float, ...]  # Centre of the first voxel, mm
    direction: tuple[float, ...]  # Direction cosines of the axes, row by row
    components: int  # Values in a voxel; 1 for grey
    value_bytes: int  # Bytes of a value
    # DICOM tags by "group|element" in hexadecimal, with the spaces around their values removed.
    tags: dict[str, str]


def is_volume_file(path: Path) -> bool:
    """Return whether a file's name is that of a NIfTI, NRRD or MetaImage volume."""
    return path.name.lower().endswith(VOLUME_SUFFIXES)


def volume_files(path: Path) -> list[Path]:
    """Return a volume's file, and the one with its voxels where a header names another."""
    if path.suffix.lower() not in _HEADER_SUFFIXES:
        return [path]
    named = _DATA_FILE.search(path.read_bytes())
    beside = path.parent / named[1].decode(errors="replace").strip() if named else path
    return [path, beside] if beside != path and beside.is_file() else [path]


def is_dicom_file(path: Path) -> bool:
    """Return whether a file is DICOM, by its name or by its mark; a DICOMDIR is not an image."""
    if path.name.upper() == "DICOMDIR":
        return False
    if path.suffix.lower() in DICOM_SUFFIXES:
        return True
    try:
        with path.open("rb") as file:
            return file.read(_DICOM_MARK_AT + 4)[_DICOM_MARK_AT:] == _DICOM_MARK
    except OSError:
        return False


def read_header(path: Path) -> MedicalHeader:
    """Return a file's header, without reading its voxels."""
    reader = _reader(path)
    try:
        reader.ReadImageInformation()
    except RuntimeError as error:
        raise ImageStackError(_unreadable(path, error)) from error
    kind = str(_simple_itk().GetPixelIDValueAsString(reader.GetPixelID()))
    bits = re.search(r"(\d+)-bit", kind)
    return MedicalHeader(
        size=tuple(reader.GetSize()),
        spacing=tuple(reader.GetSpacing()),
        origin=tuple(reader.GetOrigin()),
        direction=tuple(reader.GetDirection()),
        components=reader.GetNumberOfComponents(),
        value_bytes=int(bits[1]) // 8 if bits else 1,
        tags={key: _text(reader.GetMetaData(key)) for key in reader.GetMetaDataKeys()},
    )


def read_values(path: Path) -> NDArray[Any]:
    """Return the values of a file's voxels, last axis first; threads may call at once."""
    # (..., H, W) values in their own type; DICOM's are rescaled to their unit.
    try:
        values = np.asarray(_simple_itk().GetArrayFromImage(_reader(path).Execute()))
    except RuntimeError as error:
        raise ImageStackError(_unreadable(path, error)) from error
    return whole_meta_values(path, values) if path.suffix.lower() in META_SUFFIXES else values


def write_values(path: Path, values: NDArray[Any], header: MedicalHeader) -> None:
    """Write (K, J, I) values as a compressed volume file of the kind that its name says."""
    itk = _simple_itk()
    image = itk.GetImageFromArray(values)
    image.SetSpacing(header.spacing)
    image.SetOrigin(header.origin)
    image.SetDirection(header.direction)
    for key, value in header.tags.items():
        image.SetMetaData(key, value)
    itk.WriteImage(image, str(path), useCompression=True)


def check_whole_nifti(path: Path, header: MedicalHeader) -> None:
    """Raise an error if a NIfTI file ends before its voxels do: its reader would make up zeros."""
    name = path.name.lower()
    needed = _NIFTI_HEADER_BYTES + header.components * header.value_bytes * int(
        np.prod(header.size, dtype=np.int64)
    )
    if name.endswith(".nii"):
        there = path.stat().st_size
    elif name.endswith(".nii.gz"):
        there = 0
        try:
            with gzip.open(path) as file:
                while piece := file.read(_READ_AT_ONCE):
                    there += len(piece)
        except (OSError, EOFError, zlib.error) as error:
            raise ImageStackError(f"{path} is damaged or cut short: {error}") from error
    else:
        return
    if there < needed:
        raise ImageStackError(
            f"{path} is cut short: its voxels need {needed:,} bytes and it holds {there:,}"
        )


def _simple_itk() -> Any:
    try:
        import SimpleITK
    except ImportError as error:
        raise ImageStackError(
            "DICOM, NIfTI, NRRD and MetaImage files are read with SimpleITK, which is missing: "
            "pip install 'bluntdissect[medical]'"
        ) from error
    itk: Any = SimpleITK
    # One error tells what is wrong with a file.
    itk.ProcessObject.SetGlobalWarningDisplay(False)
    return itk


def _reader(path: Path) -> Any:
    reader = _simple_itk().ImageFileReader()
    reader.SetFileName(str(path))
    return reader


def _text(value: str) -> str:
    # DICOM pads values to an even length, by spaces or a zero byte.
    return value.strip(" \0")


def _unreadable(path: Path, error: RuntimeError) -> str:
    reason = "it is damaged, cut short or of another kind than its name says"
    if "orthonormal" in str(error):
        reason = "its axes are not perpendicular"
    return f"{path} cannot be read: {reason}"
