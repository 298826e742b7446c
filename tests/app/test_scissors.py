"""Scissors at an anatomy: what lies between their blades is cut, strands and tubes."""

import math
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from app.anatomy import anatomy_named, anatomy_network
from app.simulation import (
    FEW,
    TROCARS,
    Replay,
    Safety,
    Session,
    Specimen,
    exercise_at,
)
from app.simulation.exercises.next_step import FIRM, GENTLE
from app.simulation.tissue.blades import BLADES_MM
from app.simulation.tissue.instruments import CLIP_OPENING, RADIUS
from app.simulation.tissue.jaw_steps import OUT_MM, JawSteps
from app.simulation.tissue.parting import CUT_AFTER, PartingPlaces, Site
from app.simulation.tissue.spatial_tissue import SpatialTissue
from app.trainer.scope.drawn_tissue import draw_tissue
from app.trainer.scope.held_scope import HeldScope
from app.trainer.scope.packing import Frame
from physics.bed import WorstStress

Floats = NDArray[np.float64]


@pytest.fixture
def session() -> Session:
    """A session at an anatomy, whose gallbladder is held and drawn aside, with scissors."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=FEW)
    names = session.spatial.tubes.names
    session.choose_instrument(1, "scissors")
    place = session.grab(0, 20.0, names.index("gallbladder"))
    assert place is not None
    session.move_hand(0, np.add(place, (0.0, 6.0, 4.0)))
    session.advance(60)
    return session


def bring(tissue: SpatialTissue, tip: Floats, spread: Floats, opening: float) -> None:
    """Put open scissors somewhere, along the shaft that goes there."""
    hand, shaft = tissue.hands[1], TROCARS[1].shaft(tip)
    across = spread - (spread @ shaft) * shaft
    hand.aim = tuple(shaft.tolist())
    hand.spread = tuple((across / np.linalg.norm(across)).tolist())
    hand.opening = hand.target_opening = opening
    tissue.put_hand(1, tip)


def line_of(tissue: SpatialTissue, tube: str, station: float) -> tuple[Floats, Floats]:
    """Return where a tube's axis is, mm, and its direction."""
    places = tissue.beam.places_at(np.array([station - 0.5, station, station + 0.5]), tube)
    along = places[2] - places[0]
    return places[1], along / np.linalg.norm(along)


def crossing(tissue: SpatialTissue, half: float) -> NDArray[np.bool_]:
    """Return which strands, if straight, go between scissors no farther off their middle, (S,)."""
    hand, beam = tissue.hands[1], tissue.beam
    aim, spread, found = np.array(hand.aim), np.array(hand.spread), list[bool]()
    for end, foot in zip(beam.strand_ends(), beam.strand_feet(), strict=True):
        part, back, aside = np.linalg.solve(
            np.stack([foot - end, -aim, -spread], axis=1), hand.place - end
        ).tolist()
        found.append(0.0 < part < 1.0 and 0.0 < back < BLADES_MM and abs(aside) < half)
    return np.array(found)


def test_they_cut_the_strands_between_their_blades_and_no_others(session: Session) -> None:
    """Between two tubes and along them, up to the blades' axes: none is in steel."""
    tissue = session.spatial
    beam, strands, names = tissue.beam, tissue.tubes.strands, tissue.tubes.names
    between = (strands.tubes == names.index("cystic")) & (strands.to == names.index("common"))
    middle = 0.5 * (beam.strand_ends() + beam.strand_feet())[between].mean(axis=0)
    tip = middle - 2.0 * TROCARS[1].shaft(middle)
    bring(tissue, tip, line_of(tissue, "cystic", 12.0)[1], 6.0)
    whole = beam.damage < 1.0
    cut = crossing(tissue, 3.0 + 1.05 * RADIUS["scissors"]) & whole
    assert cut.sum() > 10
    assert session.cut(1)
    assert ((beam.damage >= 1.0) == (cut | ~whole)).all()
    assert not tissue.events
    assert not session.cut(1), "nothing is between them any more"
    session.advance(30)


def test_what_strands_store_is_released_as_they_are_parted(session: Session) -> None:
    """Of the energy balance nothing else changes."""
    beam, strands = session.spatial.beam, session.spatial.tubes.strands
    beam.detach(np.zeros(strands.count, dtype=np.bool_))  # accounts for all so far
    stretch = np.sqrt(((beam.strand_ends() - beam.strand_feet()) ** 2).sum(axis=1)) - strands.length
    stored = 0.5 * (1.0 - beam.damage) * strands.stiffness * np.maximum(stretch, 0.0) ** 2
    touched = np.any([beam.touched_by(rod) for rod in range(4)], axis=0)
    parted, energy = (stored > np.quantile(stored, 0.9)) & ~touched, beam.energy
    beam.detach(parted)
    after = beam.energy
    assert stored[parted].sum() > 0.01
    assert after.snap - energy.snap == pytest.approx(stored[parted].sum(), rel=1e-6)
    assert after.stored - energy.stored == pytest.approx(-stored[parted].sum(), rel=1e-6)
    assert (after.work, after.dissipated) == (energy.work, energy.dissipated)
    assert after.residual == pytest.approx(energy.residual, abs=1e-9)


def test_what_goes_round_the_outside_of_a_blade_is_not_cut(session: Session) -> None:
    """Closed blades that come in among strands and then part have pushed them outwards."""
    tissue = session.spatial
    beam, strands, names = tissue.beam, tissue.tubes.strands, tissue.tubes.names
    between = (strands.tubes == names.index("cystic")) & (strands.to == names.index("common"))
    middle = 0.5 * (beam.strand_ends() + beam.strand_feet())[between].mean(axis=0)
    shaft, along = TROCARS[1].shaft(middle), line_of(tissue, "cystic", 12.0)[1]
    bring(tissue, middle + 15.0 * shaft, along, 0.0)
    session.move_hand(1, middle - 2.0 * shaft)
    session.advance(60)
    session.open_jaws(1, 6.0)
    session.advance(60)
    hand = tissue.hands[1]
    assert hand.opening == 6.0
    touching = np.any([beam.touched_by(rod) for rod in (2, 3)], axis=0) & (beam.damage < 1.0)
    outside = touching & crossing(tissue, 3.0)  # which straight would lead through between them
    assert outside.sum() > 3
    assert session.cut(1)
    assert (beam.damage[outside] < 1.0).all()


def test_a_tube_is_divided_cut_in_part_or_pushed_aside(session: Session) -> None:
    """By how much of its width is between them, and how steeply it crosses their plane."""
    tissue = session.spatial
    beam = tissue.beam
    beam.detach(np.ones(tissue.tubes.strands.count, dtype=np.bool_))
    place, along = line_of(tissue, "artery", 10.0)
    shaft = TROCARS[1].shaft(place)
    across = np.cross(shaft, along)
    across /= np.linalg.norm(across)
    bring(tissue, place - 3.0 * shaft, along, 6.0)  # lengthwise
    assert not session.cut(1)
    bring(tissue, place + 2.0 * shaft, across, 6.0)  # in front of it
    assert not session.cut(1)
    radius = float(tissue.tubes.network.tubes["artery"].radius.max())
    bring(tissue, place + 0.2 * radius * shaft, across, 6.0)  # 40 % of its width
    (between,) = tissue.blades(1).tubes(beam)
    assert between.depth == pytest.approx(0.4, abs=0.02)
    assert session.cut(1)
    (nick,) = tissue.nicks()
    assert nick.depth == pytest.approx(0.5, abs=0.05)  # and as deep as a tear begins
    assert nick.station == pytest.approx(10.0, abs=1.0)
    assert [(each.kind, each.tube, each.hand) for each in tissue.events] == [("nick", "artery", 1)]
    # It is cut from the front, where the shaft is.
    assert np.array(beam.section_side(10.0, shaft, "artery")) @ nick.side > 0.8
    session.advance(30)
    assert tissue.fluids["blood"].lost > 0.0
    place = line_of(tissue, "cystic", 8.0)[0]
    across = np.cross(TROCARS[1].shaft(place), line_of(tissue, "cystic", 8.0)[1])
    bring(tissue, place - 3.0 * TROCARS[1].shaft(place), across, 6.0)
    assert session.cut(1)
    assert ("division", "cystic", 1) in {(e.kind, e.tube, e.hand) for e in tissue.events}


def test_a_run_has_what_was_cut(session: Session) -> None:
    """A replay has the same bits; a division of an older run cuts no strand."""
    tissue = session.spatial
    beam, strands, names = tissue.beam, tissue.tubes.strands, tissue.tubes.names
    between = (strands.tubes == names.index("cystic")) & (strands.to == names.index("common"))
    middle = 0.5 * (beam.strand_ends() + beam.strand_feet())[between].mean(axis=0)
    shaft = TROCARS[1].shaft(middle)
    session.aim(1, shaft.tolist())
    session.spread(1, line_of(tissue, "cystic", 12.0)[1].tolist())
    session.open_jaws(1, 6.0)
    session.move_hand(1, middle + 20.0 * shaft)
    session.advance(90)
    session.move_hand(1, middle - 2.0 * shaft)
    session.advance(60)
    assert tissue.apply(1, "divide", (), lambda: False) is None
    parted = beam.broken
    assert session.cut(1)
    assert beam.broken > parted + 10
    session.advance(30)
    run = session.run_file()
    assert [each.kind for each in run.log.inputs].count("cut") == 1
    again = Replay(run.log, tissue.dissection.organ)
    assert again.run_file().metrics == run.metrics
    again.seek(run.log.ticks)
    assert (again.session.spatial.beam.damage == beam.damage).all()
    assert (again.session.spatial.beam.places == beam.places).all()


def test_the_side_of_a_section_is_the_one_that_bending_stretches(session: Session) -> None:
    """Away from where the axis curves to, as its wall's stress has it."""
    beam = session.spatial.beam
    found = 0
    for name in ("cystic", "artery"):
        stations = beam.stations_of(name)
        places, stresses = beam.places[beam.nodes_of(name)], beam.stresses()[beam.elements_of(name)]
        rest = beam.rest_places[beam.nodes_of(name)]
        for k in range(2, stations.size - 2):
            curved = places[k - 1] - 2.0 * places[k] + places[k + 1]
            curved -= rest[k - 1] - 2.0 * rest[k] + rest[k + 1]
            worst = WorstStress(float(stations[k]), 0.0, *map(float, stresses[k, 0, 1:]))
            if worst.bending < 0.5 * np.abs(stresses[:, :, 1:]).max():
                continue
            up, across = beam.section_side(worst.station, -curved, name)
            cosine = (up * math.cos(worst.side) + across * math.sin(worst.side)) / math.hypot(
                up, across
            )
            assert cosine > 0.8, (name, k)
            found += 1
    assert found > 2


class Drawn:
    """A picture that keeps what it was sent last."""

    def __init__(self, session: Session) -> None:
        self._tissue = session.spatial
        self._held = HeldScope(anatomy_network(anatomy_named("normal")))
        self._frame: Frame | None = None

    def send(self, _beam: object, frame: Frame, _angle: float) -> None:
        self._frame = frame

    def opening(self, hand: int) -> float:
        """Return how far a hand's jaws are drawn apart now, mm."""
        draw_tissue(cast(Any, self), self._tissue, self._held)
        assert self._frame is not None
        return self._frame.hands[hand].opening


def test_blades_are_seen_to_close_and_a_grasper_to_hold(session: Session) -> None:
    """Whether or not they find anything between them."""
    drawn = Drawn(session)
    session.open_jaws(1, CLIP_OPENING)
    session.advance(100)
    assert drawn.opening(1) == CLIP_OPENING
    assert not session.cut(1)
    assert drawn.opening(1) == 0.0
    apart = list[float]()
    for _ in range(50):
        session.advance(1)
        apart.append(drawn.opening(1))
    assert apart == sorted(apart)
    assert apart[-1] == CLIP_OPENING
    held = drawn.opening(0)
    session.release(0)
    assert drawn.opening(0) > held > 0.0


def asked_to_cut(places: PartingPlaces) -> Site:
    """Return what is asked to be cut once jaws have parted little, again and again."""
    for tried in range(6 * (CUT_AFTER + 1)):
        site = places.best("triangle")
        assert site is not None
        if site.tool == "scissors":
            assert tried >= CUT_AFTER
            return site
        places.note_tried(site, fruitless=True)
    raise AssertionError("scissors are not asked for")


def test_what_jaws_do_not_part_between_two_tubes_is_asked_to_be_cut(session: Session) -> None:
    """Blades that are where the steps ask for them cut strands, and no tube."""
    session.release(0)
    exercise = exercise_at(anatomy_named("normal"), "critical_view")
    assert exercise is not None
    session.start_exercise(exercise)
    session.choose_instrument(1, "scissors")
    tissue, safety = session.spatial, Safety(session.spatial)
    places = PartingPlaces(safety)
    site = asked_to_cut(places)
    strands = tissue.tubes.strands
    assert (strands.to[site.near] >= 0).all(), "they hold two tubes together"
    jaws, place = JawSteps(tissue, places, site, GENTLE), places.place_of(site)
    assert "lead the right hand's scissors into the ring" in jaws.next_step().words
    assert site.beside is not None
    bring(tissue, place + site.beside, site.along, CLIP_OPENING)
    jaws.follow()
    step = jaws.next_step()
    assert "the right hand's open scissors between" in step.words
    assert step.place is not None
    assert np.allclose(step.place, place)
    # What lies in their way there is cut by nothing, and pushed aside by a blade.
    session.move_hand(1, place)
    session.advance(150)
    assert math.dist(tissue.hands[1].place, place) < 0.1
    jaws.follow()
    assert (
        jaws.next_step().words
        == "Next: cut what lies between its blades with the right hand's scissors (G)."
    )
    broken = tissue.beam.broken
    assert session.cut(1)
    assert tissue.beam.broken - broken >= 5
    assert not tissue.events
    session.advance(1)
    jaws.follow()
    assert "out of the tissue" in jaws.next_step().words
    assert not jaws.is_over
    hand = tissue.hands[1]
    hand.put(place + site.beside + (OUT_MM + 0.1) * TROCARS[1].shaft(place))
    assert jaws.is_over
    assert not jaws.fruitless


def test_blades_that_have_a_tube_between_them_are_drawn_out(session: Session) -> None:
    """Else it would be asked for to cut it."""
    session.release(0)
    tissue, safety = session.spatial, Safety(session.spatial)
    places = PartingPlaces(safety)
    site = asked_to_cut(places)
    jaws = JawSteps(tissue, places, site, FIRM)
    assert site.beside is not None
    place = places.place_of(site)
    bring(tissue, place + site.beside, site.along, CLIP_OPENING)
    jaws.follow()
    bring(tissue, place, site.along, CLIP_OPENING)
    names = tissue.tubes.names
    axis = line_of(tissue, "cystic", 12.0)
    nearest = TROCARS[1].shaft(axis[0])
    tissue.hands[1].put(axis[0] - 3.0 * nearest)
    off = places.place_of(site) - tissue.hands[1].place
    # The tissue has moved there: the ring is where a tube lies between the blades.
    jaws.site = site._replace(offset=site.offset - off)
    across = np.cross(nearest, axis[1])
    tissue.hands[1].aim = tuple(nearest.tolist())
    tissue.hands[1].spread = tuple((across / np.linalg.norm(across)).tolist())
    assert [names[each.tube] for each in tissue.blades(1).tubes(tissue.beam)] == ["cystic"]
    jaws.follow()
    assert jaws.next_step().words.endswith("the cystic duct lies between its blades.")
    assert jaws.tried, "so that it is asked for less"
    tissue.hands[1].put(place + 30.0 * nearest)
    assert jaws.is_over
    assert jaws.fruitless
    assert not tissue.events
