"""An organ's edges in a whole stack of images, followed from slice to slice.

It begins at the seed, or with the clearest section of a few spread over the stack, and goes to both
ends, each section looked for by the one before (`next_section`). Where one is lost, the image has a
problem, and the next is looked for by the last that was found. That goes one image after the other;
images are read ahead, and edges of sections found are moved to a part of a pixel, in threads: what
is found does not depend on how many.
"""

import math
import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace

import cv2
import numpy as np

from organ_geometry.contours.edge_curve import NoEdgeFound
from organ_geometry.contours.edges import find_polarity, pixel_scale
from organ_geometry.contours.first_section import first_section, seed_polarity
from organ_geometry.contours.found_section import (
    EdgeRule,
    FoundSection,
    section_edges,
    shows_other_component,
)
from organ_geometry.contours.next_section import next_section
from organ_geometry.contours.trace_options import Polarity, SeedPoint, TraceOptions, seed_point
from organ_geometry.contours.traced_organ import (
    NothingLeft,
    TracedOrgan,
    TracedSection,
    slice_ranges,
    with_persistent_lumens,
)
from organ_geometry.images.grey_image import GreyImage
from organ_geometry.images.image_stack import ImageStack

Progress = Callable[[int, int], None]

# Images that polarity and the first section are sought in.
SAMPLES = 9
# Growth from one slice to the next that is worth a word.
LARGE_GROWTH = 2.5
# Of more threads the one that follows the organ is the slowest.
_LARGEST_POOL = 8


def trace_organ(
    stack: ImageStack,
    options: TraceOptions | None = None,
    *,
    progress: Progress | None = None,
    workers: int | None = None,
) -> TracedOrgan:
    """Return the edges of the organ in every slice of a stack."""
    if workers is not None and workers < 1:
        raise ValueError(f"workers must be 1 thread or more, not {workers}")
    options = TraceOptions() if options is None else options
    seed = None if options.seed is None else seed_point(options.seed, stack)
    size = min(os.cpu_count() or 1, _LARGEST_POOL) if workers is None else workers
    with ThreadPoolExecutor(size, thread_name_prefix="edges") as pool:
        try:
            traced = _Tracing(stack, pool, 2 * size + 1).run(options, seed, progress)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    if options.edge_shift_mm:
        return _shifted(traced, options.edge_shift_mm, stack)
    return traced


def _shifted(traced: TracedOrgan, shift_mm: float, stack: ImageStack) -> TracedOrgan:
    """Return traced edges moved out or in; sections of which nothing is left are problems."""
    sections: list[TracedSection] = []
    problems = dict(traced.problems)
    for section in traced.sections:
        try:
            sections.append(section.grown(shift_mm, stack.pixel_size))
        except NothingLeft as error:
            problems[section.index] = str(error)
    direction = "out" if shift_mm > 0.0 else "in"
    note = f"edges are moved {direction} by {abs(shift_mm):.4g} mm, as asked"
    return replace(traced, sections=tuple(sections), problems=problems, notes=(*traced.notes, note))


@dataclass(frozen=True, slots=True, eq=False)
class _Edges:
    """A traced section, with the values that its notes name."""

    section: TracedSection
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
        options: TraceOptions,
        seed: SeedPoint | None,
        progress: Progress | None,
    ) -> TracedOrgan:
        """Return the organ."""
        total = len(self._stack)
        pixel_size = (float(self._stack.pixel_size[0]), float(self._stack.pixel_size[1]))
        polarity = options.polarity
        rule = EdgeRule("bright", options.threshold, options.method, pixel_scale(pixel_size))
        start: FoundSection | None = None
        if seed is None:
            rule, start = self._survey(rule, polarity)
        elif polarity == "auto":
            image = self._stack.image(seed.index)
            rule = replace(rule, polarity=seed_polarity(image, seed.place))
        else:
            rule = replace(rule, polarity=polarity)

        first = 0 if start is None else start.index
        if seed is not None:
            first = seed.index
        order = [*range(first, total), *range(first - 1, -1, -1)]
        last = began = start
        for done, (index, image) in enumerate(self._images(order), start=1):
            if index == first - 1:
                last = start
            try:
                if last is None or last.index == index:
                    section = self._begun(index, image, rule, seed)
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
        traced, dropped = with_persistent_lumens([edges.section for edges in sections])
        return TracedOrgan(
            sections=traced,
            problems=dict(sorted(self._problems.items())),
            polarity=rule.polarity,
            notes=tuple(self._notes(rule, polarity, seed, began, sections, dropped)),
        )

    def _begun(
        self, index: int, image: GreyImage, rule: EdgeRule, seed: SeedPoint | None
    ) -> FoundSection:
        """Return the section that the organ begins with, if this image has it."""
        if seed is None:
            return first_section(index, image, rule, None)
        if index != seed.index:
            # In another image that point may be on another thing.
            raise NoEdgeFound(self._problems[seed.index])
        return first_section(index, image, rule, seed.place)

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
        """Collect results of the threads until few are left to come."""
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
        seed: SeedPoint | None,
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
        carried = [edges.section.index for edges in sections if edges.section.carried]
        if carried:
            yield (
                f"where the threshold leaks into a neighbour or parts the organ, the edge is "
                f"carried on from the image before: {slice_ranges(carried)}"
            )
        grown = [edges.section.index for edges in sections if edges.growth > LARGE_GROWTH]
        if grown:
            yield (
                f"the organ's area grows more than {LARGE_GROWTH:g} times from one image to the "
                f"next: {slice_ranges(grown)}"
            )
        if dropped:
            yield f"a hole that no image nearby shows is no lumen: {slice_ranges(dropped)}"


def _edges(section: FoundSection, rule: EdgeRule, seeded: bool) -> _Edges:
    outer, lumen = section_edges(section, rule)
    traced = TracedSection(
        index=section.index,
        outer=outer,
        lumen=lumen,
        other_component=not seeded and shows_other_component(section, rule),
        threshold=rule.sign * section.region.outer_level,
        carried=section.carried is not None,
    )
    return _Edges(traced, section.growth)


def _clarity(section: FoundSection) -> float:
    """Return how well a section is suited to begin with: large, round and clear."""
    filled = section.region.filled
    outlines, _ = cv2.findContours(filled, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    _, radius = cv2.minEnclosingCircle(max(outlines, key=len))
    area = float(section.areas[-1])
    roundness = area / (math.pi * max(radius, 1.0) ** 2)
    return math.sqrt(area) * roundness**2 * section.region.contrast
