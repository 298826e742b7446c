"""The organ that is followed through a stack is the one that was begun with."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn_stack import traced_edges
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from assets import BILE_DUCT_PHANTOM
from assets.phantom import PIXEL_SPACING, SECTION_COUNT, SLICE_SPACING, outer_half_axes
from organ_geometry import TraceOptions
from organ_geometry.contours.edge_curve import enclosed_area
from organ_geometry.contours.organ_tracing import trace_organ
from organ_geometry.contours.trace_options import EdgeMethod
from organ_geometry.contours.traced_organ import TracedOrgan, slice_ranges
from organ_geometry.curves.outline_distance import polygon_distances
from organ_geometry.images.grey_image import ImageStackError
from organ_geometry.images.image_stack import ImageStack
from organ_geometry.images.stack_reader import read_image_stack

Cover = Callable[..., NDArray[np.float64]]
WriteStack = Callable[..., Path]

SHAPE = (100, 110)
CENTRE = (54.5, 49.5)
SPACING = {"pixel_spacing_mm": [0.1, 0.1], "slice_spacing_mm": 0.5}
# On anti-aliased edges in whole grey levels.
EDGE_PX = 0.05


def drawn(cover: NDArray[np.float64], *, dark: bool = False, depth: Any = np.uint8) -> Any:
    grey = 60.0 + 120.0 * cover
    grey = 255.0 - grey if dark else grey
    return np.round(grey * (257.0 if depth is np.uint16 else 1.0)).astype(depth)


def stack_of(write_stack: WriteStack, images: Sequence[Any], **spacing: Any) -> ImageStack:
    return read_image_stack(write_stack(images, SPACING | spacing))


def lobes(angles: NDArray[np.float64], radius: float, depth: float, count: int) -> Any:
    radii = radius + depth * np.cos(count * angles)
    return np.stack([CENTRE[0] + radii * np.cos(angles), CENTRE[1] + radii * np.sin(angles)], 1)


def lobed_cover(radius: float, depth: float, count: int) -> NDArray[np.float64]:
    samples = 8
    offsets = (np.arange(samples) + 0.5) / samples - 0.5
    y = (np.arange(SHAPE[0])[:, None] + offsets).reshape(-1, 1) - CENTRE[1]
    x = (np.arange(SHAPE[1])[:, None] + offsets).reshape(1, -1) - CENTRE[0]
    inside = np.hypot(x, y) < radius + depth * np.cos(count * np.arctan2(y, x))
    return inside.reshape(SHAPE[0], samples, SHAPE[1], samples).mean(axis=(1, 3))


def circle_errors(
    points: NDArray[np.float64], radius: float, centre: tuple[float, float] = CENTRE
) -> NDArray[np.float64]:
    return np.hypot(*(points - centre).T) - radius


def rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def assert_same(one: TracedOrgan, other: TracedOrgan) -> None:
    assert one.problems == other.problems
    assert one.notes == other.notes
    assert [section.index for section in one.sections] == [
        section.index for section in other.sections
    ]
    for mine, yours in zip(one.sections, other.sections, strict=True):
        np.testing.assert_array_equal(mine.outer, yours.outer)
        assert (mine.lumen is None) == (yours.lumen is None)


@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
@pytest.mark.parametrize("dark", [False, True])
def test_drawn_sections_are_traced_to_a_twentieth_of_a_pixel(
    cover: Cover, write_stack: WriteStack, dark: bool, depth: Any
) -> None:
    radii = [20.0, 21.3, 22.6, 23.9]
    images = [drawn(cover(SHAPE, CENTRE, (r, r)), dark=dark, depth=depth) for r in radii]
    organ = trace_organ(stack_of(write_stack, images))
    assert organ.polarity == ("dark" if dark else "bright")
    assert organ.problems == {}
    for section, radius in zip(organ.sections, radii, strict=True):
        assert rms(circle_errors(section.outer, radius)) < EDGE_PX
        assert section.lumen is None
        assert not section.other_component
        level = 135.0 if dark else 120.0
        assert section.threshold / (257.0 if depth is np.uint16 else 1.0) == pytest.approx(
            level, abs=0.6
        )


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(
    radius=st.floats(16.0, 34.0),
    fraction=st.floats(0.0, 0.1),
    count=st.integers(2, 4),
    dark=st.booleans(),
)
def test_lobes_are_found_to_a_twentieth_of_a_pixel(
    radius: float, fraction: float, count: int, dark: bool
) -> None:
    edges = traced_edges(drawn(lobed_cover(radius, fraction * radius, count), dark=dark))
    angles = np.linspace(0.0, 2.0 * np.pi, 1440, endpoint=False)
    truth = lobes(angles, radius, fraction * radius, count)
    assert rms(polygon_distances(edges.outer, truth)) < EDGE_PX
    assert rms(polygon_distances(truth, edges.outer)) < EDGE_PX


def test_both_edges_of_a_ring_are_found_to_a_twentieth_of_a_pixel(
    cover: Cover, write_stack: WriteStack
) -> None:
    ring = cover(SHAPE, CENTRE, (35.0, 35.0)) - cover(SHAPE, CENTRE, (24.0, 24.0))
    for section in trace_organ(stack_of(write_stack, [drawn(ring)] * 3)).sections:
        assert rms(circle_errors(section.outer, 35.0)) < EDGE_PX
        assert section.lumen is not None
        assert rms(circle_errors(section.lumen, 24.0)) < EDGE_PX


def test_turned_grey_levels_give_the_same_edge_to_rounding(
    cover: Cover, write_stack: WriteStack
) -> None:
    image = drawn(cover(SHAPE, CENTRE, (31.0, 22.0)))
    bright = traced_edges(image, polarity="bright").outer
    dark = traced_edges(np.uint8(255) - image, polarity="dark").outer
    np.testing.assert_allclose(bright, dark, atol=1e-3)


@pytest.mark.parametrize("method", ["half-level", "canny"])
def test_both_methods_agree_on_clean_sections(
    cover: Cover, write_stack: WriteStack, method: EdgeMethod
) -> None:
    images = [drawn(cover(SHAPE, CENTRE, (30.0, 22.0)))] * 3
    organ = trace_organ(stack_of(write_stack, images), TraceOptions(method=method))
    half_level = traced_edges(images[0]).outer
    assert len(organ.sections) == 3
    for section in organ.sections:
        assert polygon_distances(section.outer, half_level).max() < 0.2
        assert rms(polygon_distances(half_level, section.outer)) < 0.1


def test_canny_says_where_its_edge_does_not_close(cover: Cover, write_stack: WriteStack) -> None:
    # On the right the edge is a slope of 30 px, a quarter as steep as Canny asks for.
    disc = cover(SHAPE, CENTRE, (25.0, 25.0))
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    slope = np.clip((40.0 - np.hypot(x - CENTRE[0], y - CENTRE[1])) / 30.0, 0.0, 1.0)
    fading = np.where(x > CENTRE[0], slope, disc)
    images = [drawn(disc), drawn(fading), drawn(disc)]
    organ = trace_organ(stack_of(write_stack, images), TraceOptions(method="canny", seed=CENTRE))
    assert organ.problems.keys() == {1}
    assert organ.problems[1].startswith("Canny's edge of the organ does not close")


def test_a_threshold_given_moves_the_edge(write_stack: WriteStack) -> None:
    # A cone of light: its level 100 - r is at radius 100 - t for every threshold t.
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    away = np.hypot(x - CENTRE[0], y - CENTRE[1])
    image = np.round(255.0 * np.clip(1.0 - away / 45.0, 0.0, 1.0)).astype(np.uint8)
    stack = stack_of(write_stack, [image] * 2)
    for threshold in (60.0, 120.0, 180.0):
        organ = trace_organ(stack, TraceOptions(threshold=threshold, polarity="bright"))
        expected = 45.0 * (1.0 - threshold / 255.0)
        for section in organ.sections:
            assert section.threshold == threshold
            # The blur's correction is for a step, and a cone is none.
            assert rms(circle_errors(section.outer, expected)) < 0.1
        assert f"the edge is where the grey level is {threshold:g}, as given" in organ.notes


def test_the_organ_is_continued_past_a_larger_neighbour(
    cover: Cover, write_stack: WriteStack
) -> None:
    def scene(neighbour: float) -> Any:
        organ = cover(SHAPE, (70.5, 49.5), (13.0, 13.0))
        beside = cover(SHAPE, (28.5, 49.5), (max(neighbour, 1e-9),) * 2)
        return np.round(60.0 + 90.0 * organ + 180.0 * beside).astype(np.uint8)

    images = [scene(radius) for radius in (0.0, 0.0, 0.0, 8.0, 16.0, 24.0, 24.0, 24.0)]
    organ = trace_organ(stack_of(write_stack, images), TraceOptions(seed=(70, 50)))
    assert organ.problems == {}
    for section in organ.sections:
        assert rms(circle_errors(section.outer, 13.0, (70.5, 49.5))) < EDGE_PX


def test_the_seed_picks_the_organ(cover: Cover, write_stack: WriteStack) -> None:
    places = {(35.5, 49.5): 20.0, (82.5, 49.5): 12.0}
    both = np.sum([cover(SHAPE, place, (size, size)) for place, size in places.items()], axis=0)
    stack = stack_of(write_stack, [drawn(both)] * 4)
    for place, radius in places.items():
        organ = trace_organ(stack, TraceOptions(seed=place))
        assert len(organ.sections) == 4
        for section in organ.sections:
            assert rms(circle_errors(section.outer, radius, place)) < EDGE_PX
            assert not section.other_component
    unseeded = trace_organ(stack)
    assert all(section.other_component for section in unseeded.sections)


@pytest.mark.parametrize("index", [0, 3, 7])
def test_from_a_seed_in_any_image_the_organ_is_followed_both_ways(
    cover: Cover, write_stack: WriteStack, index: int
) -> None:
    # Two tubes that change places: only in its own image is a seed on the one that is meant.
    place = [(30.5 + 7.0 * k, 30.5) for k in range(8)]
    images = [
        drawn(cover(SHAPE, here, (13.0, 13.0)) + cover(SHAPE, (109.0 - here[0], 70.5), (16.0,) * 2))
        for here in place
    ]
    stack = stack_of(write_stack, images)
    organ = trace_organ(stack, TraceOptions(seed=(*place[index], index)))
    assert organ.problems == {}
    for section, here in zip(organ.sections, place, strict=True):
        assert rms(circle_errors(section.outer, 13.0, here)) < EDGE_PX
    assert organ.notes[1].startswith(f"the organ is followed from slice_{index}.png, at the seed")


def test_the_polarity_is_that_at_the_seed_s_image(cover: Cover, write_stack: WriteStack) -> None:
    disc = cover(SHAPE, CENTRE, (14.0, 14.0))
    empty, full = np.full(SHAPE, 60, np.uint8), drawn(disc, dark=True)
    organ = trace_organ(stack_of(write_stack, [empty, full, full]), TraceOptions(seed=(*CENTRE, 2)))
    assert organ.polarity == "dark"
    assert [section.index for section in organ.sections] == [1, 2]


def test_the_seed_decides_the_polarity(cover: Cover, write_stack: WriteStack) -> None:
    bright = cover(SHAPE, (30.5, 49.5), (14.0, 14.0))
    dark = cover(SHAPE, (78.5, 49.5), (14.0, 14.0))
    image = np.round(120.0 + 100.0 * bright - 100.0 * dark).astype(np.uint8)
    stack = stack_of(write_stack, [image] * 2)
    for place, polarity in (((30.5, 49.5), "bright"), ((78.5, 49.5), "dark")):
        organ = trace_organ(stack, TraceOptions(seed=place))
        assert organ.polarity == polarity
        assert rms(circle_errors(organ.sections[0].outer, 14.0, place)) < EDGE_PX


def test_an_organ_is_found_in_what_it_lies_in(cover: Cover, write_stack: WriteStack) -> None:
    # An organ in a body in air, beside bone: the body's edge is the higher step.
    body = cover(SHAPE, CENTRE, (45.0, 40.0))
    organ = cover(SHAPE, (48.5, 52.5), (11.0, 11.0))
    bone = cover(SHAPE, (72.5, 52.5), (9.0, 9.0))
    image = np.round(10.0 + 120.0 * body + 40.0 * organ + 120.0 * bone).astype(np.uint8)
    (section, _) = trace_organ(
        stack_of(write_stack, [image] * 2), TraceOptions(seed=(48, 52))
    ).sections
    assert rms(circle_errors(section.outer, 11.0, (48.5, 52.5))) < EDGE_PX


def test_a_leak_into_a_neighbour_is_cut_off_or_named(cover: Cover, write_stack: WriteStack) -> None:
    # A neighbour of nearly the organ's level comes nearer until the two touch.
    def scene(gap: float) -> Any:
        organ = cover(SHAPE, (35.5, 49.5), (16.0, 16.0))
        beside = cover(SHAPE, (35.5 + 16.0 + gap + 22.0, 49.5), (22.0, 22.0))
        return np.round(60.0 + 120.0 * organ + 100.0 * beside * (1.0 - organ)).astype(np.uint8)

    images = [scene(gap) for gap in (8.0, 7.0, 6.0, 5.0, 4.0, 2.5, 1.0, 0.5, 0.0, 0.0)]
    organ = trace_organ(stack_of(write_stack, images), TraceOptions(seed=(35, 50)))
    assert {section.index for section in organ.sections} >= {0, 1, 2, 3}
    for section in organ.sections:
        assert rms(circle_errors(section.outer, 16.0, (35.5, 49.5))) < 1.0
    assert all("merges with what was beside it" in text for text in organ.problems.values())


def test_a_merger_of_masks_is_named(cover: Cover, write_stack: WriteStack) -> None:
    def scene(gap: float) -> Any:
        centres = ((54.5 - 14.0 - gap, 49.5), (54.5 + 14.0 + gap, 49.5))
        return drawn(np.maximum(*(cover(SHAPE, centre, (18.0, 18.0)) for centre in centres)))

    images = [scene(gap) for gap in (10.0, 9.0, 8.0, -4.0, -5.0)]
    organ = trace_organ(stack_of(write_stack, images), TraceOptions(seed=(30, 50)))
    assert [section.index for section in organ.sections] == [0, 1, 2]
    assert organ.problems == dict.fromkeys(
        (3, 4), "the organ merges with what was beside it in slice_2.png"
    )


def test_a_split_is_named_and_followed_until_it_closes(
    cover: Cover, write_stack: WriteStack
) -> None:
    disc = cover(SHAPE, CENTRE, (24.0, 24.0))
    halves = disc.copy()
    halves[:, 50:60] = 0.0
    images = [drawn(shape) for shape in (disc, disc, halves, disc, disc)]
    organ = trace_organ(stack_of(write_stack, images))
    assert organ.problems.keys() == {2}
    assert organ.problems[2].startswith("the organ splits: beside the part that continues slice_")


def septum_scenes(cover: Cover, counts: Sequence[int]) -> list[Any]:
    """Discs, whole, parted by a band, and with one part as dark as that: below half level, but
    brighter than the surroundings."""
    disc = cover(SHAPE, CENTRE, (24.0, 24.0))
    parted = disc.copy()
    parted[:, 46:51] *= 0.25
    half = disc * 0.25
    half[:, 51:] = disc[:, 51:]
    return [drawn((disc, parted, half)[which]) for which in counts]


def test_parts_within_one_wall_are_no_split(cover: Cover, write_stack: WriteStack) -> None:
    organ = trace_organ(stack_of(write_stack, septum_scenes(cover, [0, 0, 0, 1, 1, 1])))
    assert organ.problems == {}
    for section in organ.sections:
        assert section.carried == (section.index > 2)
        # Where an edge is carried it may lie a pixel off.
        assert rms(circle_errors(section.outer, 24.0)) < (1.0 if section.carried else EDGE_PX)
    assert organ.notes[-1].endswith("the edge is carried on from the image before: 3-5")


def test_what_a_level_closes_after_a_carried_edge_must_be_the_same_thing(
    cover: Cover, write_stack: WriteStack
) -> None:
    organ = trace_organ(stack_of(write_stack, septum_scenes(cover, [0, 0, 1, 1, 2, 2, 0])))
    for section in organ.sections:
        assert rms(circle_errors(section.outer, 24.0)) < 1.0
    assert {0, 1, 2, 3, 6} <= {section.index for section in organ.sections}


def test_a_seed_means_its_own_image_only(cover: Cover, write_stack: WriteStack) -> None:
    # At the seed's place there is something, but not in the seed's image.
    disc = drawn(cover(SHAPE, CENTRE, (14.0, 14.0)))
    empty = np.full(SHAPE, 60, dtype=np.uint8)
    organ = trace_organ(
        stack_of(write_stack, [disc, empty, disc]),
        TraceOptions(seed=(*CENTRE, 1), polarity="bright"),
    )
    assert organ.sections == ()
    reason = f"nothing stands out at the seed ({CENTRE[0]:g}, {CENTRE[1]:g})"
    assert organ.problems == dict.fromkeys(range(3), reason)


def test_a_ring_that_opens_is_named(cover: Cover, write_stack: WriteStack) -> None:
    ring = cover(SHAPE, CENTRE, (35.0, 35.0)) - cover(SHAPE, CENTRE, (25.0, 25.0))
    horseshoe = ring.copy()
    horseshoe[50:, 44:66] = 0.0
    images = [drawn(shape) for shape in (ring, ring, ring, horseshoe, horseshoe)]
    organ = trace_organ(stack_of(write_stack, images), TraceOptions(seed=(54, 20)))
    assert all(section.lumen is not None for section in organ.sections)
    assert organ.problems == dict.fromkeys(
        (3, 4), "the wall is open, which closes a lumen in slice_2.png"
    )


def test_what_vanishes_is_named_and_found_again(cover: Cover, write_stack: WriteStack) -> None:
    disc = drawn(cover(SHAPE, CENTRE, (24.0, 24.0)))
    elsewhere = drawn(cover(SHAPE, (15.0, 15.0), (9.0, 9.0)))
    empty = np.full_like(disc, 60)
    organ = trace_organ(
        stack_of(write_stack, [disc, disc, empty, elsewhere, disc]), TraceOptions(seed=CENTRE)
    )
    assert [section.index for section in organ.sections] == [0, 1, 4]
    assert organ.problems[2] == "nothing stands out from the image's background"
    assert "slice_1.png" in organ.problems[3] or "nothing stands out" in organ.problems[3]


def test_the_border_is_named(cover: Cover, write_stack: WriteStack) -> None:
    images = [drawn(cover(SHAPE, (54.5, y), (20.0, 20.0))) for y in (49.5, 38.0, 26.0, 15.0)]
    organ = trace_organ(stack_of(write_stack, images))
    assert [section.index for section in organ.sections] == [0, 1, 2]
    assert organ.problems == {3: "the organ touches the image's border"}


def test_nothing_at_the_seed_is_named_for_every_slice(
    cover: Cover, write_stack: WriteStack
) -> None:
    empty = np.full(SHAPE, 60, dtype=np.uint8)
    organ = trace_organ(stack_of(write_stack, [empty] * 3), TraceOptions(seed=(20, 30)))
    assert organ.sections == ()
    assert organ.problems == dict.fromkeys(range(3), "nothing stands out at the seed (20, 30)")


def test_a_hole_in_one_slice_is_no_lumen(cover: Cover, write_stack: WriteStack) -> None:
    disc = cover(SHAPE, CENTRE, (30.0, 30.0))
    holed = disc - cover(SHAPE, CENTRE, (12.0, 12.0))
    images = [drawn(shape) for shape in (disc, disc, holed, disc, disc, disc)]
    organ = trace_organ(stack_of(write_stack, images))
    assert all(section.lumen is None for section in organ.sections)
    assert organ.notes[-1] == "a hole that no image nearby shows is no lumen: 2"


def test_anisotropic_pixels_blur_alike_in_all_directions(
    cover: Cover, write_stack: WriteStack
) -> None:
    # A small circle of 2.4 mm seen with pixels 0.3 mm wide and 0.1 mm high.
    images = [drawn(cover(SHAPE, CENTRE, (8.0, 24.0)))] * 3
    stack = stack_of(write_stack, images, pixel_spacing_mm=[0.1, 0.3])
    for section in trace_organ(stack).sections:
        away = np.hypot(*((section.outer - CENTRE) * [0.3, 0.1]).T) - 2.4
        assert rms(away) < EDGE_PX * 0.1 * np.sqrt(3.0)


def test_the_result_does_not_depend_on_the_threads(cover: Cover, write_stack: WriteStack) -> None:
    rng = np.random.default_rng(3)
    images = [
        np.clip(
            drawn(cover(SHAPE, (54.5 + index % 5, 49.5), (20.0 + index % 3, 18.0)))
            + rng.normal(0.0, 8.0, SHAPE),
            0,
            255,
        ).astype(np.uint8)
        for index in range(24)
    ]
    images[7] = np.full(SHAPE, 60, dtype=np.uint8)
    stack = stack_of(write_stack, images)
    one = trace_organ(stack, workers=1)
    assert_same(one, trace_organ(stack, workers=5))
    assert_same(one, trace_organ(stack))


def test_few_images_are_held_at_a_time(
    cover: Cover, write_stack: WriteStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    images = [drawn(cover(SHAPE, CENTRE, (20.0, 20.0)))] * 40
    stack = stack_of(write_stack, images)
    begun: list[int] = []
    read = ImageStack.image

    def counted(self: ImageStack, index: int) -> Any:
        begun.append(index)
        return read(self, index)

    monkeypatch.setattr(ImageStack, "image", counted)
    most = 0

    def progress(done: int, total: int) -> None:
        nonlocal most
        assert total == 40
        most = max(most, len(begun) - 9 - done)

    trace_organ(stack, progress=progress, workers=2)
    # Besides nine to begin with, no more than the reading ahead: twice the threads, and one.
    assert len(begun) == 40 + 9
    assert most <= 5


def test_progress_counts_every_slice(cover: Cover, write_stack: WriteStack) -> None:
    calls: list[tuple[int, int]] = []
    images = [drawn(cover(SHAPE, CENTRE, (20.0, 20.0)))] * 4
    stack = stack_of(write_stack, images)
    trace_organ(stack, progress=lambda done, total: calls.append((done, total)))
    assert calls == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_an_unreadable_image_is_refused(cover: Cover, write_stack: WriteStack) -> None:
    stack = stack_of(write_stack, [drawn(cover(SHAPE, CENTRE, (20.0, 20.0)))] * 4)
    (stack.source / stack.names[2]).write_bytes(b"no image")
    with pytest.raises(ImageStackError, match=r"slice_2.png cannot be read"):
        trace_organ(stack)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"polarity": "grey"}, "polarity must be auto, bright or dark, not 'grey'"),
        ({"method": "sobel"}, "method must be half-level or canny, not 'sobel'"),
        ({"threshold": np.nan}, "threshold must be a grey level, not nan"),
        ({"seed": (110, 5)}, "seed must be a point x, y of the first image, from 0, 0 to 109, 99"),
        ({"seed": (5, np.nan, 1)}, "seed must be a point x, y of image 1, from 0, 0 to 109, 99"),
        ({"seed": (5, 5, 2)}, "the seed's image must be one of 2, from 0 to 1, not 2"),
        ({"seed": (5, 5, -1)}, "the seed's image must be one of 2, from 0 to 1, not -1"),
    ],
)
def test_a_wrong_option_is_refused(
    cover: Cover, write_stack: WriteStack, options: dict[str, Any], message: str
) -> None:
    stack = stack_of(write_stack, [drawn(cover(SHAPE, CENTRE, (20.0, 20.0)))] * 2)
    with pytest.raises(ValueError, match=message):
        trace_organ(stack, TraceOptions(**options))


def test_no_threads_are_refused(cover: Cover, write_stack: WriteStack) -> None:
    stack = stack_of(write_stack, [drawn(cover(SHAPE, CENTRE, (20.0, 20.0)))] * 2)
    with pytest.raises(ValueError, match="workers must be 1 thread or more, not 0"):
        trace_organ(stack, workers=0)


def test_ranges_of_slices() -> None:
    assert slice_ranges([]) == ""
    assert slice_ranges([1, 2, 3, 7, 9, 10]) == "1-3, 7, 9-10"


def test_the_noisy_phantom_has_the_edge_it_was_drawn_with() -> None:
    organ = trace_organ(read_image_stack(BILE_DUCT_PHANTOM))
    assert organ.problems == {}
    axes = outer_half_axes(SLICE_SPACING * np.arange(SECTION_COUNT)) / PIXEL_SPACING
    angles = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    errors = [
        rms(
            polygon_distances(
                section.outer,
                47.5 + axes[section.index] * np.stack([np.cos(angles), np.sin(angles)], 1),
            )
        )
        for section in organ.sections
    ]
    # Noise of a tenth of the contrast, and mottle, move single points by a third of a pixel, but
    # hardly the size.
    assert max(errors) < 0.45
    assert np.mean(errors) < 0.35
    sizes = [
        enclosed_area(section.outer) / axes[section.index].prod() for section in organ.sections
    ]
    assert np.sqrt(np.mean(sizes) / np.pi) == pytest.approx(1.0, abs=0.1 / 35.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "least", "largest_px"),
    [
        # From above, blood and thrombus are brighter than what is around them, until the thrombus
        # of the dissection is as grey as muscle: there the aorta is given up, and that is said.
        ((62, 89, 129), 50, 3.0),
        ((66, 100, 100), 50, 3.0),
        # From below, half of the aorta is such thrombus; the edge follows what is brighter.
        ((48, 76, 0), 60, 4.7),
        ((46, 79, 20), 60, 4.7),
    ],
)
def test_a_grey_aorta_is_found_where_its_masks_are_or_given_up(
    data_dir: Path, seed: tuple[float, float, int], least: int, largest_px: float
) -> None:
    masks = trace_organ(read_image_stack(data_dir / "aorta_ct" / "masks"))
    truth = {section.index: section.outer for section in masks.sections}
    organ = trace_organ(read_image_stack(data_dir / "aorta_ct" / "images"), TraceOptions(seed=seed))
    errors = {
        section.index: rms(polygon_distances(section.outer, truth[section.index]))
        for section in organ.sections
    }
    assert len(errors) + len(organ.problems) == 130
    assert len(errors) >= least
    assert max(errors.values()) < largest_px
    near = [errors[index] for index in range(93, 129) if index in errors]
    if seed[2] >= 100:
        # There every level agrees with the masks to a pixel.
        assert len(near) == 36
        assert sum(error < 1.0 for error in near) >= 24
        assert np.median(near) < 1.0
    assert all(len(reason) < 160 for reason in organ.problems.values())
