"""Images in a zip or in one file that somebody sends, taken apart without trusting a byte of it."""

import gzip
import io
import re
import stat
import zipfile
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from app.compression.image_extent import UnknownImageError, image_extents
from organ_geometry import (
    DICOM_SUFFIXES,
    IMAGE_SUFFIXES,
    SPACING_FILE,
    VOLUME_SUFFIXES,
    ImageStackError,
    file_name,
    list_text,
)

MIB = 2**20
LONGEST_NAME = 255
"""Bytes of a file's name that file systems take."""
# Bytes read at a time, so that a zip whose entry is larger than stated is stopped early.
_PIECE = 2**16
# First bytes: TIFF and BigTIFF of either byte order, and gzip.
_TIFF_STARTS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_GZIP_START = b"\x1f\x8b"
# Where the header of a MetaImage or an NRRD names the file of its voxels.
_VOXELS = re.compile(rb"(?:ElementDataFile\s*[=:]?|data ?file\s*:)[ \t]*([^\r\n]*)", re.I)
# Where a DICOM file's "DICM" ends, and the size of a NIfTI-1 header.
_DICOM_BYTES, _NIFTI_BYTES = 132, 348
_WANTED = (
    "a zip of PNG, JPEG, TIFF or BMP images or of a DICOM series, a TIFF, or a DICOM, NIfTI, NRRD "
    "or MetaImage file"
)


class UploadRefusedError(ImageStackError):
    """An upload that is no stack of images, or too large."""


@dataclass(frozen=True, slots=True)
class UploadBounds:
    """Limits of an upload."""

    file_bytes: int = 64 * MIB  # Size of the file
    entries: int = 2000  # Files and folders in a zip
    unpacked_bytes: int = 256 * MIB  # Their size together, unpacked
    image_pixels: int = 5 * 10**6  # Of one image, which takes 80 bytes each to trace
    all_pixels: int = 120 * 10**6  # Of all images
    voxels: int = 2**26  # Voxels of a volume, which is read whole
    organ_mm: float = 10_000.0  # Length of the organ that is built
    # What to do about more pixels, before what to do about more of anything.
    more_pixels: str = "start bluntdissect trainer with more --build-pixels, or "
    otherwise: str = (
        "build its organ with bluntdissect compress FILE -o duct.organ, and practise on it with "
        "bluntdissect trainer --organ duct.organ"
    )


def unpack_upload(name: str, content: bytes, folder: Path, bounds: UploadBounds) -> Path:
    """Write the images that were sent into a folder of their own."""
    if len(content) > bounds.file_bytes:
        raise UploadRefusedError(
            f"the file has {_mib(len(content))} and the most is {_mib(bounds.file_bytes)}: "
            f"{bounds.otherwise}"
        )
    called = _plain_name(name)
    suffix = _suffix(name, content)
    if suffix is not None:
        if suffix == ".tif":
            _check_pixels({called: content}, bounds)
        else:
            _check_voxel_files(name, content, ())
        return _written(folder, {f"{called}{suffix}": content}) / f"{called}{suffix}"
    try:
        files = _zip_files(content, bounds)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise UploadRefusedError(f"this cannot be read: send {_WANTED}") from error
    place = folder / called
    place.mkdir()
    _written(place, files)
    volumes = [each for each in files if _is_volume(each)]
    return place / volumes[0] if volumes else place


def _suffix(name: str, content: bytes) -> str | None:
    """Return the suffix of a file that is a stack by itself, by its content; else None."""
    if content.startswith(_TIFF_STARTS):
        return ".tif"
    if _is_dicom(content):
        return ".dcm"
    if content.startswith(b"NRRD"):
        return ".nrrd"
    if _is_nifti(content):
        return ".nii"
    if content.startswith(_GZIP_START):
        try:
            with gzip.open(io.BytesIO(content)) as packed:
                start = packed.read(_NIFTI_BYTES)
        except (OSError, EOFError, zlib.error) as error:
            raise UploadRefusedError(f"{_shown(name)} is damaged or cut short") from error
        return ".nii.gz" if _is_nifti(start) else None
    # A zip has its names as they are: those of MetaImages in it may stand in its first bytes.
    return ".mha" if not content.startswith(b"PK") and b"ElementDataFile" in content else None


def _is_dicom(content: bytes) -> bool:
    return content[128:_DICOM_BYTES] == b"DICM"


def _is_nifti(content: bytes) -> bool:
    return content[344:_NIFTI_BYTES] in (b"n+1\0", b"ni1\0")


def _is_volume(name: str) -> bool:
    return name.lower().endswith(VOLUME_SUFFIXES)


def _check_voxel_files(name: str, content: bytes, there: Iterable[str]) -> None:
    """Refuse a header whose voxels are in a file that was not sent: it could be any."""
    for named in _VOXELS.findall(content):
        voxels = named.strip().decode(errors="replace")
        if voxels != "LOCAL" and voxels not in there:
            raise UploadRefusedError(
                f"{_shown(name)} has its voxels in {_shown(voxels)}, which is not with it: send "
                f"both in one zip"
            )


def _written(folder: Path, files: dict[str, bytes]) -> Path:
    for each, data in files.items():
        try:
            (folder / each).write_bytes(data)
        except OSError as error:
            raise UploadRefusedError(f"{_shown(each)} cannot be kept: {error.strerror}") from error
    return folder


def _zip_files(content: bytes, bounds: UploadBounds) -> dict[str, bytes]:
    """Return a zip's entries that are needed, by names without folders."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = archive.infolist()
        if len(entries) > bounds.entries:
            raise UploadRefusedError(
                f"the zip has {len(entries):,} entries and the most is {bounds.entries:,}: "
                f"{bounds.otherwise}"
            )
        if sum(entry.file_size for entry in entries) > bounds.unpacked_bytes:
            raise _too_large(bounds)
        for entry in entries:
            _check_entry(entry)
        used = [entry for entry in entries if not entry.is_dir() and not _is_hidden(entry)]
        volumes = [entry for entry in used if _is_volume(entry.filename)]
        if volumes:
            return _volume_files(archive, used, volumes, bounds)
        images = [
            entry
            for entry in used
            if PurePosixPath(entry.filename).suffix.lower() in IMAGE_SUFFIXES
        ]
        dicom = [entry for entry in used if entry not in images and _is_dicom_entry(archive, entry)]
        if images and dicom:
            raise UploadRefusedError(
                f"the zip has {len(dicom)} DICOM files and {len(images)} other images: send those "
                f"of one organ"
            )
        if not images and not dicom:
            raise UploadRefusedError(
                "the zip has no PNG, JPEG, TIFF or BMP image in it, and no DICOM, NIfTI, NRRD or "
                "MetaImage file"
            )
        home = _one_folder(images or dicom)
        spacing = [
            entry
            for place in (home, home.parent)
            for entry in entries
            if images and PurePosixPath(entry.filename) == place / SPACING_FILE
        ]
        files = _contents(archive, [*images, *spacing[:1]] if images else dicom, bounds)
    if images:
        _check_pixels({each: data for each, data in files.items() if each != SPACING_FILE}, bounds)
    return files


def _volume_files(
    archive: zipfile.ZipFile,
    used: list[zipfile.ZipInfo],
    volumes: list[zipfile.ZipInfo],
    bounds: UploadBounds,
) -> dict[str, bytes]:
    """Return a volume in a zip, and the files beside it that it may name."""
    if len(volumes) > 1:
        names = list_text(_shown(PurePosixPath(entry.filename).name) for entry in volumes)
        raise UploadRefusedError(f"the zip has {len(volumes)} volumes, {names}: send one of them")
    (volume,) = volumes
    home = PurePosixPath(volume.filename).parent
    beside = [
        entry
        for entry in used
        if entry is not volume and PurePosixPath(entry.filename).parent == home
    ]
    files = _contents(archive, [volume, *beside], bounds)
    name = PurePosixPath(volume.filename).name
    _check_voxel_files(name, files[name], [each for each in files if each != name])
    return files


def _one_folder(entries: list[zipfile.ZipInfo]) -> PurePosixPath:
    folders = {PurePosixPath(entry.filename).parent for entry in entries}
    if len(folders) > 1:
        first, second, *_ = sorted(str(each) for each in folders)
        raise UploadRefusedError(
            f"the zip has images in several folders, as {_shown(first)} and {_shown(second)}: "
            f"send those of one organ"
        )
    return folders.pop()


def _contents(
    archive: zipfile.ZipFile, entries: list[zipfile.ZipInfo], bounds: UploadBounds
) -> dict[str, bytes]:
    """Return entries' contents by their names without folders."""
    files: dict[str, bytes] = {}
    left = bounds.unpacked_bytes
    for entry in entries:
        base = PurePosixPath(entry.filename).name
        if base in files:
            raise UploadRefusedError(f"the zip has {_shown(base)} twice")
        files[base] = _read(archive, entry, left, bounds)
        left -= len(files[base])
    return files


def _check_entry(entry: zipfile.ZipInfo) -> None:
    # As it stands in the zip: `filename` ends at a NUL and has the system's separators.
    name = entry.orig_filename
    components = PurePosixPath(name.replace("\\", "/")).parts
    if (
        not components
        or ".." in components
        or components[0] == "/"
        or "\\" in name
        or ":" in name
        or "\0" in name
    ):
        raise UploadRefusedError(f"the zip has a file name that leads out of it: {_shown(name)}")
    longest = max(components, key=lambda component: len(component.encode()))
    if len(longest.encode()) > LONGEST_NAME:
        raise UploadRefusedError(
            f"the zip has a name of {len(longest.encode())} bytes and files take {LONGEST_NAME}: "
            f"{_shown(longest)}"
        )
    if stat.S_ISLNK(entry.external_attr >> 16):
        raise UploadRefusedError(f"the zip has a link in it: {_shown(name)}")
    if entry.flag_bits & 1:
        raise UploadRefusedError(f"the zip is encrypted: {_shown(name)}")


def _is_hidden(entry: zipfile.ZipInfo) -> bool:
    components = PurePosixPath(entry.filename).parts
    return any(component.startswith(".") or component == "__MACOSX" for component in components)


def _is_dicom_entry(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> bool:
    """Return whether an entry is DICOM, by its name or by its mark; a DICOMDIR is not an image."""
    path = PurePosixPath(entry.filename)
    if path.name.upper() == "DICOMDIR":
        return False
    if path.suffix.lower() in DICOM_SUFFIXES:
        return True
    with archive.open(entry) as source:
        return _is_dicom(source.read(_DICOM_BYTES))


def _read(
    archive: zipfile.ZipFile, entry: zipfile.ZipInfo, left: int, bounds: UploadBounds
) -> bytes:
    """Return an entry's content, without relying on the size that the zip states."""
    pieces: list[bytes] = []
    with archive.open(entry) as source:
        while piece := source.read(_PIECE):
            left -= len(piece)
            if left < 0:
                raise _too_large(bounds)
            pieces.append(piece)
    return b"".join(pieces)


def _check_pixels(images: dict[str, bytes], bounds: UploadBounds) -> None:
    """Raise an error if images would be larger in memory than they may be."""
    total = 0
    for name, data in images.items():
        try:
            extents = image_extents(data)
        except UnknownImageError as error:
            raise UploadRefusedError(f"{_shown(name)} cannot be read: {error}") from error
        if len(extents) > 1 and len(images) > 1:
            raise UploadRefusedError(f"{_shown(name)} has {len(extents)} pages: send it alone")
        for width, height in extents:
            if width * height > bounds.image_pixels:
                raise UploadRefusedError(
                    f"{_shown(name)} has {width:,} x {height:,} pixels and the most is "
                    f"{bounds.image_pixels / 1e6:.1f} million: "
                    f"{bounds.more_pixels}{bounds.otherwise}"
                )
            total += width * height
    if total > bounds.all_pixels:
        raise UploadRefusedError(
            f"the images have {total / 1e6:,.0f} million pixels and the most is "
            f"{bounds.all_pixels / 1e6:,.0f} million: {bounds.more_pixels}{bounds.otherwise}"
        )


def _too_large(bounds: UploadBounds) -> UploadRefusedError:
    return UploadRefusedError(
        f"the zip is larger than {_mib(bounds.unpacked_bytes)} unpacked, which is the most: "
        f"{bounds.otherwise}"
    )


def _mib(count: int) -> str:
    return f"{count / MIB:.1f} MiB"


def _plain_name(name: str) -> str:
    """Return a name that is only a name, whatever was sent."""
    stem = PurePosixPath(name.replace("\\", "/")).name.split(".")[0]
    return file_name(stem[:60])


def _shown(name: str) -> str:
    """Return an uploaded name for a message: quoted, of 60 characters at most."""
    return repr(name if len(name) <= 60 else f"{name[:57]}...")
