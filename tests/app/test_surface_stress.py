"""Stress on the surface: the beam's, at every vertex, with its sign."""

import numpy as np
import pytest
from numpy.typing import NDArray
from simulated import phantom, pull, pull_session, settle, tear

from app.simulation import Phase, Session, Stresses, SurfaceStress, preset_named
from app.simulation.specimen.drawn_duct import fibre_fractions
from app.trainer.panel.compare_tab import OFFERED_THEORIES
from organ_geometry.mesh.skin import organ_skin
from organ_geometry.organ import Organ
from physics import Equilibrium


def stress(session: Session, surface: int = 0) -> NDArray[np.float32]:
    out = np.full(len(session.drawn.surfaces[surface].vertices), np.nan, dtype=np.float32)
    assert session.stress(out, surface) is out
    return out


def heights(session: Session) -> NDArray[np.float64]:
    """Heights of the skin's vertices above the axis, along the pull."""
    surface = session.drawn.surfaces[0]
    away = surface.skin.vertices - session.tissue.dissection.organ.axis_at(surface.skin.stations)
    return away @ session.tissue.dissection.frame[:, 2]


def test_there_is_none_at_rest() -> None:
    assert np.all(stress(pull_session(phantom(), vertices=1200)) == 0.0)


@pytest.mark.parametrize("preset", ["thesis-bile-duct", "porcine-bile-duct"])
@pytest.mark.parametrize("label", list(OFFERED_THEORIES))
@pytest.mark.parametrize("fraction", [0.4, 0.5, 0.25])
def test_the_highest_on_the_skin_is_what_the_criterion_is_held_against(
    preset: str, label: str, fraction: float
) -> None:
    session = pull_session(phantom(), preset_named(preset), vertices=10000)
    session.choose_theory(OFFERED_THEORIES[label])
    session.set_grasp(fraction * session.tissue.dissection.beam.span)
    session.advance()
    event = session.reading().breaks_at
    assert event is not None
    pull(session, 0.7 * event.force)
    check = session.reading().check
    found = stress(session)
    # Off by half a ring of the skin along the beam, and by what its vertices miss of the outline.
    assert found.max() == pytest.approx(check.total_stress, rel=0.01)
    assert found.max() <= check.total_stress * (1.0 + 1e-6)


def test_a_straight_round_bar_has_the_closed_form_s_stresses_with_their_signs() -> None:
    """sigma = N/A - M z/I: the pulled side is stretched at the grasp and squeezed at the clamps."""
    session = pull_session(phantom(), vertices=10000)
    pull(session, 1.0)
    beam, skin = session.tissue.dissection.beam, session.drawn.surfaces[0].skin
    found, z = stress(session), heights(session)
    places = skin.stations - session.tissue.dissection.clamps[0]
    fractions = fibre_fractions(phantom(), skin, session.tissue.dissection.frame[:, 2])
    inside = (places >= -0.5) & (places <= beam.span + 0.5)
    solved = (
        session.planar.theory.pull(beam, 25.4).to_force(1.0).sample(np.clip(places, 0.0, beam.span))
    )
    whole = (
        solved.normal_force / beam.area
        - solved.moment * fractions * beam.fibre_distance / beam.second_moment
    )
    near = np.isclose(found, whole, rtol=2e-3, atol=2e-3 * whole.max())
    assert near[inside].all()
    assert np.all(found[~inside] == 0.0)
    top, bottom = fractions > 0.9, fractions < -0.9
    middle, end = np.abs(places - 25.4) < 1.5, inside & (places < 1.5)
    assert found[top & middle].min() > found[bottom & middle].max()
    assert found[top & end].max() < 0.0 < found[bottom & end].min()
    assert np.corrcoef(fractions, z)[0, 1] > 0.99
    # Halfway between clamp and grasp nothing bends: all of the section has the normal stress.
    turn = np.abs(places - 12.7) < 0.3
    assert found[turn] == pytest.approx(
        float(solved.normal_stress.mean()), abs=0.1 * float(found.max())
    )


def test_shares_of_an_organ_s_fibres_reach_the_outline_on_both_sides_of_a_round_one() -> None:
    organ = phantom()
    skin = organ_skin(organ, edge_length=0.5)
    fractions = fibre_fractions(organ, skin, np.array([0.0, 0.0, 1.0]))
    assert fractions.max() == pytest.approx(1.0, abs=0.01)
    assert fractions.min() == pytest.approx(-1.0, abs=0.05)
    assert fibre_fractions(organ, skin, np.array([0.0, 0.0, -1.0])) == pytest.approx(-fractions)


def test_stress_turns_with_the_organ() -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    organ = phantom()
    turned = Organ(organ.axis @ turn.T, turn @ organ.frames, organ.keys, organ.outer, organ.lumen)
    found = []
    for each in (organ, turned):
        session = pull_session(each, preset_named("thesis-bile-duct"), vertices=1200)
        pull(session, 1.0)
        found.append(stress(session))
    assert found[1] == pytest.approx(found[0], abs=1e-6)


def test_pieces_carry_less_and_less_and_nothing_in_the_end() -> None:
    session = pull_session(phantom(), vertices=1200)
    session.set_target_force(session.planar.force_limit)
    while session.reading().phase is Phase.INTACT:
        session.advance()
    check = session.reading().check
    peaks = []
    while session.reading().phase is Phase.TEARING:
        peaks.append(max(stress(session, 0).max(), stress(session, 1).max()))
        session.advance()
    assert peaks[0] == pytest.approx(check.total_stress, rel=0.1)
    assert np.all(np.diff(peaks) < 0.0)
    settle(session)
    assert np.all(stress(session, 0) == 0.0)
    session.reset()
    tear(session)
    assert np.all(stress(session, 1) == 0.0)


def test_a_part_of_it_is_that_part_and_places_are_kept_between_calls() -> None:
    session = pull_session(phantom(), vertices=1200)
    dissection, skin = session.tissue.dissection, session.drawn.surfaces[0].skin
    solved: Equilibrium = (
        session.planar.theory.pull(dissection.beam, 25.4)
        .to_force(1.0)
        .sample(np.linspace(0.0, 50.8, 33))
    )
    surface, out = SurfaceStress(dissection, skin), np.empty(len(skin.vertices), np.float32)
    whole = surface.write(solved, out).copy()
    assert surface.write(solved, out, scale=0.5) == pytest.approx(0.5 * whole)
    shuffled = (
        session.planar.theory.pull(dissection.beam, 25.4)
        .to_force(1.0)
        .sample(np.linspace(0.0, 50.8, 33)[::-1].copy())
    )
    assert surface.write(shuffled, out) == pytest.approx(whole, abs=1e-9)


def test_parts_of_the_stress_add_up_and_say_how_far_the_break_is() -> None:
    session = pull_session(phantom(), vertices=1200)
    dissection, skin = session.tissue.dissection, session.drawn.surfaces[0].skin
    solved = (
        session.planar.theory.pull(dissection.beam, 25.4)
        .to_force(1.0)
        .sample(np.linspace(0.0, 50.8, 33))
    )
    surface, out = SurfaceStress(dissection, skin), np.empty(len(skin.vertices), np.float32)
    stresses = surface.at(solved, threshold=0.2)
    assert stresses.total == pytest.approx(surface.write(solved, out), abs=1e-7)
    assert stresses.total == pytest.approx(stresses.normal + stresses.bending)
    assert stresses.distance_to_break == pytest.approx(1.0 - stresses.total / 0.2, abs=1e-6)
    held = stresses.normal > 0.0
    assert stresses.normal[held] == pytest.approx(float(solved.normal_stress[0]))
    fractions = fibre_fractions(dissection.organ, skin, dissection.frame[:, 2])
    assert np.abs(stresses.bending[np.abs(fractions) < 1e-9]).max(initial=0.0) < 1e-9
    resting = Stresses.none(5)
    assert not resting.total.any()
    assert (resting.distance_to_break == 1.0).all()
