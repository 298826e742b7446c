"""The stress at a surface: linear across a section, the beam's own at its outermost fibre."""

import numpy as np
import pytest
from simulated import phantom

from app.simulation.dissection import Dissection
from app.simulation.preset import preset_named
from app.simulation.surface_stress import SurfaceStress, fibres, surface_stress
from organ_geometry.skin import organ_skin
from physics import Beam, Cubic, Equilibrium, check_rupture, critical_stations

BEAM = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
GRASP, THRESHOLD = 20.0, 0.2


def pulled(force: float = 2.0) -> Equilibrium:
    return Cubic().under_force(BEAM, GRASP, force, critical_stations(BEAM, GRASP))


def at(stations: list[float], fibre: list[float], force: float = 2.0) -> SurfaceStress:
    return surface_stress(
        pulled(force), np.array(stations), np.array(fibre), span=BEAM.span, threshold=THRESHOLD
    )


def test_outermost_fibres_bear_what_the_beam_says() -> None:
    beam = pulled()
    stations = beam.stations.tolist()
    for side in (1.0, -1.0):
        stress = at(stations, [side] * len(stations))
        assert stress.normal == pytest.approx(beam.normal_stress)
        assert np.abs(stress.bending) == pytest.approx(beam.bending_stress)
    check = check_rupture(beam, THRESHOLD)
    worst = at([check.station], [float(check.tension_side)])
    assert worst.total[0] == pytest.approx(check.total_stress)
    assert worst.distance_to_break[0] == pytest.approx(check.distance_to_break)


def test_a_pull_stretches_the_top_at_the_grasp_and_the_bottom_at_the_clamps() -> None:
    """Fixed at both ends and lifted between: the arch's crown is stretched above."""
    top = at([0.0, GRASP, BEAM.span], [1.0] * 3)
    bottom = at([0.0, GRASP, BEAM.span], [-1.0] * 3)
    assert np.sign(top.bending).tolist() == [-1.0, 1.0, -1.0]
    assert bottom.bending == pytest.approx(-top.bending)


def test_stress_is_linear_across_a_section_and_tension_on_its_axis() -> None:
    fibre = np.linspace(-1.0, 1.0, 9)
    stress = at([GRASP] * 9, fibre.tolist())
    assert stress.bending == pytest.approx(stress.bending[-1] * fibre)
    assert stress.total[4] == pytest.approx(stress.normal[4])
    assert stress.total == pytest.approx(stress.normal + stress.bending)
    assert stress.distance_to_break == pytest.approx(1.0 - stress.total / THRESHOLD)


def test_nothing_is_stressed_at_rest_or_behind_a_clamp() -> None:
    assert not at([0.0, 10.0, GRASP], [1.0, -1.0, 0.5], force=0.0).total.any()
    behind = at([-0.1, BEAM.span + 0.1], [1.0, -1.0])
    assert not behind.total.any()
    assert (behind.distance_to_break == 1.0).all()


@pytest.mark.parametrize("edge_length", [0.3, 1.2])
def test_fibres_reach_the_outside_of_an_organ_on_both_sides(edge_length: float) -> None:
    dissection = Dissection.of(phantom(), preset_named("thesis-bile-duct"))
    skin = organ_skin(dissection.organ, edge_length=edge_length)
    stations, fibre = fibres(dissection, skin)
    assert stations == pytest.approx(skin.stations - dissection.clamps[0])
    outer = np.unique(skin.faces[: skin.outer_faces])
    inner = np.setdiff1d(np.arange(len(fibre)), outer)
    # Between two vertices the outermost fibre can be missed by (edge / radius)^2 / 8.
    missed = (edge_length / dissection.organ.mean_radius) ** 2 / 8.0
    for ring in np.array_split(outer, 20):
        assert -1.0 <= fibre[ring].min() < -0.9 + missed
        assert 1.0 >= fibre[ring].max() > 0.9 - missed
    assert np.abs(fibre[inner]).max() < np.abs(fibre[outer]).max()
