"""A workbench on which an organ is built step by step: images, their edges, a threshold."""

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.compression.build_process import Abandoned, BuildProcess, Made
from app.compression.edge_picture import edge_picture
from app.compression.image_upload import UploadBounds, unpack_upload
from app.workers import Progress
from organ_geometry import (
    BuiltOrgan,
    ImageStack,
    ImageStackError,
    Promise,
    ReadOptions,
    Region,
    ReslicedSlices,
    ToleranceTooSmall,
    TracedOrgan,
    TracedSection,
    TraceOptions,
    WorkFolder,
    build_fitted,
    fit_organ,
    is_dicom_file,
    is_volume_file,
    read_header,
    read_image_stack,
    reslice_where_needed,
    stack_labels,
    trace_organ,
)


class PromiseRefusedError(ValueError):
    """A threshold cannot be kept; the smallest that can is named."""

    def __init__(self, wanted_px: float, smallest_px: float, pixel: float) -> None:
        super().__init__(
            f"{wanted_px:.3g} px cannot be kept at every section: the smallest that can is "
            f"about {smallest_px:.3f} px, {smallest_px * pixel:.4f} mm"
        )
        # In pixels, and about: the digits of the file depend on the threshold too.
        self.smallest_px = smallest_px


@dataclass(frozen=True, slots=True)
class OrganChoice:
    """Which organ to trace, as by the options of `compress`."""

    # Column, row and image of a pixel of the organ, from 0 in the whole images, or None.
    seed: tuple[int, int, int] | None = None
    # The part of the images in which it is, or None for all.
    region: tuple[int, int, int, int, int, int] | None = None
    label: int | None = None  # Where the images hold labels
    reslice: bool = True  # Whether images of a curved organ may be resliced


@dataclass(frozen=True, slots=True, eq=False)
class OpenedStack:
    """Images and the edges that were found in them."""

    source: Path  # Where the images are
    whole: ImageStack  # All images, before cropping and reslicing
    labels: tuple[int, ...]
    choice: OrganChoice
    # The images that are traced: cropped to the region, and resliced across a curved organ.
    stack: ImageStack
    traced: TracedOrgan | None  # The edges; None where a label is to be chosen first
    # The pixel's side and the distance of the images that were given, mm, or None.
    sizes_mm: tuple[float | None, float | None]

    @property
    def resliced(self) -> bool:
        """Whether the images were resliced, so that a place in them is none in those uploaded."""
        return isinstance(self.stack.slices, ReslicedSlices)

    @property
    def shown(self) -> ImageStack:
        """The images to show: all of them, or the resliced ones."""
        return self.stack if self.resliced else self.whole

    def picture(self, index: int) -> NDArray[np.uint8]:
        """Return an image with its edges, the region and the seed drawn over it."""
        image, section = self.shown.image(index), self.section(index)
        if self.resliced:
            return edge_picture(image, section)
        region, seed = self.choice.region, self.choice.seed
        if region is not None and section is not None:
            section = section.moved(region[0], region[1])
        return edge_picture(
            image,
            section,
            region=region,
            inside=region is None or region[4] <= index <= region[5],
            seed=seed[:2] if seed is not None and seed[2] == index else None,
        )

    def section(self, index: int) -> TracedSection | None:
        """Return the edges in an image, in pixels of the region."""
        wanted = index - self._first
        found = () if self.traced is None else self.traced.sections
        return next((section for section in found if section.index == wanted), None)

    def problem(self, index: int) -> str | None:
        """Return why nothing was found in an image."""
        if self.traced is None:
            return "choose the organ's label"
        if not 0 <= index - self._first < len(self.stack):
            return "it is left out"
        return self.traced.problems.get(index - self._first)

    @property
    def _first(self) -> int:
        """Number of the first image looked at among those shown."""
        region = self.choice.region
        return 0 if self.resliced or region is None else region[4]


@dataclass(frozen=True, slots=True)
class _TooSmall:
    """The smallest tolerance that can be kept, mm, above the one asked for."""

    smallest_mm: float


class OrganWorkbench:
    """One trainee's images, and the organ built of them.

    Its methods may be called from any thread, but only one at a time traces or builds.
    """

    def __init__(
        self, bounds: UploadBounds | None = None, process: BuildProcess | None = None
    ) -> None:
        # Edges are found and organs built in `process`, or in this process when None.
        self._process = process
        self.opened: OpenedStack | None = None
        self.built: BuiltOrgan | None = None  # At the threshold asked for last
        self._bounds = UploadBounds() if bounds is None else bounds
        self._folder: WorkFolder | None = None
        self._closed = False
        self._lock = threading.Lock()

    def open_folder(self, source: Path, progress: Progress | None = None) -> OpenedStack:
        """Take the images in a folder of this machine."""
        opened = self._made(progress, _opened, source, (None, None), OrganChoice(), self._bounds)
        self._take(opened, None)
        return opened

    def choose(self, choice: OrganChoice, progress: Progress | None = None) -> OpenedStack:
        """Trace another organ in the images; the one before stays if this fails."""
        before = self.opened
        if before is None:
            raise ValueError(_NO_IMAGES)
        try:
            opened = self._made(
                progress, _opened, before.source, before.sizes_mm, choice, self._bounds
            )
        except ValueError as error:
            raise ValueError(_without(before.source.parent, error)) from error
        with self._lock:
            if self._closed or self.opened is not before:
                raise Abandoned
            self.opened, self.built = opened, None
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
        """Take images that were sent. Those before them stay if these cannot be taken."""
        folder = WorkFolder()
        try:
            place = Path(folder.name)
            source = unpack_upload(name, content, place, self._bounds)
            try:
                opened = self._made(
                    progress, _opened, source, (pixel_mm, slice_mm), OrganChoice(), self._bounds
                )
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
        """Build the organ of the images, with the bytes that `compress` writes for them."""
        self.built = None
        opened = self.opened
        if opened is None:
            raise ValueError(_NO_IMAGES)
        if opened.traced is None:
            raise ValueError("the images hold labels: choose the organ's")
        try:
            built = self._made(progress, _built, opened.stack, opened.traced, tolerance_px)
        except ValueError as error:
            raise ValueError(_without(opened.source.parent, error)) from error
        if isinstance(built, _TooSmall):
            pixel = opened.stack.mean_pixel
            raise PromiseRefusedError(tolerance_px or 0.0, built.smallest_mm / pixel, pixel)
        if built.organ.length > self._bounds.organ_mm:
            raise ValueError(
                f"the organ is {built.organ.length:,.0f} mm long and the most is "
                f"{self._bounds.organ_mm:,.0f} mm (--organ-mm): are the sizes of its images in mm?"
            )
        # The images have not been changed under it.
        if self.opened is opened:
            self.built = built
        return built

    def close(self) -> None:
        """Remove the upload; a build under way stops at its next image."""
        with self._lock:
            self._closed = True
            folder, self._folder = self._folder, None
        self.opened = self.built = None
        if folder is not None:
            folder.cleanup()

    def _take(self, opened: OpenedStack, folder: WorkFolder | None) -> None:
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
    source: Path,
    sizes_mm: tuple[float | None, float | None],
    choice: OrganChoice,
    bounds: UploadBounds,
    progress: Progress,
) -> OpenedStack:
    """Read images and find the edges of the organ that is meant."""
    pixel_mm, slice_mm = sizes_mm
    pixel = None if pixel_mm is None else (pixel_mm, pixel_mm)

    def read(label: int | None, region: Region | None = None) -> ImageStack:
        return read_image_stack(source, ReadOptions(pixel, slice_mm, label=label, roi=region))

    _check_voxels(source, bounds)
    whole = read(None)
    _check_extent(whole, bounds)
    labels = stack_labels(whole)
    if labels and choice.label is None and choice.seed is not None:
        choice = replace(choice, label=_label_at(whole, choice.seed))
    if choice.label is not None:
        whole = read(choice.label)
    elif labels:
        return OpenedStack(source, whole, labels, choice, whole, None, sizes_mm)
    region, seed = choice.region, choice.seed
    stack = whole if region is None else read(choice.label, region)
    if seed is not None and region is not None:
        low, high = (region[0], region[1], region[4]), (region[2], region[3], region[5])
        if not all(a <= at <= b for a, at, b in zip(low, seed, high, strict=True)):
            raise ImageStackError("the point is outside of the part that is looked at")
        seed = seed[0] - region[0], seed[1] - region[1], seed[2] - region[4]
    trace = TraceOptions(seed=seed)
    traced = trace_organ(stack, trace, progress=progress)
    when = "auto" if choice.reslice else "never"
    stack, traced = reslice_where_needed(stack, traced, trace, when, progress=progress)
    return OpenedStack(source, whole, labels, choice, stack, traced, sizes_mm)


def _built(
    stack: ImageStack, traced: TracedOrgan, tolerance_px: float | None, _: Progress
) -> BuiltOrgan | _TooSmall:
    """Build an organ of its edges, or return the tolerance that can be kept."""
    try:
        return build_fitted(fit_organ(stack, traced), Promise(tolerance_px=tolerance_px))
    except ToleranceTooSmall as error:
        return _TooSmall(error.smallest_mm)


def _label_at(stack: ImageStack, seed: tuple[int, int, int]) -> int:
    x, y, index = seed
    rows, columns = stack.shape
    if not (0 <= x < columns and 0 <= y < rows and 0 <= index < len(stack)):
        raise ImageStackError(f"there is no pixel {x}, {y} in an image {index}")
    value = round(stack.level_offset + stack.level_step * int(stack.image(index)[y, x]))
    if value == 0:
        raise ImageStackError(f"there is no label at {x}, {y} of image {index}: point at the organ")
    return value


def _check_voxels(source: Path, bounds: UploadBounds) -> None:
    """Refuse a volume that is larger in memory than it may be, before it is read."""
    if source.is_file() and (is_volume_file(source) or is_dicom_file(source)):
        voxels = math.prod(read_header(source).size)
        if voxels > bounds.voxels:
            raise ImageStackError(
                f"{source.name} has {voxels / 1e6:,.0f} million voxels and the most is "
                f"{bounds.voxels / 1e6:,.0f} million: {bounds.otherwise}"
            )


def _check_extent(stack: ImageStack, bounds: UploadBounds) -> None:
    """Refuse images, DICOM's too, that are larger than they may be, before they are read."""
    pixels = math.prod(stack.shape)
    if pixels > bounds.image_pixels or pixels * len(stack) > bounds.all_pixels:
        raise ImageStackError(
            f"{len(stack)} images of {pixels / 1e6:,.1f} million pixels are more than is taken: "
            f"{bounds.more_pixels}{bounds.otherwise}"
        )


_NO_IMAGES = "there are no images: choose the phantom or send some"
# What a command line calls options and folders, a page calls fields and what was sent.
_PAGE_WORDS = (
    (
        "give --pixel-size and --slice-spacing or a spacing.json in the folder or its parent",
        "give the pixel size and the slice distance, or put a spacing.json into the zip",
    ),
    ("give one file of the one wanted, such as", "send a zip with one of them alone:"),
    ("give a file of several frames by itself", "send that file by itself"),
    ("give a multipage TIFF alone", "send it alone"),
    ("the folder ", ""),
    ("a folder of", "a zip of"),
)


def _without(folder: Path, error: ValueError) -> str:
    """Return an error's text in one line, without where on this machine it happened."""
    text = str(error)
    for place in (folder, folder.resolve()):
        text = text.replace(f"{place}/", "").replace(str(place), "the upload")
    for ours, on_the_page in _PAGE_WORDS:
        text = text.replace(ours, on_the_page)
    return " ".join(text.split())
