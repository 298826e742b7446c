"""Sessions: they bend by what the beam says, tear where and when it says, and start anew."""

import math
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import phantom, pull, pull_session, settle, tear

from app.simulation import Clock, Phase, Session, preset_named, presets
from app.trainer.panel.compare_tab import OFFERED_THEORIES
from organ_geometry.mesh.tear import SAG
from organ_geometry.organ import Organ
from physics import (
    Beam,
    Cubic,
    NoEquilibrium,
    Pull,
    TautString,
    calibrated_threshold,
    theory_named,
)
from physics.cubic import CubicPull

BREAK = 0.8 * 4.4482216152605
"""The thesis's P = 0.4 lbf on each half, N."""


@pytest.fixture
def session() -> Session:
    return pull_session(phantom(), vertices=1200)


def closed(session: Session) -> list[trimesh.Trimesh]:
    meshes = [
        trimesh.Trimesh(surface.vertices, surface.skin.faces, process=False)
        for surface in session.drawn.surfaces
    ]
    assert all(mesh.is_watertight and mesh.is_winding_consistent for mesh in meshes)
    return meshes


def test_starts_at_rest_with_the_organ_to_the_bit(session: Session) -> None:
    settle(session)
    surface = session.drawn.surfaces[0]
    assert surface.vertices.tobytes() == surface.skin.vertices.tobytes()
    reading = session.reading()
    assert (reading.phase, reading.force, reading.deflection) == (Phase.INTACT, 0.0, 0.0)
    assert reading.check.distance_to_break == 1.0


@pytest.mark.parametrize("label", list(OFFERED_THEORIES))
@pytest.mark.parametrize("grasp", [12.0, 25.4, 33.0])
def test_bends_by_what_the_beam_says(label: str, grasp: float) -> None:
    theory = OFFERED_THEORIES[label]
    session = pull_session(phantom(), vertices=10000)
    session.choose_theory(theory)
    session.set_grasp(grasp)
    pull(session, 1.5)
    solved = (
        theory.pull(session.tissue.dissection.beam, grasp).to_force(1.5).sample(np.array([grasp]))
    )
    expected = solved.deflection
    reading = session.reading()
    assert reading.force == 1.5
    assert reading.deflection == pytest.approx(expected, rel=1e-9)
    assert reading.hook[2] == pytest.approx(expected, abs=0.1)  # the axis's own unevenness
    assert reading.hook[0] == pytest.approx(solved.along[0], abs=0.02)  # it slides with the duct
    # The skin's ring at the grasp has moved by as much, along the pull and no other way.
    surface = session.drawn.surfaces[0]
    away = np.abs(surface.skin.stations - session.tissue.dissection.clamps[0] - grasp)
    moved = (surface.vertices - surface.skin.vertices)[away < away.min() + 1e-6].mean(axis=0)
    frame = session.tissue.dissection.frame
    assert moved @ frame[:, 2] == pytest.approx(expected, rel=0.03)  # half a ring off the grasp
    assert moved @ frame[:, 1] == pytest.approx(0.0, abs=1e-5)
    closed(session)


def test_default_duct_bears_the_force_below_the_thesis_s_break_and_tears_at_it() -> None:
    session = pull_session(phantom(), vertices=1200)
    pull(session, 3.55)
    assert session.reading().phase is Phase.INTACT
    assert session.reading().check.distance_to_break == pytest.approx(0.0, abs=0.005)
    pull(session, 3.56)
    reading = session.reading()
    assert reading.phase is Phase.TORN
    assert reading.breaks_at is not None
    assert reading.breaks_at.force == pytest.approx(BREAK, rel=1e-5)
    assert reading.check.station == pytest.approx(25.4)
    assert reading.check.tension_side == 1


def test_a_jump_past_the_break_tears_at_the_break_not_at_the_jump(session: Session) -> None:
    pull(session, session.planar.force_limit)
    reading = session.reading()
    assert reading.breaks_at is not None
    assert reading.breaks_at.force == pytest.approx(BREAK, rel=1e-5)
    assert reading.deepest == reading.breaks_at.deflection


def test_tear_runs_from_the_stretched_side_through_to_two_pieces_at_rest(
    session: Session,
) -> None:
    session.set_target_force(session.planar.force_limit)
    while session.reading().phase is Phase.INTACT:
        session.advance()
    assert [surface.name for surface in session.drawn.surfaces] == ["first_piece", "second_piece"]
    up = session.tissue.dissection.frame[:, 2]
    along = session.tissue.dissection.frame[:, 0]
    gaps: list[tuple[float, float]] = []
    while session.reading().phase is Phase.TEARING:
        assert session.reading().force == pytest.approx(BREAK, rel=1e-5)  # still pulled
        first, second = session.drawn.surfaces
        rim = first.skin.stations > first.skin.stations.max() - 1.5
        other = second.skin.stations < second.skin.stations.min() + 1.5
        gap = []
        for upper in (True, False):
            ends = []
            for surface, near in ((first, rim), (second, other)):
                height = surface.skin.vertices[near] @ up  # at rest: a free rim also flares
                level = (
                    height > np.quantile(height, 0.9)
                    if upper
                    else height < np.quantile(height, 0.1)
                )
                ends.append((surface.vertices[near][level] @ along).mean())
            gap.append(ends[1] - ends[0])
        gaps.append((gap[0], gap[1]))
        closed(session)
        session.advance()
    opened = np.array(gaps) - gaps[0]
    assert (opened[len(opened) // 2 :, 0] > opened[len(opened) // 2 :, 1]).all()
    assert np.all(np.diff(opened[:, 0]) > 0.0)
    assert session.reading().phase is Phase.TORN
    assert session.reading().force == 0.0

    swung = []
    while session.advance():
        closed(session)
        swung.append((session.drawn.surfaces[0].vertices @ up).max())
    assert np.argmin(swung) < len(swung) - 5  # it swings past rest and comes back
    meshes = closed(session)
    assert meshes[0].bounds[1, 0] < meshes[1].bounds[0, 0]
    torn_at = session.reading().check.station
    hang = SAG * session.tissue.dissection.organ.mean_radius
    for surface in session.drawn.surfaces:  # nothing is left of the pull, and free ends hang down
        behind = np.abs(surface.skin.stations - torn_at) > 7.0  # mm: the rim is flared
        left = (surface.vertices - surface.skin.vertices)[behind] @ up
        assert left.max() == pytest.approx(0.0, abs=0.05)
        assert -hang - 0.05 < left.min() < -0.05


def test_only_reset_brings_a_torn_duct_back(session: Session) -> None:
    tear(session)
    shape = session.drawn.shape
    session.set_target_force(1.0)
    session.set_grasp(10.0)
    session.set_threshold(1.0)
    session.choose_theory(theory_named("string"))
    session.choose_preset("thesis-rubber")
    settle(session)
    assert session.reading().phase is Phase.TORN
    assert session.tissue.dissection.preset.name == "thesis-bile-duct"
    assert session.planar.theory == Cubic()
    assert session.drawn.shape == shape
    session.reset()
    settle(session)
    assert session.reading().phase is Phase.INTACT
    assert session.reading().breaks_at is not None
    surface = session.drawn.surfaces[0]
    assert surface.vertices.tobytes() == surface.skin.vertices.tobytes()
    pull(session, 2.0)
    assert session.reading().phase is Phase.INTACT


def test_lowered_threshold_tears_a_pulled_duct_at_the_force_it_is_under(session: Session) -> None:
    pull(session, 3.0)
    session.set_threshold(0.5 * session.tissue.threshold)
    settle(session)
    event = session.reading().breaks_at
    assert session.reading().phase is Phase.TORN
    assert event is not None
    assert event.force == 3.0


def test_off_centre_pull_tears_at_the_near_clamp(session: Session) -> None:
    session.set_grasp(10.0)
    tear(session)
    assert session.reading().check.station == 0.0
    first, second = closed(session)
    assert first.volume < 0.2 * second.volume  # a stump in the clamp


@given(
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from(["target_force", "grasp", "threshold"]),
)
@settings(deadline=None, max_examples=60)
def test_any_number_from_a_browser_is_clamped_or_ignored(value: float, name: str) -> None:
    session = pull_session(phantom(), vertices=300)
    getattr(session, f"set_{name}")(value)
    settle(session)
    reading = session.reading()
    assert 0.0 <= reading.force <= session.planar.force_limit
    assert session.planar.grasp_range[0] <= session.planar.grasp <= session.planar.grasp_range[1]
    assert (
        session.planar.threshold_range[0]
        <= session.tissue.threshold
        <= session.planar.threshold_range[1]
    )
    assert all(np.isfinite(surface.vertices).all() for surface in session.drawn.surfaces)
    if not math.isfinite(value):
        assert (reading.force, session.planar.grasp) == (0.0, 25.4)


@pytest.mark.parametrize("name", list(presets()))
@pytest.mark.parametrize("label", list(OFFERED_THEORIES))
def test_every_preset_can_be_pulled_to_its_break_by_every_theory(name: str, label: str) -> None:
    session = pull_session(phantom(), preset_named(name), vertices=600)
    session.choose_theory(OFFERED_THEORIES[label])
    event = session.reading().breaks_at
    assert event is not None
    assert event.force < session.planar.force_limit
    tear(session)
    torn = session.reading().breaks_at
    assert torn is not None
    assert torn.force == pytest.approx(event.force, rel=1e-9)


@dataclass(frozen=True)
class Ending:
    """The cubic beam of a law that ends at a deflection, mm."""

    end: float
    name: ClassVar[str] = "ending"
    takes_all_sections: ClassVar[bool] = False

    @property
    def options(self) -> dict[str, object]:
        return {}

    def pull(self, beam: Beam, grasp: float) -> Pull:
        return EndingPull(beam, grasp, self.end)


class EndingPull(CubicPull):
    def __init__(self, beam: Beam, grasp: float, end: float) -> None:
        super().__init__(Cubic(), beam, grasp)
        self.end = end

    def to_force(self, force: float) -> Self:
        return self.to_deflection(Cubic().pull(self.beam, self.grasp).to_force(force).deflection)

    def to_deflection(self, deflection: float) -> Self:
        if deflection > self.end:
            raise NoEquilibrium(f"this law ends at {self.end} mm")
        return super().to_deflection(deflection)


def test_a_pull_stops_where_the_law_ends(session: Session) -> None:
    session.choose_theory(Ending(13.0))
    session.set_threshold(session.planar.threshold_range[1])
    pull(session, session.planar.force_limit)
    reading = session.reading()
    assert reading.breaks_at is None
    assert reading.phase is Phase.INTACT
    assert 12.0 < reading.deflection <= 13.0
    assert session.planar.grasper.slider_force == reading.force
    deflections, forces = session.curve()
    assert len(deflections) == len(forces) > 2
    assert deflections[-1] <= 13.0
    pull(session, 1.0)
    assert session.reading().force == 1.0


def test_a_law_that_ends_before_the_break_is_refused(session: Session) -> None:
    session.set_threshold(0.15)
    pull(session, 1.0)
    before = session.reading()
    with pytest.raises(NoEquilibrium):
        session.choose_theory(Ending(12.0))  # the duct breaks at 12.8 mm
    assert session.planar.theory == Cubic()
    settle(session)
    assert session.reading() == before
    assert session.tissue.threshold == 0.15


def test_a_grasp_that_the_law_cannot_carry_eases_the_pull(session: Session) -> None:
    session.choose_theory(Ending(13.0))
    session.set_threshold(session.planar.threshold_range[1])
    session.set_grasp(8.0)
    pull(session, 3.0)
    session.set_target_force(session.planar.force_limit)
    settle(session)
    force = session.reading().force
    session.set_grasp(25.4)
    settle(session)
    reading = session.reading()
    assert session.planar.grasp == 25.4
    assert 0.0 < reading.force < force
    assert reading.deflection <= 13.0
    assert session.planar.grasper.slider_force == reading.force


def test_a_long_thin_organ_is_drawn_with_coarser_triangles() -> None:
    long = Organ(
        phantom().axis * [60.0, 1.0, 1.0], phantom().frames, phantom().keys, phantom().outer
    )
    session = pull_session(long, vertices=600)
    assert len(session.drawn.surfaces[0].vertices) > 600
    closed(session)


def test_each_theory_has_its_own_threshold_for_the_same_break(session: Session) -> None:
    beam = session.tissue.dissection.beam
    cubic = session.tissue.threshold
    session.choose_theory(theory_named("string"))
    assert session.tissue.threshold == pytest.approx(
        calibrated_threshold(TautString().pull(beam, 25.4), BREAK), rel=1e-6
    )
    assert session.tissue.threshold != pytest.approx(cubic, rel=0.1)
    tear(session)
    event = session.reading().breaks_at
    assert event is not None
    assert event.force == pytest.approx(BREAK, rel=1e-5)


def test_unknown_choices_change_nothing(session: Session) -> None:
    pull(session, 1.0)
    before = session.reading()
    with pytest.raises(ValueError, match="unknown preset"):
        session.choose_preset("no such duct")
    assert session.reading() == before


def test_curve_is_the_theory_s_and_passes_the_break(session: Session) -> None:
    deflections, forces = session.curve()
    expected = [
        Cubic().pull(session.tissue.dissection.beam, 25.4).to_deflection(d).force
        for d in deflections
    ]
    assert forces == pytest.approx(expected)
    event = session.reading().breaks_at
    assert event is not None
    assert deflections[0] == 0.0
    assert deflections[-1] > event.deflection
    session.set_threshold(session.planar.threshold_range[1])
    pull(session, session.planar.force_limit)
    deepest = session.reading().deepest
    session.set_threshold(0.6 * session.tissue.threshold)  # the break is now far behind
    assert session.curve()[0][-1] > deepest


def test_steps_of_any_length_lead_to_the_same_rest() -> None:
    readings = []
    for seconds in (1 / 240, 1 / 30, 0.1):
        session, clock = pull_session(phantom(), vertices=300), Clock()
        session.set_target_force(2.0)
        while session.advance(clock.ticks(seconds)):
            pass
        readings.append(session.reading())
    assert readings[0] == readings[1] == readings[2]


def test_idle_steps_say_so_and_change_nothing(session: Session) -> None:
    pull(session, 1.0)
    vertices = session.drawn.surfaces[0].vertices.copy()
    assert not session.advance()
    assert np.array_equal(session.drawn.surfaces[0].vertices, vertices)


def test_sessions_do_not_share_state() -> None:
    one, other = pull_session(phantom(), vertices=300), pull_session(phantom(), vertices=300)
    tear(one)
    settle(other)
    assert other.reading().phase is Phase.INTACT
    assert other.reading().force == 0.0
