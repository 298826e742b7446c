"""An organ's edges in a whole stack of images, followed from slice to slice."""

import math
import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from organ_geometry.edge_curve import NoEdgeFound
from organ_geometry.edges import EdgeMethod, FoundPolarity, Polarity, find_polarity, pixel_scale
from organ_geometry.first_section import first_section, seed_polarity
from organ_geometry.found_section import EdgeRule, FoundSection, section_edges, shows_other_part
from organ_geometry.image_stack import GreyImage, ImageStack
from organ_geometry.next_section import next_section

Progress = Callable[[int, int], None]

SAMPLES = 9
# Growth from one slice to the next that is worth a word.
LARGE_GROWTH = 2.5
# A lumen is one only if another section, at most this many away, shows it too.
LUMEN_REACH = 2
_LARGEST_POOL = 8


@dataclass(frozen=True, slots=True, eq=False)
class TracedSection:
    """The edges of the organ in one slice.

    Attributes
    ----------
    index
        Number of the slice, from 0.
    outer
        (N, 2) points x = column, y = row of the outer boundary, px; pixel centres are integers and
        the last point joins the first.
    lumen
        (M, 2) points of the lumen's boundary, px, or None.
    other_part
        Whether the image shows another part of at least a twentieth of the organ's area that stands
        out as clearly. With a seed, other things are expected in view, and this is False.
    threshold
        Grey level of the outer boundary.
    """

    index: int
    outer: NDArray[np.float64]
    lumen: NDArray[np.float64] | None
    other_part: bool
    threshold: float


@dataclass(frozen=True, slots=True)
class TracedOrgan:
    """The edges of an organ in a stack of images.

    Attributes
    ----------
    sections
        The sections found, in order.
    problems
        For each other slice, why nothing was found.
    polarity
        Whether the organ is brighter or darker than its surroundings.
    notes
        How it was found: sentences for whoever wants to know.
    """

    sections: tuple[TracedSection, ...]
    problems: dict[int, str]
    polarity: FoundPolarity
    notes: tuple[str, ...]


def trace_organ(
    stack: ImageStack,
    *,
    polarity: Polarity = "auto",
    threshold: float | None = None,
    method: EdgeMethod = "half-level",
    seed: tuple[float, float] | None = None,
    progress: Progress | None = None,
    workers: int | None = None,
) -> TracedOrgan:
    """Return the edges of the organ in every slice of a stack.

    The organ begins at the seed in the first image. Without one it begins in the clearest of a few
    images over the stack, as the largest thing near the middle, and is followed both ways from
    there. In each next image it is the part that covers most of the last section found.

    Images are read ahead in threads, a few at a time; what comes out does not depend on how many
    threads there are.

    Parameters
    ----------
    stack
        The images; only a few are held at a time.
    polarity
        Whether the organ is brighter or darker than its surroundings; "auto" decides, around the
        seed or from a few images.
    threshold
        Grey level of the edge. Default: half way between the levels inside and around the organ in
        each slice, which Otsu's threshold tells apart where the organ begins.
    method
        "half-level" or "canny".
    seed
        A point x, y of the organ in the first image, px.
    progress
        Called after each slice with the number done and the number of slices.
    workers
        Number of threads. Default: the number of cores, at most 8.

    Returns
    -------
    TracedOrgan
        Sections, problems and notes.

    Raises
    ------
    ValueError
        If an image cannot be read, an option is unknown or the seed is outside of the image.
    """
    _check(stack, polarity, threshold, method, seed, workers)
    size = min(os.cpu_count() or 1, _LARGEST_POOL) if workers is None else workers
    with ThreadPoolExecutor(size, thread_name_prefix="edges") as pool:
        try:
            return _Tracing(stack, pool, 2 * size + 1).run(
                polarity, threshold, method, seed, progress
            )
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _check(
    stack: ImageStack,
    polarity: str,
    threshold: float | None,
    method: str,
    seed: tuple[float, float] | None,
    workers: int | None,
) -> None:
    if polarity not in {"auto", "bright", "dark"}:
        raise ValueError(f"polarity must be auto, bright or dark, not {polarity!r}")
    if method not in {"half-level", "canny"}:
        raise ValueError(f"method must be half-level or canny, not {method!r}")
    if threshold is not None and not math.isfinite(threshold):
        raise ValueError(f"threshold must be a grey level, not {threshold}")
    if workers is not None and workers < 1:
        raise ValueError(f"workers must be 1 thread or more, not {workers}")
    rows, columns = stack.shape
    if seed is not None and not (0 <= seed[0] <= columns - 1 and 0 <= seed[1] <= rows - 1):
        raise ValueError(
            f"seed must be a point x, y of the first image, from 0, 0 to {columns - 1}, "
            f"{rows - 1}, not {seed[0]:g}, {seed[1]:g}"
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Edges:
    """A traced section and what its notes are made of."""

    section: TracedSection
    carried: bool
    growth: float


class _Tracing:
    """One run through a stack."""

    def __init__(self, stack: ImageStack, pool: ThreadPoolExecutor, ahead: int) -> None:
        self._stack = stack
        self._pool = pool
        self._ahead = ahead
        self._problems: dict[int, str] = {}
        self._found: list[_Edges] = []
        self._pending: deque[tuple[int, Future[_Edges]]] = deque()

    def run(
        self,
        polarity: Polarity,
        threshold: float | None,
        method: EdgeMethod,
        seed: tuple[float, float] | None,
        progress: Progress | None,
    ) -> TracedOrgan:
        """Return the organ."""
        total = len(self._stack)
        pixel_size = (float(self._stack.pixel_size[0]), float(self._stack.pixel_size[1]))
        rule = EdgeRule("bright", threshold, method, pixel_scale(pixel_size))
        start: FoundSection | None = None
        if seed is None:
            rule, start = self._survey(rule, polarity)
        elif polarity == "auto":
            rule = replace(rule, polarity=seed_polarity(self._stack.image(0), seed))
        else:
            rule = replace(rule, polarity=polarity)

        first = 0 if start is None else start.index
        order = [*range(first, total), *range(first - 1, -1, -1)]
        last = began = start
        for done, (index, image) in enumerate(self._images(order), start=1):
            if index == first - 1:
                last = start
            try:
                if last is None or last.index == index:
                    section = first_section(index, image, rule, seed)
                    start = began = section
                else:
                    name = self._stack.names[last.index]
                    section = next_section(index, image, rule, last, name)
                last = section
                self._hand_over(section, rule, seeded=seed is not None)
            except NoEdgeFound as error:
                self._problems[index] = str(error)
            if progress is not None:
                progress(done, total)
        self._collect(0)
        sections = sorted(self._found, key=lambda edges: edges.section.index)
        traced, dropped = _with_lasting_lumens([edges.section for edges in sections])
        return TracedOrgan(
            sections=traced,
            problems=dict(sorted(self._problems.items())),
            polarity=rule.polarity,
            notes=tuple(self._notes(rule, polarity, seed, began, sections, dropped)),
        )

    def _images(self, order: Sequence[int]) -> Iterator[tuple[int, GreyImage]]:
        """Yield slices in an order, reading a few ahead."""
        ahead: deque[tuple[int, Future[GreyImage]]] = deque()
        for index in order:
            ahead.append((index, self._pool.submit(self._stack.image, index)))
            if len(ahead) >= self._ahead:
                here, future = ahead.popleft()
                yield here, future.result()
        while ahead:
            here, future = ahead.popleft()
            yield here, future.result()

    def _hand_over(self, section: FoundSection, rule: EdgeRule, *, seeded: bool) -> None:
        """Have a section's edges found to a part of a pixel, in a thread."""
        self._pending.append((section.index, self._pool.submit(_edges, section, rule, seeded)))
        self._collect(self._ahead)

    def _collect(self, left: int) -> None:
        """Take what the threads have found, until no more than a few are left."""
        while len(self._pending) > left:
            index, future = self._pending.popleft()
            try:
                self._found.append(future.result())
            except NoEdgeFound as error:
                self._problems[index] = str(error)

    def _survey(self, rule: EdgeRule, polarity: Polarity) -> tuple[EdgeRule, FoundSection | None]:
        """Return the rule with its polarity, and the clearest section of a few, if any."""
        count = min(SAMPLES, len(self._stack))
        wanted = np.unique(np.linspace(0, len(self._stack) - 1, count).round().astype(int))
        indices = [int(index) for index in wanted]
        images = list(self._pool.map(self._stack.image, indices))
        rule = replace(rule, polarity=find_polarity(images) if polarity == "auto" else polarity)

        def look(index: int, image: GreyImage) -> FoundSection | None:
            try:
                return first_section(index, image, rule, None)
            except NoEdgeFound:
                return None

        found = [section for section in self._pool.map(look, indices, images) if section]
        return rule, max(found, key=_clarity, default=None)

    def _notes(
        self,
        rule: EdgeRule,
        polarity: Polarity,
        seed: tuple[float, float] | None,
        began: FoundSection | None,
        sections: list[_Edges],
        dropped: list[int],
    ) -> Iterator[str]:
        names = self._stack.names
        if polarity == "auto":
            where = "at the seed" if seed is not None else "in a few images over the stack"
            yield f"the organ is taken as {rule.polarity}, as it is {where}"
        if began is not None:
            how = "at the seed" if seed is not None else "as the largest clear part"
            _, _, width, height = cv2.boundingRect(began.region.filled)
            yield (
                f"the organ is followed from {names[began.index]}, {how}, where it is {width} x "
                f"{height} px"
            )
        if rule.threshold is not None:
            yield f"the edge is where the grey level is {rule.threshold:g}, as given"
        else:
            yield (
                "the edge is half way between the grey levels inside and around the organ in each "
                "image, first told apart by Otsu's threshold"
            )
        if rule.method == "canny":
            yield "the edge is Canny's, to a part of a pixel by a parabola across it"
        carried = [edges.section.index for edges in sections if edges.carried]
        if carried:
            yield (
                f"where the threshold leaks into a neighbour, the edge is carried on from the "
                f"image before: {slice_ranges(carried)}"
            )
        grown = [edges.section.index for edges in sections if edges.growth > LARGE_GROWTH]
        if grown:
            yield (
                f"the organ's area grows more than {LARGE_GROWTH:g} times from one image to the "
                f"next: {slice_ranges(grown)}"
            )
        if dropped:
            yield f"a hole that no image nearby shows is no lumen: {slice_ranges(dropped)}"


def slice_ranges(indices: Sequence[int]) -> str:
    """Return numbers of slices with neighbours put together.

    Parameters
    ----------
    indices
        Numbers of slices, ascending.

    Returns
    -------
    str
        The numbers, as "3, 5-8".

    Examples
    --------
    >>> slice_ranges([3, 5, 6, 7, 8])
    '3, 5-8'
    """
    runs: list[list[int]] = []
    for index in indices:
        if runs and index == runs[-1][-1] + 1:
            runs[-1].append(index)
        else:
            runs.append([index])
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)


def _edges(section: FoundSection, rule: EdgeRule, seeded: bool) -> _Edges:
    """Return the edges of a section found to a pixel."""
    outer, lumen = section_edges(section, rule)
    traced = TracedSection(
        index=section.index,
        outer=outer,
        lumen=lumen,
        other_part=not seeded and shows_other_part(section, rule),
        threshold=rule.sign * section.region.outer_level,
    )
    return _Edges(traced, section.carried is not None, section.growth)


def _clarity(section: FoundSection) -> float:
    """Return how well a section is suited to begin with: large, round and clear."""
    filled = section.region.filled
    outlines, _ = cv2.findContours(filled, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    _, radius = cv2.minEnclosingCircle(max(outlines, key=len))
    area = float(section.areas[-1])
    roundness = area / (math.pi * max(radius, 1.0) ** 2)
    return math.sqrt(area) * roundness**2 * section.region.contrast


def _with_lasting_lumens(
    sections: list[TracedSection],
) -> tuple[tuple[TracedSection, ...], list[int]]:
    """Return sections without the lumens that no section near them shows, and which those are."""
    boxes = [
        None if lumen is None else (lumen.min(axis=0), lumen.max(axis=0))
        for lumen in (section.lumen for section in sections)
    ]
    dropped: list[int] = []
    result: list[TracedSection] = []
    for place, section in enumerate(sections):
        box = boxes[place]
        near = boxes[max(0, place - LUMEN_REACH) : place] + boxes[place + 1 :][:LUMEN_REACH]
        lasting = box is None or any(
            other is not None and bool((box[0] <= other[1]).all() and (other[0] <= box[1]).all())
            for other in near
        )
        if not lasting and len(sections) > 1:
            dropped.append(section.index)
            result.append(replace(section, lumen=None))
        else:
            result.append(section)
    return tuple(result), dropped
