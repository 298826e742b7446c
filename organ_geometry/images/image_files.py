"""Images in files: which files make a stack, in which order, and their pixels."""

import os
import re
import threading
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryFile

import cv2
import numpy as np

from organ_geometry.images.grey_image import GreyImage, ImageStackError, size_text

IMAGE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp"})
TIFF_SUFFIXES = frozenset({".tif", ".tiff"})
# Of the steps from name to name that are alike: fewer, and the numbers are no images' numbers.
_USUAL_FRACTION = 0.8

_READ_GREY = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION


@dataclass(frozen=True, slots=True)
class FileSlices:
    """Images read from their files when they are asked for."""

    files: tuple[Path, ...]  # (S,) file of each image; the same file S times when `paged`
    names: tuple[str, ...]  # (S,) name of each image, for messages
    paged: bool  # Whether the images are the pages of one file
    shape: tuple[int, int]  # (2,) rows H and columns W that every image must have

    def image(self, index: int) -> GreyImage:
        """Return one image, read from its file now."""
        # (H, W) grey levels, 8 or 16 bit; colour is turned into grey.
        image = _read_grey(self.files[index], index if self.paged else None, self.names[index])
        if image.shape != self.shape:
            raise ImageStackError(
                f"all images of a stack must have one size: {self.names[0]} has "
                f"{size_text(self.shape)} and {self.names[index]} has "
                f"{size_text(image.shape)} pixels (in {self.files[index].parent})"
            )
        return image

    @property
    def byte_count(self) -> int:
        """Size of the files, bytes."""
        return sum(file.stat().st_size for file in set(self.files))


def file_slices(source: Path) -> FileSlices:
    """Return the images in a folder, in natural order, or the pages of a TIFF file."""
    files, paged = _image_files(source)
    names = (
        tuple(f"{file.name} page {page}" for page, file in enumerate(files))
        if paged
        else tuple(file.name for file in files)
    )
    first = _read_grey(files[0], 0 if paged else None, names[0])
    return FileSlices(files, names, paged, (first.shape[0], first.shape[1]))


def files_in(folder: Path) -> list[Path]:
    """Return the files of a folder, but hidden ones, in natural order (slice_2, slice_10)."""
    return sorted(
        (file for file in folder.iterdir() if not file.name.startswith(".") and file.is_file()),
        key=lambda file: _natural_key(file.name),
    )


def _image_files(source: Path) -> tuple[tuple[Path, ...], bool]:
    """Return the file of each image in natural order, and whether they are pages of one file."""
    if source.is_file():
        return (source,) * _page_count(source), True
    files = [file for file in files_in(source) if file.suffix.lower() in IMAGE_SUFFIXES]
    if not files:
        within = [
            folder.name
            for folder in sorted(source.iterdir())
            if folder.is_dir()
            and any(file.suffix.lower() in IMAGE_SUFFIXES for file in folder.iterdir())
        ]
        hint = f"; {' and '.join(within)} within it does" if within else ""
        raise ImageStackError(
            f"the folder {source} holds no images: PNG, JPEG, TIFF, BMP or DICOM files are read"
            f"{hint}"
        )
    if len(files) == 1 and files[0].suffix.lower() in TIFF_SUFFIXES:
        pages = _page_count(files[0])
        if pages > 1:
            return (files[0],) * pages, True
    return tuple(files), False


def name_jumps(names: tuple[str, ...]) -> dict[int, int]:
    """Return how many names are missing after each, by the one number in which they differ.

    Parameters
    ----------
    names
        In natural order.

    Returns
    -------
    dict[int, int]
        By the place of the name before the gap; empty where names are not numbered evenly.
    """
    names_split = [re.split(r"([0-9]+)", name.casefold()) for name in names]
    if len({len(each) for each in names_split}) != 1:
        return {}
    columns = [column for column in zip(*names_split, strict=True) if len(set(column)) > 1]
    if len(columns) != 1 or not all(each.isdecimal() for each in columns[0]):
        return {}
    numbers = [int(each) for each in columns[0]]
    steps = [after - before for before, after in pairwise(numbers)]
    usual = sorted(steps)[len(steps) // 2]
    if usual < 1 or sum(step == usual for step in steps) < _USUAL_FRACTION * len(steps):
        return {}
    return {
        place: step // usual - 1
        for place, step in enumerate(steps)
        if step > usual and step % usual == 0
    }


def _natural_key(name: str) -> tuple[list[str | int], str]:
    """Return a sorting key by which slice_2 comes before slice_10."""
    names_split = re.split(r"([0-9]+)", name.casefold())
    return [int(token) if index % 2 else token for index, token in enumerate(names_split)], name


def _page_count(file: Path) -> int:
    try:
        with _quiet_decoders():
            count = cv2.imcount(str(file), _READ_GREY)
    except cv2.error:
        count = 0
    if count < 1:
        raise ImageStackError(f"{file.name} cannot be read as an image (in {file.parent})")
    return count


_PNG = b"\x89PNG\r\n\x1a\n"
_ERROR_STREAM = 2
# One thread at a time decodes: the stream that libpng and libjpeg write to is the process's.
_DECODING = threading.Lock()
# How their lines begin; those of libjpeg that are here tell of pixels that it has made up.
_REMARK = b"libpng "
_MADE_UP = (b"Corrupt JPEG data", b"Premature end of JPEG", b"Inconsistent progression")


@contextmanager
def _quiet_decoders() -> Generator[list[bytes]]:
    """Keep the decoders' own lines about a broken file off the error stream: one error tells it.

    Gives afterwards the lines that tell of pixels made up. What others have written to the stream
    meanwhile goes on its way.
    """
    made_up: list[bytes] = []
    diverted: list[bytes] = []
    with _DECODING:
        level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        try:
            with _diverted_errors() as diverted:
                yield made_up
        finally:
            cv2.utils.logging.setLogLevel(level)
            for line in diverted:
                if line.startswith(_MADE_UP):
                    made_up.append(line)
                elif not line.startswith(_REMARK):
                    os.write(_ERROR_STREAM, line)


@contextmanager
def _diverted_errors() -> Generator[list[bytes]]:
    """Give afterwards the lines that were written to the error stream, which has none of them."""
    lines: list[bytes] = []
    try:
        stream = os.dup(_ERROR_STREAM)
    except OSError:  # there is none
        yield lines
        return
    with TemporaryFile() as written:
        os.dup2(written.fileno(), _ERROR_STREAM)
        try:
            yield lines
        finally:
            os.dup2(stream, _ERROR_STREAM)
            os.close(stream)
            written.seek(0)
            lines.extend(written)


def _holds_its_chunks(content: bytes) -> bool:
    """Return whether a PNG, or any other file, is as long as its chunks say."""
    # OpenCV makes room for a chunk before it reads it: 236 bytes could have it take 4 GB.
    end, kind = len(_PNG), b""
    while content.startswith(_PNG) and end + 8 <= len(content) and kind != b"IEND":
        kind = content[end + 4 : end + 8]
        end += 12 + int.from_bytes(content[end : end + 4], "big")
    return end <= len(content) or not content.startswith(_PNG)


def _read_grey(file: Path, page: int | None, name: str) -> GreyImage:
    try:
        with _quiet_decoders() as made_up:
            if page is None:
                content = file.read_bytes()
                data = np.frombuffer(content, dtype=np.uint8)
                image = cv2.imdecode(data, _READ_GREY) if _holds_its_chunks(content) else None
            else:
                _, pages = cv2.imreadmulti(str(file), start=page, count=1, flags=_READ_GREY)
                image = pages[0] if pages else None
        if made_up:
            image = None
    except (OSError, cv2.error):
        image = None
    if image is None:
        raise ImageStackError(f"{name} cannot be read as an image (in {file.parent})")
    if page is None and file.suffix.lower() in TIFF_SUFFIXES and _page_count(file) > 1:
        raise ImageStackError(
            f"{name} has several pages (in {file.parent}): give a multipage TIFF alone"
        )
    if image.dtype not in {np.dtype(np.uint8), np.dtype(np.uint16)}:
        raise ImageStackError(
            f"{name} has {image.dtype} pixels (in {file.parent}); 8 or 16 bit grey is read"
        )
    return image  # pyright: ignore[reportReturnType]
