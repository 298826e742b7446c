"""A workbench on which an organ is built step by step: images, their edges, a threshold."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from app.compression.build_process import Abandoned, BuildProcess, Progress
from app.compression.edge_picture import edge_picture
from app.compression.image_upload import UploadBounds, unpack_upload
from organ_geometry.coding.tolerance_floor import ToleranceTooSmall
from organ_geometry.contours.organ_tracing import trace_organ
from organ_geometry.contours.traced_organ import TracedOrgan, TracedSection
from organ_geometry.images.image_stack import ImageStack, ImageStackError
from organ_geometry.images.stack_reader import read_image_stack
from organ_geometry.organ_builder import BuiltOrgan, build_organ
from organ_geometry.recut.recut_stack import recut_where_needed

__all__ = ["Abandoned", "OpenedStack", "OrganWorkbench", "PromiseRefusedError"]

Made = TypeVar("Made")


class PromiseRefusedError(ValueError):
    """A threshold cannot be kept; the smallest that can is named.

    Attributes
    ----------
    smallest_px
        The smallest that can be kept, px, about: its file's digits depend on the threshold too.
    """

    def __init__(self, wanted_px: float, smallest_px: float, pixel: float) -> None:
        super().__init__(
            f"{wanted_px:.3g} px cannot be kept at every section: the smallest that can is "
            f"about {smallest_px:.3f} px, {smallest_px * pixel:.4f} mm"
        )
        self.smallest_px = smallest_px


@dataclass(frozen=True, slots=True, eq=False)
class OpenedStack:
    """Images and the edges that were found in them.

    Attributes
    ----------
    source
        Where the images are.
    stack
        The images, cut again across a curved organ where it needs that.
    traced
        The edges.
    sections
        The edges by the image's number.
    """

    source: Path
    stack: ImageStack
    traced: TracedOrgan
    sections: dict[int, TracedSection]

    def picture(self, index: int) -> NDArray[np.uint8]:
        """Return an image with its edges drawn over it.

        Parameters
        ----------
        index
            Number of the image, from 0.

        Returns
        -------
        NDArray[np.uint8]
            (h, w, 3) RGB, see `edge_picture`.
        """
        return edge_picture(self.stack.image(index), self.sections.get(index))

    def problem(self, index: int) -> str | None:
        """Return why nothing was found in an image.

        Parameters
        ----------
        index
            Number of the image, from 0.

        Returns
        -------
        str | None
            The reason; None if an edge was found.
        """
        return self.traced.problems.get(index)


@dataclass(frozen=True, slots=True)
class _TooSmall:
    """The smallest tolerance that can be kept is not the one that was asked for, mm."""

    smallest_mm: float


class OrganWorkbench:
    """One trainee's images, and the organ built of them. Nothing is done before it is asked for.

    Its methods may be called from any thread, but only one at a time makes something.

    Parameters
    ----------
    bounds
        The most that may be sent.
    process
        Where edges are found and organs are built; this process when None.

    Attributes
    ----------
    opened
        The images that are looked at, or None.
    built
        The organ at the threshold asked for last, or None.
    """

    def __init__(
        self, bounds: UploadBounds | None = None, process: BuildProcess | None = None
    ) -> None:
        self._process = process
        self.opened: OpenedStack | None = None
        self.built: BuiltOrgan | None = None
        self._bounds = UploadBounds() if bounds is None else bounds
        self._folder: TemporaryDirectory[str] | None = None
        self._closed = False
        self._lock = threading.Lock()

    def open_folder(self, source: Path, progress: Progress | None = None) -> OpenedStack:
        """Take the images in a folder of this machine.

        Parameters
        ----------
        source
            The folder.
        progress
            Called after each image with the number done and the number of images.

        Returns
        -------
        OpenedStack
            The images and their edges.

        Raises
        ------
        ValueError
            If they cannot be read.
        Abandoned
            If the workbench is closed meanwhile.
        """
        opened = self._open(source, None, None, progress)
        self._take(opened, None)
        return opened

    def open_upload(
        self,
        name: str,
        content: bytes,
        *,
        pixel_mm: float | None = None,
        slice_mm: float | None = None,
        progress: Progress | None = None,
    ) -> OpenedStack:
        """Take images that were sent. Those before them stay if these cannot be taken.

        Parameters
        ----------
        name, content
            A zip or a TIFF.
        pixel_mm, slice_mm
            Pixel's side and distance of the images; as a ``spacing.json`` says where not given.
        progress
            Called after each image with the number done and the number of images.

        Returns
        -------
        OpenedStack
            The images and their edges.

        Raises
        ------
        ImageStackError
            If they cannot be read, in one line and without paths of this machine.
        Abandoned
            If the workbench is closed meanwhile.
        """
        folder = TemporaryDirectory(prefix="bluntdissect-", ignore_cleanup_errors=True)
        try:
            place = Path(folder.name)
            source = unpack_upload(name, content, place, self._bounds)
            try:
                opened = self._open(source, pixel_mm, slice_mm, progress)
            except ValueError as error:
                raise ImageStackError(_without(place, error)) from error
            self._take(opened, folder)
        except BaseException:
            folder.cleanup()
            raise
        return opened

    def build(
        self, tolerance_px: float | None = None, progress: Progress | None = None
    ) -> BuiltOrgan:
        """Build the organ of the images, with the bytes that `compress` writes for them.

        Parameters
        ----------
        tolerance_px
            Largest RMS distance of a section's edge points to the organ, px; as `build_organ`
            finds suitable when None.
        progress
            Called after each image with the number done and the number of images.

        Returns
        -------
        BuiltOrgan
            The organ.

        Raises
        ------
        PromiseRefusedError
            If the threshold cannot be kept.
        ValueError
            If there are no images, or no organ in them.
        Abandoned
            If the workbench is closed meanwhile.
        """
        self.built = None
        opened = self.opened
        if opened is None:
            raise ValueError("there are no images: choose the phantom or send some")
        try:
            built = self._made(progress, _built, opened.stack, tolerance_px)
        except ValueError as error:
            raise ValueError(_without(opened.source.parent, error)) from error
        if isinstance(built, _TooSmall):
            pixel = opened.stack.mean_pixel
            raise PromiseRefusedError(tolerance_px or 0.0, built.smallest_mm / pixel, pixel)
        # The images have not been changed under it.
        if self.opened is opened:
            self.built = built
        return built

    def close(self) -> None:
        """Remove what was sent; what is being made stops at its next image."""
        with self._lock:
            self._closed = True
            folder, self._folder = self._folder, None
        self.opened = self.built = None
        if folder is not None:
            folder.cleanup()

    def _open(
        self,
        source: Path,
        pixel_mm: float | None,
        slice_mm: float | None,
        progress: Progress | None,
    ) -> OpenedStack:
        return self._made(progress, _opened, source, pixel_mm, slice_mm)

    def _take(self, opened: OpenedStack, folder: TemporaryDirectory[str] | None) -> None:
        with self._lock:
            if self._closed:
                raise Abandoned
            before, self._folder = self._folder, folder
            self.opened, self.built = opened, None
        if before is not None:
            before.cleanup()

    def _made(self, progress: Progress | None, work: Callable[..., Made], *args: object) -> Made:
        """Have something made, until the workbench is closed."""

        def watched(done: int, total: int) -> None:
            if self._closed:
                raise Abandoned
            if progress is not None:
                progress(done, total)

        if self._process is None:
            return work(*args, watched)
        return self._process.make(work, *args, progress=watched, wanted=lambda: not self._closed)


def _opened(
    source: Path, pixel_mm: float | None, slice_mm: float | None, progress: Progress
) -> OpenedStack:
    """Read images and find their edges."""
    pixel = None if pixel_mm is None else (pixel_mm, pixel_mm)
    stack = read_image_stack(source, pixel_size=pixel, slice_spacing=slice_mm)
    stack = recut_where_needed(stack, "auto")
    traced = trace_organ(stack, progress=progress)
    sections = {section.index: section for section in traced.sections}
    return OpenedStack(source, stack, traced, sections)


def _built(
    stack: ImageStack, tolerance_px: float | None, progress: Progress
) -> BuiltOrgan | _TooSmall:
    """Build an organ, or return what can be kept instead."""
    try:
        return build_organ(stack, tolerance_px=tolerance_px, progress=progress)
    except ToleranceTooSmall as error:
        return _TooSmall(error.smallest_mm)


def _without(folder: Path, error: ValueError) -> str:
    """Return an error's text in one line, without where on this machine it happened."""
    text = str(error)
    for place in (folder, folder.resolve()):
        text = text.replace(f"{place}/", "").replace(str(place), "the upload")
    # A page has fields where a command line has options.
    text = text.replace("--pixel-size", "the pixel size").replace(
        "--slice-spacing", "the slice distance"
    )
    return " ".join(text.split())
