"""Images in files: which files make a stack, in which order, and their pixels."""

import re
import threading
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from organ_geometry.images.grey_image import GreyImage, ImageStackError, size_text

IMAGE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp"})
TIFF_SUFFIXES = frozenset({".tif", ".tiff"})

_READ_GREY = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION


@dataclass(frozen=True, slots=True)
class FileSlices:
    """Images read from their files when they are asked for.

    Attributes
    ----------
    files
        (S,) file of each image; the same file S times when `paged`.
    names
        (S,) name of each image, for messages.
    paged
        Whether the images are the pages of one file.
    shape
        (2,) rows H and columns W that every image must have.
    """

    files: tuple[Path, ...]
    names: tuple[str, ...]
    paged: bool
    shape: tuple[int, int]

    def image(self, index: int) -> GreyImage:
        """Return one image, read from its file now.

        Parameters
        ----------
        index
            Number of the image, from 0.

        Returns
        -------
        GreyImage
            (H, W) grey levels, 8 or 16 bit; colour is turned into grey.

        Raises
        ------
        ImageStackError
            If the file is not a readable image or its size is not that of the first image.
        """
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
    """Return the images in a folder, in natural order, or the pages of a TIFF file.

    Parameters
    ----------
    source
        Folder of PNG, JPEG, TIFF or BMP images, or one TIFF file.

    Returns
    -------
    FileSlices
        The images; only the first has been read.

    Raises
    ------
    ImageStackError
        If there are no images or the first is unreadable.
    """
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


def _natural_key(name: str) -> tuple[list[str | int], str]:
    """Return a sorting key by which slice_2 comes before slice_10."""
    parts = re.split(r"([0-9]+)", name.casefold())
    return [int(part) if index % 2 else part for index, part in enumerate(parts)], name


def _page_count(file: Path) -> int:
    """Return the number of pages of a TIFF file."""
    try:
        with _quiet_decoders():
            count = cv2.imcount(str(file), _READ_GREY)
    except cv2.error:
        count = 0
    if count < 1:
        raise ImageStackError(f"{file.name} cannot be read as an image (in {file.parent})")
    return count


class _Quiet:
    """How many threads want OpenCV quiet, and the level of its log before the first of them."""

    lock = threading.Lock()
    count = 0
    level = 0


@contextmanager
def _quiet_decoders() -> Generator[None]:
    """Keep OpenCV's own lines about a broken file off the error stream: one error tells it."""
    # The level belongs to the process: the last thread to leave gives it back.
    with _Quiet.lock:
        if _Quiet.count == 0:
            _Quiet.level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        _Quiet.count += 1
    try:
        yield
    finally:
        with _Quiet.lock:
            _Quiet.count -= 1
            if _Quiet.count == 0:
                cv2.utils.logging.setLogLevel(_Quiet.level)


def _read_grey(file: Path, page: int | None, name: str) -> GreyImage:
    """Return one image as 8 or 16 bit grey."""
    try:
        with _quiet_decoders():
            if page is None:
                data = np.frombuffer(file.read_bytes(), dtype=np.uint8)
                image = cv2.imdecode(data, _READ_GREY)
            else:
                _, pages = cv2.imreadmulti(str(file), start=page, count=1, flags=_READ_GREY)
                image = pages[0] if pages else None
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
