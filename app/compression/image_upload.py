"""Images that somebody sends: a zip or a TIFF, taken apart without trusting a byte of it."""

import io
import re
import stat
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from app.compression.image_extent import UnknownImageError, image_extents
from organ_geometry.images.grey_image import ImageStackError
from organ_geometry.images.image_files import IMAGE_SUFFIXES
from organ_geometry.images.spacing_file import SPACING_FILE

__all__ = ["UploadBounds", "UploadRefusedError", "unpack_upload"]

MIB = 2**20
_PIECE = 2**16


class UploadRefusedError(ImageStackError):
    """What was sent is no stack of images, or one that is too large."""


@dataclass(frozen=True, slots=True)
class UploadBounds:
    """What is the most that may be sent.

    Attributes
    ----------
    file_bytes
        Size of the file.
    entries
        Files and folders in a zip.
    unpacked_bytes
        Their size together, unpacked.
    image_pixels, all_pixels
        Pixels of one image, and of all.
    """

    file_bytes: int = 64 * MIB
    entries: int = 2000
    unpacked_bytes: int = 256 * MIB
    image_pixels: int = 2**24
    all_pixels: int = 300 * 10**6


def unpack_upload(name: str, content: bytes, folder: Path, bounds: UploadBounds) -> Path:
    """Write the images that were sent into a folder of their own.

    Parameters
    ----------
    name
        What the file is called; the organ is called like it.
    content
        The file: a zip of images, with or without a ``spacing.json``, or a TIFF.
    folder
        An empty folder; nothing is written elsewhere, whatever the file says.
    bounds
        The most that may be sent.

    Returns
    -------
    Path
        The folder of the images, or the TIFF, for `read_image_stack`.

    Raises
    ------
    UploadRefusedError
        If it is neither, is too large, or a zip that has links, encrypted or damaged files, names
        that lead elsewhere, or images in several folders.
    """
    if len(content) > bounds.file_bytes:
        raise UploadRefusedError(
            f"the file has {_mib(len(content))} and the most is {_mib(bounds.file_bytes)}"
        )
    called = _plain_name(name)
    if content[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        _check_pixels({called: content}, bounds)
        path = folder / f"{called}.tif"
        path.write_bytes(content)
        return path
    try:
        files = _zip_files(content, bounds)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise UploadRefusedError(
            "this is neither a TIFF nor a zip that can be read: send a zip of PNG, JPEG, TIFF or "
            "BMP images"
        ) from error
    _check_pixels({each: data for each, data in files.items() if each != SPACING_FILE}, bounds)
    place = folder / called
    place.mkdir()
    for each, data in files.items():
        (place / each).write_bytes(data)
    return place


def _zip_files(content: bytes, bounds: UploadBounds) -> dict[str, bytes]:
    """Return a zip's images and spacing.json by their names without folders."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = archive.infolist()
        if len(entries) > bounds.entries:
            raise UploadRefusedError(
                f"the zip has {len(entries):,} entries and the most is {bounds.entries:,}"
            )
        if sum(entry.file_size for entry in entries) > bounds.unpacked_bytes:
            raise _too_large(bounds)
        for entry in entries:
            _check_entry(entry)
        images = [entry for entry in entries if _is_image(entry)]
        folders = {PurePosixPath(entry.filename).parent for entry in images}
        if not images:
            raise UploadRefusedError("the zip has no PNG, JPEG, TIFF or BMP image in it")
        if len(folders) > 1:
            first, second, *_ = sorted(str(each) for each in folders)
            raise UploadRefusedError(
                f"the zip has images in several folders, as {_shown(first)} and {_shown(second)}: "
                f"send those of one organ"
            )
        home = folders.pop()
        spacing = [
            entry
            for place in (home, home.parent)
            for entry in entries
            if PurePosixPath(entry.filename) == place / SPACING_FILE
        ]
        files: dict[str, bytes] = {}
        left = bounds.unpacked_bytes
        for entry in [*images, *spacing[:1]]:
            base = PurePosixPath(entry.filename).name
            if base in files:
                raise UploadRefusedError(f"the zip has {_shown(base)} twice")
            files[base] = _read(archive, entry, left, bounds)
            left -= len(files[base])
    return files


def _check_entry(entry: zipfile.ZipInfo) -> None:
    # As it stands in the zip: `filename` ends at a NUL and has the system's separators.
    name = entry.orig_filename
    parts = PurePosixPath(name.replace("\\", "/")).parts
    if not parts or ".." in parts or parts[0] == "/" or "\\" in name or ":" in name or "\0" in name:
        raise UploadRefusedError(f"the zip has a file name that leads out of it: {_shown(name)}")
    if stat.S_ISLNK(entry.external_attr >> 16):
        raise UploadRefusedError(f"the zip has a link in it: {_shown(name)}")
    if entry.flag_bits & 1:
        raise UploadRefusedError(f"the zip is encrypted: {_shown(name)}")


def _is_image(entry: zipfile.ZipInfo) -> bool:
    path = PurePosixPath(entry.filename)
    hidden = any(part.startswith(".") or part == "__MACOSX" for part in path.parts)
    return not entry.is_dir() and not hidden and path.suffix.lower() in IMAGE_SUFFIXES


def _read(
    archive: zipfile.ZipFile, entry: zipfile.ZipInfo, left: int, bounds: UploadBounds
) -> bytes:
    """Return an entry's content; what the zip says of its size is not relied upon."""
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
                    f"{bounds.image_pixels / 1e6:.1f} million"
                )
            total += width * height
    if total > bounds.all_pixels:
        raise UploadRefusedError(
            f"the images have {total / 1e6:,.0f} million pixels and the most is "
            f"{bounds.all_pixels / 1e6:,.0f} million"
        )


def _too_large(bounds: UploadBounds) -> UploadRefusedError:
    return UploadRefusedError(
        f"the zip is larger than {_mib(bounds.unpacked_bytes)} unpacked, which is the most"
    )


def _mib(count: int) -> str:
    return f"{count / MIB:.1f} MiB"


def _plain_name(name: str) -> str:
    """Return a name that is only a name, whatever was sent."""
    stem = PurePosixPath(name.replace("\\", "/")).name.split(".")[0]
    return re.sub(r"[^\w-]+", "_", stem)[:60].strip("_") or "organ"


def _shown(name: str) -> str:
    """Return a name from outside so that it fits into a line."""
    return repr(name if len(name) <= 60 else f"{name[:57]}...")
