"""One stack to compress, and jobs for many that go into one folder."""

import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from app.compression.image_upload import UploadBounds, unpack_upload
from app.compression.organ_figure import check_figure_target, draw_organ_figure
from app.compression.report import Facts, facts
from organ_geometry import (
    Promise,
    ReadOptions,
    TraceOptions,
    When,
    WorkFolder,
    build_fitted,
    check_target,
    fit_organ,
    read_image_stack,
    reslice_where_needed,
    trace_organ,
    write_organ,
)

ORGAN_SUFFIX = ".organ"
# The most of a zip that is one's own.
ZIP_BOUNDS = UploadBounds(
    file_bytes=2**30,
    entries=20_000,
    unpacked_bytes=2**31,
    image_pixels=2**28,
    all_pixels=2**32,
    more_pixels="",
    otherwise="unpack it, and give its folder or file",
)


@dataclass(frozen=True, slots=True)
class StackJob:
    """A stack to compress, and its options."""

    stack: Path  # Where the images are: a folder, a file or a zip
    output: Path  # The organ file to write
    figure: Path | None = None  # The picture to draw, or None
    read: ReadOptions = field(default_factory=ReadOptions)
    reslice: When = "auto"
    trace: TraceOptions = field(default_factory=TraceOptions)
    promise: Promise = field(default_factory=Promise)


@dataclass(frozen=True, slots=True)
class Failed:
    """A stack that could not be compressed."""

    stack: str  # Where its images are
    error: str  # Why, in one line

    def as_json(self) -> dict[str, object]:
        """Return the failure as values for JSON."""
        return {"stack": self.stack, "error": self.error}


def _check_job(job: StackJob) -> None:
    """Refuse files that cannot be written, or that would be taken for images of the stack."""
    if job.output.suffix.lower() != ORGAN_SUFFIX:
        raise ValueError(f"an organ file must end in {ORGAN_SUFFIX}, not {job.output}")
    check_target(job.output)
    if job.output.resolve() == job.stack.resolve():
        raise ValueError(f"cannot write {job.output}: it is what is read")
    if job.figure is None:
        return
    check_figure_target(job.figure)
    if job.stack.resolve() in (job.figure.resolve(), job.figure.resolve().parent):
        raise ValueError(
            f"cannot draw {job.figure}: it would be taken for an image of {job.stack}; "
            "draw it into another folder"
        )


def compress_stack(job: StackJob, progress: Callable[[int, int], None] | None = None) -> Facts:
    """Build a stack's organ and write its file, and its figure where one is wanted."""
    _check_job(job)
    started = time.perf_counter()
    with _unpacked(job.stack) as source:
        images = read_image_stack(source, job.read)
        traced = trace_organ(images, job.trace, progress=progress)
        images, traced = reslice_where_needed(
            images, traced, job.trace, job.reslice, progress=progress
        )
        built = build_fitted(fit_organ(images, traced), job.promise)
        seconds = time.perf_counter() - started
        write_organ(built.organ, job.output)
        if job.figure is not None:
            edges = [contour.outer for contour in built.contours]
            draw_organ_figure(built.organ, edges, job.figure, title=job.output.stem)
        return facts(built, images, stack=job.stack, output=job.output, seconds=seconds)


@contextmanager
def _unpacked(stack: Path) -> Generator[Path]:
    """Give where a stack's images are: of a zip, unpacked for as long as they are read."""
    if not (stack.is_file() and stack.suffix.lower() == ".zip"):
        yield stack
        return
    with WorkFolder() as place:
        folder = Path(place)
        try:
            yield unpack_upload(stack.name, _content(stack), folder, ZIP_BOUNDS)
        except ValueError as error:
            message = str(error).replace(f"{folder}/", f"{stack}/")
            raise ValueError(message if str(stack) in message else f"{stack}: {message}") from error


def _content(stack: Path) -> bytes:
    if stack.stat().st_size > ZIP_BOUNDS.file_bytes:
        raise ValueError(f"it is larger than {ZIP_BOUNDS.file_bytes:,} bytes: unpack it")
    return stack.read_bytes()


def jobs_into(
    folder: Path, stacks: Sequence[Path], *, figures: Path | None, like: StackJob
) -> list[StackJob]:
    """Return a job for each stack, with the options of another and file names that differ."""
    places = [stack.resolve() for stack in stacks]
    for place, stack in zip(places, stacks, strict=True):
        if places.count(place) > 1:
            raise ValueError(f"the stack {stack} is given twice")
    return [
        replace(
            like,
            stack=stack,
            output=folder / f"{name}{ORGAN_SUFFIX}",
            figure=None if figures is None else figures / f"{name}.png",
        )
        for stack, name in zip(stacks, _names(places), strict=True)
    ]


def try_stack(job: StackJob) -> Facts | Failed:
    """Compress a stack, or say why that failed."""
    try:
        return compress_stack(job)
    except (ValueError, OSError) as error:
        return Failed(str(job.stack), " ".join(str(error).split()))


def _names(places: list[Path]) -> list[str]:
    """Return names that differ, with as few folders in them as possible."""
    for depth in range(max(len(place.parts) for place in places)):
        names = [_name(place, depth) for place in places]
        if len({name.casefold() for name in names}) == len(names):
            return names
    alike = ", ".join(str(place) for place in places)
    raise ValueError(f"two of {alike} would give the same file; compress them one by one")


def _name(place: Path, depth: int) -> str:
    """Return a stack's name after the names of the last folders that it is in."""
    own = place.name if place.is_dir() else place.name.split(".")[0]
    folders = place.parent.parts[1:]
    return "-".join([*folders[len(folders) - depth :], own])
