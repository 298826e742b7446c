"""Refined integers: what is predicted of them happens, and they lower the cost."""

import dataclasses

import numpy as np
import pytest
from contours import RADIUS, bent_tube, cylinder
from hypothesis import given, settings
from hypothesis import strategies as st

from organ_geometry.contours.contour import SectionContour
from organ_geometry.encoder.candidate import CandidateEncoder, Encoding
from organ_geometry.encoder.coordinate_descent import (
    ANYWHERE,
    Coordinates,
    Residuals,
    dense_bands,
    descend,
    penalty_row,
    zero_groups,
)
from organ_geometry.encoder.costs import PenaltyController, total_bits, total_penalty
from organ_geometry.encoder.refinement import Refinement
from organ_geometry.encoder.search import Search
from organ_geometry.encoder.section_encoder import KeySections, nearest_differences
from organ_geometry.encoder.settings import FULL, QUICK, EncoderSettings, Penalty
from organ_geometry.organ_file.key_order import differences_to_values
from organ_geometry.organ_file.organ_code import signal_steps


def candidates_of(
    contours: list[SectionContour], fraction: float, effort: EncoderSettings = QUICK
) -> CandidateEncoder:
    return CandidateEncoder(
        contours, fraction * RADIUS, None, effort, hollow=False, left_handed=False, units="mm"
    )


def kinked(kink: float) -> list[SectionContour]:
    """A cylinder that widens from a place on."""
    found = []
    for place, one in enumerate(cylinder(sections=65)):
        middle = one.outer.mean(axis=0)
        size = 1.0 + 0.5 * max(0.0, place / 64 - kink)
        found.append(dataclasses.replace(one, outer=middle + size * (one.outer - middle)))
    return found


@pytest.fixture(scope="module")
def kept() -> tuple[CandidateEncoder, Encoding]:
    candidates = candidates_of(bent_tube(), 0.02)
    return candidates, Search(candidates).fewest_bytes()


def test_what_numbers_will_give_is_predicted(kept: tuple[CandidateEncoder, Encoding]) -> None:
    candidates, one = kept
    coarse = candidates.encode(one.sampling, 1.0, 0.5, 0)[0]
    descent = Refinement(
        one.sampling.jacobian(), coarse.sections, signal_steps(coarse.code.section_step),
        candidates.limits, coarse.rms, QUICK.penalty, QUICK,
    )  # fmt: skip
    again = candidates.evaluate(one.sampling, coarse.code.section_scale, descent.refined())
    assert again is not None
    assert again.worst == pytest.approx(np.sqrt(descent._state.errors.max()), rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("places", [(16, 48), (28, 46, 56)])
def test_key_sections_move_to_where_they_keep_the_organ(places: tuple[int, ...]) -> None:
    candidates = candidates_of(kinked(40 / 64), 0.01)
    sampling = Search(candidates).fewest_bytes().sampling
    keys = np.array([0, *places, 64], dtype=np.intp) * sampling.candidates // 64
    first = candidates.encode(sampling, 0.5, 0.02, 0, keys=keys)[0]
    stay, moved = (candidates.refine(first, 6, move_keys=move)[-1] for move in (False, True))
    assert stay.worst > 1.2
    assert moved.worst <= 1.0


@settings(deadline=None, max_examples=100)
@given(st.data())
def test_differences_are_found_again_from_their_values(data: st.DataObject) -> None:
    inner = data.draw(st.sets(st.integers(1, 63), max_size=20))
    keys = np.array([0, *sorted(inner), 64], dtype=np.intp)
    stored = np.array(
        data.draw(
            st.lists(
                st.lists(st.integers(-50, 50), min_size=2, max_size=2),
                min_size=len(keys),
                max_size=len(keys),
            )
        )
    )
    values = differences_to_values(keys) @ stored
    assert np.array_equal(nearest_differences(values, keys), stored)


def test_the_price_of_all_errors_closes_in_on_where_they_are_just_kept() -> None:
    controller = PenaltyController(QUICK.penalty, together=True)
    right = 7.0
    for _ in range(20):
        controller.learn(0.5, (right / controller.penalty.slope) ** 0.1)
        if controller.settled:
            break
    assert controller.settled
    assert controller.penalty.slope == pytest.approx(right, rel=0.05)


def test_slices_beyond_their_limits_cost_more_and_sooner() -> None:
    controller = PenaltyController(QUICK.penalty)
    controller.learn(0.99, 1.0)
    assert controller.penalty == QUICK.penalty
    controller.learn(1.05, 1.0)
    assert controller.penalty.wall == 2.0 * QUICK.penalty.wall
    assert controller.penalty.margin == pytest.approx(QUICK.penalty.margin - (1.05**2 - 1.0))
    assert controller.penalty.slope == QUICK.penalty.slope


@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 2**32 - 1), wall=st.sampled_from([0.0, 30.0, 300.0]))
def test_a_descent_ends_where_no_integer_alone_is_better(seed: int, wall: float) -> None:
    # Any rows, weights and tables: J, taken anew from the integers, is least along each of them.
    rng = np.random.default_rng(seed)
    points, size, slices = 60, 6, 5
    columns = rng.normal(size=(points, size)) * (rng.random((points, size)) < 0.5)
    target = rng.normal(0.0, 3.0, points)
    section = np.sort(rng.integers(0, slices, points)).astype(np.intp)
    weights = rng.uniform(0.01, 0.1, points)
    bits = np.sort(rng.uniform(0.0, 12.0, (size, 13)), axis=1)
    penalty = Penalty(1.0, wall, 0.9)

    def errors(integers: np.ndarray) -> np.ndarray:
        rest = columns @ integers - target
        return np.bincount(section, weights * rest * rest, slices)

    def cost(integers: np.ndarray) -> float:
        return total_bits(bits, integers) + total_penalty(penalty, errors(integers))

    integers = rng.integers(-3, 4, size)
    before = cost(integers)
    state = Residuals(section, weights, columns @ integers - target, errors(integers))
    coordinates = Coordinates(
        np.arange(size), np.zeros(size, dtype=np.intp), np.ones(size),
        bits,
    )  # fmt: skip
    bands, ones, row = dense_bands(columns), np.ones((1, points)), penalty_row(penalty)
    everything = np.array([[0, size]])
    descend(integers, coordinates, bands, ones, state, row, everything, ANYWHERE, 200)
    after = cost(integers)
    assert after <= before + 1e-9
    np.testing.assert_allclose(state.errors, errors(integers), atol=1e-9)
    np.testing.assert_allclose(state.residuals, columns @ integers - target, atol=1e-9)
    for i in range(size):
        for change in (-1, 1, -integers[i]):
            other = integers.copy()
            other[i] += change
            assert cost(other) >= after - 1e-6
    # A group goes only where that lowers J, its own bits saved.
    groups = np.array([[2, 3]])
    kept, used = integers.copy(), integers[2]
    kept[2] = 0
    own = float(rng.uniform(0.0, 20.0))
    zeroed = zero_groups(integers, coordinates, bands, ones, state, row, groups, own)
    assert (integers == kept).all() if zeroed else cost(kept) > after + own - 1e-6 or used == 0
    np.testing.assert_allclose(state.errors, errors(integers), atol=1e-9)


@pytest.mark.slow
def test_all_sections_together_fill_what_they_may_be_off() -> None:
    contours = kinked(0.4)
    for fraction in (0.01, 0.02):
        candidates = CandidateEncoder(
            contours,
            0.06 * RADIUS,
            fraction * RADIUS,
            FULL,
            hollow=False,
            left_handed=False,
            units="mm",
        )
        found = Search(candidates).fewest_bytes()
        assert found.overall <= fraction * RADIUS
        assert found.worst <= 1.0


def test_numbers_are_not_changed_in_place(kept: tuple[CandidateEncoder, Encoding]) -> None:
    candidates, one = kept
    stored = one.sections.stored.copy()
    candidates.refine(one, 2, move_keys=True)
    assert np.array_equal(one.sections.stored, stored)
    assert isinstance(one.sections, KeySections)
