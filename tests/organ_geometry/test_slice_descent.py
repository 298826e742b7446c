"""Numbers chosen for few bits: what is foreseen of them happens, and they lower the cost."""

import dataclasses

import numpy as np
import pytest
from contours import RADIUS, bent_tube, cylinder
from hypothesis import given, settings
from hypothesis import strategies as st

from organ_geometry.contours.contour import SectionContour
from organ_geometry.encoder.candidate import KeptCode, OrganAttempts
from organ_geometry.encoder.coordinate_descent import SliceDescent
from organ_geometry.encoder.jacobian import EdgePoints
from organ_geometry.encoder.key_lattice import nearest_differences
from organ_geometry.encoder.penalties import EACH_SLICE, Aiming
from organ_geometry.encoder.search import EncoderSearch
from organ_geometry.encoder.section_encoder import CodedSections
from organ_geometry.organ_file.key_order import differences_to_values
from organ_geometry.organ_file.organ_code import signal_steps


def attempts_of(contours: list[SectionContour], share: float) -> OrganAttempts:
    return OrganAttempts(
        contours, share * RADIUS, None, hollow=False, left_handed=False, units="mm"
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
def kept() -> tuple[OrganAttempts, KeptCode]:
    attempts = attempts_of(bent_tube(), 0.02)
    return attempts, EncoderSearch(attempts).in_fewest_bytes()


@pytest.mark.parametrize("way", [1, 2])
def test_an_axis_s_bend_moves_edges_as_foreseen(
    kept: tuple[OrganAttempts, KeptCode], way: int
) -> None:
    attempts, one = kept
    middle = len(one.code.bends) // 2
    steps = signal_steps(one.code.section_step)
    stored = one.numbers.sections.stored

    def away(change: int) -> tuple[np.ndarray, np.ndarray]:
        bends = one.code.bends.copy()
        bends[middle, way] += change
        cut = attempts._cut_by(one.cut.axis.bent(bends), one.cut.depth, one.cut.turn)
        # Against a circle far inside, distances are not turned over where they pass zero.
        smaller = stored.copy()
        smaller[0, 0, 0] //= 2
        return EdgePoints.of(cut).distances(one.code.keys, smaller, steps)

    before, changes = away(0)
    after, _ = away(1)
    bent = EdgePoints.of(one.cut).bent(changes[0])
    row = 3 * middle + way
    foreseen = np.zeros(len(before))
    here = slice(bent.first[row], bent.last[row])
    foreseen[here] = bent.weights[bent.start[row] :][: here.stop - here.start]
    assert np.abs(foreseen).max() > 0.3 * one.code.axis_step
    np.testing.assert_allclose(after - before, foreseen, atol=0.05 * one.code.axis_step)


def test_what_numbers_will_give_is_foreseen(kept: tuple[OrganAttempts, KeptCode]) -> None:
    attempts, one = kept
    coarse = attempts.descended(one.cut, 1.0, 0.5, 0)[0]
    descent = SliceDescent(
        EdgePoints.of(one.cut), coarse.numbers, signal_steps(coarse.code.section_step),
        attempts.limits, coarse.rms, EACH_SLICE, free_axis=False,
    )  # fmt: skip
    numbers = descent.lowered()
    again = attempts.measured(one.cut, coarse.code.section_scale, numbers.sections)
    assert again is not None
    assert np.array_equal(numbers.bends, coarse.code.bends)
    assert again.worst == pytest.approx(descent.foreseen, rel=0.1)


@pytest.mark.parametrize("places", [(16, 48), (28, 46, 56)])
def test_key_sections_move_to_where_they_keep_the_organ(places: tuple[int, ...]) -> None:
    attempts = attempts_of(kinked(40 / 64), 0.01)
    cut = EncoderSearch(attempts).in_fewest_bytes().cut
    keys = np.array([0, *places, 64], dtype=np.intp) * cut.candidates // 64
    first = attempts.descended(cut, 0.5, 0.02, 0, keys=keys)[0]
    stay, moved = (attempts.lowered(first, 6, move_keys=move)[-1] for move in (False, True))
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
    aiming = Aiming(EACH_SLICE, together=True)
    right = 7.0
    for _ in range(20):
        aiming.learn(0.5, (right / aiming.aim.everywhere) ** 0.1)
        if aiming.settled:
            break
    assert aiming.settled
    assert aiming.aim.everywhere == pytest.approx(right, rel=0.05)


def test_slices_beyond_their_limits_cost_more_and_sooner() -> None:
    aiming = Aiming(EACH_SLICE)
    aiming.learn(0.99, 1.0)
    assert aiming.aim == EACH_SLICE
    aiming.learn(1.05, 1.0)
    assert aiming.aim.beyond == 2.0 * EACH_SLICE.beyond
    assert aiming.aim.margin == pytest.approx(EACH_SLICE.margin - (1.05**2 - 1.0))
    assert aiming.aim.everywhere == EACH_SLICE.everywhere


def test_all_sections_together_fill_what_they_may_be_off() -> None:
    contours = kinked(0.4)
    for share in (0.01, 0.02):
        attempts = OrganAttempts(
            contours, 0.06 * RADIUS, share * RADIUS, hollow=False, left_handed=False, units="mm"
        )
        found = EncoderSearch(attempts).in_fewest_bytes("full")
        assert found.overall <= share * RADIUS
        assert found.worst <= 1.0


def test_numbers_are_not_changed_in_place(kept: tuple[OrganAttempts, KeptCode]) -> None:
    attempts, one = kept
    stored, bends = one.numbers.sections.stored.copy(), one.code.bends.copy()
    attempts.lowered(one, 2, move_keys=True)
    assert np.array_equal(one.numbers.sections.stored, stored)
    assert np.array_equal(one.code.bends, bends)
    assert isinstance(one.numbers.sections, CodedSections)
