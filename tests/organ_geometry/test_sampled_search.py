"""Long stacks are searched by some sections, and every section is kept to all the same."""

import numpy as np
import pytest
from contours import RADIUS, bent_tube, cylinder
from hypothesis import given, settings
from hypothesis import strategies as st

from organ_geometry.contours.contour import SectionContour
from organ_geometry.encoder.candidate import CandidateEncoder
from organ_geometry.encoder.encode import EncodedOrgan, ToleranceTooSmall, encoded_organ
from organ_geometry.encoder.search import SampledSearch, Search
from organ_geometry.encoder.settings import QUICK, sample_settings
from organ_geometry.organ_file import organ_from_bytes
from organ_geometry.surface_distance import root_mean_squares, section_distances

TOLERANCE = 0.02 * RADIUS
LONG = 240


def wavy_tube(sections: int = LONG, lumen: bool = False) -> list[SectionContour]:
    """A bent tube that is narrow and wide in turn, with points of noise."""
    rng = np.random.default_rng(11)
    contours = bent_tube(sections=sections, lumen=0.6 if lumen else None)
    return [
        swollen(contour, 1.0 + 0.1 * np.sin(0.06 * contour.index), rng.normal(0.0, 0.01, (120, 3)))
        for contour in contours
    ]


def swollen(
    contour: SectionContour, factor: float, noise: np.ndarray | float = 0.0
) -> SectionContour:
    """A section larger by a factor about its middle."""
    middle = contour.outer.mean(axis=0)
    rings = [
        None if ring is None else middle + factor * (ring - middle) + noise
        for ring in (contour.outer, contour.lumen)
    ]
    assert rings[0] is not None
    return SectionContour(contour.index, rings[0], rings[1], contour.normal, contour.x_dir)


def candidates_at(contours: list[SectionContour], hollow: bool = False) -> CandidateEncoder:
    return CandidateEncoder(
        contours, TOLERANCE, None, QUICK, hollow=hollow, left_handed=False, units="mm"
    )


def largest_rms(encoded: EncodedOrgan, contours: list[SectionContour]) -> float:
    organ = organ_from_bytes(encoded.organ.encoded)
    return float(root_mean_squares(section_distances(organ, contours, encoded.places)).max())


@pytest.mark.slow
@pytest.mark.parametrize("hollow", [False, True])
def test_a_section_that_the_sample_misses_is_kept_too(hollow: bool) -> None:
    contours = wavy_tube(lumen=hollow)
    candidates = candidates_at(contours, hollow)
    chosen = np.linspace(0, LONG - 1, QUICK.sample + 1).round().astype(np.intp)
    by_some = Search(candidates.subset(chosen, sample_settings(QUICK)), sampled=True).fewest_bytes()
    odd = 121
    assert odd not in chosen
    contours[odd] = swollen(contours[odd], 1.03)
    one = candidates_at(contours, hollow).evaluate_on_all(by_some)
    assert one is not None
    # What was found by the sample does not keep it: keeping it is the search's own doing.
    assert one.rms[odd] > 1.2 * TOLERANCE
    encoded = encoded_organ(contours, TOLERANCE, hollow=hollow)
    assert largest_rms(encoded, contours) <= encoded.organ.tolerance_mm <= TOLERANCE


@pytest.mark.slow
@settings(max_examples=4, deadline=None, derandomize=True)
@given(
    odd=st.lists(st.integers(0, LONG - 1), min_size=1, max_size=4, unique=True),
    factor=st.floats(0.96, 1.04),
)
def test_sections_unlike_their_neighbours_are_kept_or_refused(
    odd: list[int], factor: float
) -> None:
    contours = wavy_tube()
    for number in odd:
        contours[number] = swollen(contours[number], factor)
    tolerance = TOLERANCE
    try:
        encoded = encoded_organ(contours, tolerance)
    except ToleranceTooSmall as refused:
        tolerance = 1.1 * refused.smallest_mm
        encoded = encoded_organ(contours, tolerance)
    assert largest_rms(encoded, contours) <= encoded.organ.tolerance_mm <= tolerance


@pytest.mark.slow
def test_samples_take_few_bytes_more_than_a_search_by_all_sections() -> None:
    contours = wavy_tube()
    by_samples = SampledSearch(candidates_at(contours)).fewest_bytes()
    by_all = Search(candidates_at(contours)).fewest_bytes()
    assert by_samples.worst <= 1.0
    assert len(by_samples.data) <= 1.1 * len(by_all.data)
    # Sections of noise taken as shape would take many more keys.
    assert len(by_samples.code.keys) <= 1.5 * len(by_all.code.keys)


def test_a_sampled_search_gives_the_same_bytes_again() -> None:
    first, second = (encoded_organ(wavy_tube(), TOLERANCE).organ.encoded for _ in range(2))
    assert first == second


def test_numbers_of_some_sections_are_measured_by_all_as_a_reader_finds_them() -> None:
    contours = wavy_tube()
    candidates = candidates_at(contours)
    some = np.arange(0, LONG, 6, dtype=np.intp)
    some[-1] = LONG - 1
    one = candidates.evaluate_on_all(Search(candidates.subset(some, QUICK)).fewest_bytes())
    assert one is not None
    organ = organ_from_bytes(one.data)
    away = root_mean_squares(section_distances(organ, contours, one.sampling.places))
    # A reader's stations are chords of the axis, which differ by a hundred-thousandth of a piece.
    np.testing.assert_allclose(one.rms, away, rtol=1e-4)
    assert len(one.sampling.outlines.outer) > LONG


@pytest.mark.slow
@pytest.mark.parametrize("fraction", [0.0005, pytest.param(0.001, marks=pytest.mark.long)])
def test_a_tolerance_out_of_reach_names_the_smallest_of_a_long_stack_too(fraction: float) -> None:
    contours = cylinder(sections=QUICK.many_sections)
    with pytest.raises(ToleranceTooSmall, match="cannot be kept by two degree-6 curves") as raised:
        encoded_organ(contours, fraction * RADIUS)
    smallest = raised.value.smallest_mm
    assert 0.003 * RADIUS < smallest < 0.005 * RADIUS
    encoded = encoded_organ(contours, 1.02 * smallest)
    assert largest_rms(encoded, contours) <= encoded.organ.tolerance_mm


@pytest.mark.slow
def test_all_sections_together_are_kept_to_what_they_may_in_a_long_stack() -> None:
    contours = wavy_tube()
    encoded = encoded_organ(contours, 2.0 * TOLERANCE, overall=0.6 * TOLERANCE)
    away = np.concatenate(section_distances(encoded.organ, contours, encoded.places))
    assert np.sqrt(np.mean(away**2)) <= 0.6 * TOLERANCE


def test_points_of_some_slices_are_those_that_they_have_among_all() -> None:
    contours = wavy_tube(sections=24, lumen=True)
    points = candidates_at(contours, True).sample(2, 56, 4).jacobian()
    chosen = np.array([0, 3, 4, 23], dtype=np.intp)
    some = points.of_slices(chosen)
    for place, number in enumerate(chosen):
        here, there = some.slices == place, points.slices == number
        for one, other in ((some, points), (some.points, points.points)):
            for field in ("weights", "lumen", "at", "place", "piece", "fraction"):
                if hasattr(one, field):
                    np.testing.assert_array_equal(
                        getattr(one, field)[here], getattr(other, field)[there]
                    )
    assert (np.diff(some.slices) >= 0).all()
