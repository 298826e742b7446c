"""Anatomies as networks: they build, rest, hold together, and their strands are where they say."""

import math
from pathlib import Path

import numpy as np
import pytest

from app.anatomy import Anatomy, anatomy_network, drawn_anatomy, read_anatomy, shipped_anatomies
from physics.bed import Strands
from physics.bed import kernels as k

SHIPPED = shipped_anatomies()


def assert_at_rest(anatomy: Anatomy) -> None:
    made = anatomy_network(anatomy)
    bed = made.on_bed()
    k.assemble(bed.state, k.INCREMENTAL, 0.0)
    assert np.abs(bed.state.g).max() < 1e-12
    assert bed.energy.stored == 0.0
    for _ in range(5):
        bed.tick(1e-3)
    assert np.abs(bed.places - bed.rest_places).max() < 1e-12
    # Every layer that tubes near enough have has strands, and none is at a joint alone.
    assert made.layers.size == made.strands.count
    assert np.all(bed.state.pair[:, 2] >= 0)


@pytest.mark.parametrize("path", SHIPPED.values(), ids=SHIPPED)
def test_shipped_anatomies_rest_in_balance(path: Path) -> None:
    assert_at_rest(read_anatomy(path))


@pytest.mark.parametrize("seed", range(1, 21))
def test_drawn_anatomies_rest_in_balance(seed: int) -> None:
    assert_at_rest(drawn_anatomy(seed))


def test_strands_between_tubes_hold_both_walls_and_are_the_same_again() -> None:
    anatomy = read_anatomy(SHIPPED["normal"])
    made, again = anatomy_network(anatomy), anatomy_network(anatomy)
    strands, network = made.strands, made.network
    beams = list(network.tubes.values())
    assert strands.ends.tobytes() == again.strands.ends.tobytes()
    assert strands.stiffness.tobytes() == again.strands.stiffness.tobytes()
    assert int((strands.to >= 0).sum()) > 400
    for number, beam in enumerate(beams):
        for tubes, stations, places in (
            (strands.tubes, strands.stations, strands.ends),
            (strands.to, strands.to_stations, strands.feet),
        ):
            here = tubes == number
            if not here.any():
                continue
            axis, along = beam.places_at(stations[here])
            away = places[here] - axis
            radius = np.interp(stations[here], beam.stations, beam.radius)
            assert np.abs((away * along).sum(axis=1)).max() < 1e-6
            assert np.sqrt((away**2).sum(axis=1)) == pytest.approx(radius, abs=1e-6)
    for number, layer in enumerate(anatomy.layer):
        mine = made.layers == number
        gap = np.sqrt(((strands.ends - strands.feet)[mine] ** 2).sum(axis=1))
        assert np.all(strands.length[mine] >= gap - 1e-6)
        if layer.to != "bed" and mine.any():
            assert gap.min() >= 0.3 - 1e-6
        if layer.sheet == "peritoneum":
            middle = 0.5 * (strands.ends + strands.feet)[mine, 2]
            others = (made.layers != number) & (strands.tubes == 1) & (strands.to == 0)
            assert middle.mean() > 0.5 * (strands.ends + strands.feet)[others, 2].mean() + 0.3
        if layer.toward is not None:
            # As far as it is across the tube.
            chord = beams[2].places[-1] - beams[2].places[0]
            chord /= np.sqrt(chord @ chord)
            direction = (strands.feet - strands.ends)[mine].mean(axis=0)
            across = np.array(layer.toward) - (chord @ layer.toward) * chord
            assert direction @ across > 0.95 * np.sqrt((direction @ direction) * (across @ across))


@pytest.mark.parametrize(
    "anatomy",
    [*map(read_anatomy, SHIPPED.values()), *map(drawn_anatomy, range(1, 9))],
    ids=lambda each: f"{each.name} {each.seed}",
)
def test_no_strand_leads_through_a_tube_that_it_does_not_hold(anatomy: Anatomy) -> None:
    """By the distance of places along it; all that older runs had besides leads through one."""
    made, whole = anatomy_network(anatomy), anatomy_network(anatomy, clear=False)
    axes = [
        beam.places_at(np.linspace(0.0, beam.span, 200))[0] for beam in made.network.tubes.values()
    ]

    def is_inside(at: int, strands: Strands, slack: float) -> bool:
        """Return whether a strand leads through another tube, by so many mm."""
        parts = np.linspace(0.1, 0.9, 41)[:, None]
        path = strands.ends[at] + parts * (strands.feet[at] - strands.ends[at])
        for number, beam in enumerate(made.network.tubes.values()):
            if number in (strands.tubes[at], strands.to[at]):
                continue
            far = np.sqrt(((axes[number] - path[:, None]) ** 2).sum(axis=2))
            stations = np.linspace(0.0, beam.span, 200)
            if (far < np.interp(stations, beam.stations, beam.radius) - slack).any():
                return True
        return False

    assert not any(is_inside(each, made.strands, 0.1) for each in range(made.strands.count))
    kept = {each.tobytes() for each in np.hstack([made.strands.ends, made.strands.feet])}
    rows = np.hstack([whole.strands.ends, whole.strands.feet])
    left_out = [number for number, each in enumerate(rows) if each.tobytes() not in kept]
    assert len(left_out) == whole.strands.count - made.strands.count
    assert all(is_inside(each, whole.strands, -0.05) for each in left_out)


def test_a_torn_cystic_artery_bleeds_until_it_is_clipped() -> None:
    made = anatomy_network(read_anatomy(SHIPPED["normal"]))
    bed = made.on_bed()
    flows = made.flows(bed)
    assert set(flows) == {"blood", "bile"}
    artery = bed.stations_of("artery")[-1]
    bed.tear(0.6 * artery, "artery")
    lost = flows["blood"].advance(1.0)
    assert 500.0 < lost < 8000.0
    assert flows["bile"].advance(1.0) == 0.0
    flows["blood"].clip(0.3 * artery, "artery")
    assert flows["blood"].advance(1.0) < 1e-9 * lost
    assert flows["blood"].left + flows["blood"].lost == flows["blood"].fluid.volume
    bed.tear(10.0, "cystic")
    assert flows["bile"].advance(1.0) > 100.0


def test_a_gallbladder_that_is_pulled_frees_its_tissue_and_its_energy_balances() -> None:
    """In real time and through equilibria; what tears first is a matter of its own wall."""
    made = anatomy_network(read_anatomy(SHIPPED["normal"]))
    bed = made.on_bed()
    node = bed.take(30.0, "gallbladder")
    for step in range(600):
        bed.lead(node, bed.rest_place(node) + np.array([0.0, 0.0, 0.02 * step]))
        bed.tick(2.5e-3)
    balance = bed.energy
    assert bed.broken > 25
    assert bed.freed_of("gallbladder") > bed.freed_of("rha")
    assert abs(balance.residual) < 1e-4 * balance.work
    slow = made.on_bed()
    node = slow.take(30.0, "gallbladder")
    for step in range(1, 5):
        slow.lead(node, slow.rest_place(node) + np.array([0.0, 0.0, 0.8 * step]))
        slow.advance()
    assert abs(slow.energy.residual) < 1e-4 * slow.energy.work
    k.assemble(slow.state, k.FROZEN, 0.0)
    free = slow.state.held == 0
    size = float(np.sqrt((slow.hand_force(node) ** 2).sum()))
    assert np.abs(slow.state.g[free]).max() < 1e-6 * size
    assert math.isfinite(slow.worst_stress("artery").total)
