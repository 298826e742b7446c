"""Pulls: one load after the other is what each load is by itself."""

from dataclasses import replace

import numpy as np
import pytest

from physics import (
    Beam,
    Cubic,
    Equilibrium,
    Exact,
    Fem,
    Linear,
    NeoHooke,
    TautString,
    Theory,
    VaryingBeam,
)

DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
VARYING = VaryingBeam.of(DUCT, 5)
STATIONS = np.array([0.0, 12.0, 25.4, 50.8])


@pytest.mark.parametrize("beam", [DUCT, VARYING], ids=["constant", "varying"])
@pytest.mark.parametrize(
    "theory",
    [Cubic(), TautString(), Fem(), Exact(Linear(shear=True)), Exact(NeoHooke())],
    ids=lambda theory: f"{theory.name}",
)
@pytest.mark.parametrize("grasp", [25.4, 12.0])
def test_loads_in_a_row_are_those_by_themselves(theory: Theory, grasp: float, beam: Beam) -> None:
    pull = theory.pull(beam, grasp)
    for force in (0.5, 0.6, 3.0, 1.0, 0.0, 5.0):
        one, other = (
            pull.to_force(force).sample(STATIONS),
            theory.pull(beam, grasp).to_force(force).sample(STATIONS),
        )
        same(one, other)
        back = pull.to_deflection(one.deflection).sample(STATIONS)
        assert back.force == pytest.approx(force, rel=1e-9, abs=1e-9)


def same(one: Equilibrium, other: Equilibrium) -> None:
    for name in ("force", "deflection", "strain_energy"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-8, abs=1e-9)
    for name in ("along", "across", "rotation", "moment", "total_stress"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-6, abs=1e-7)


def test_part_of_an_equilibrium_is_the_same_at_fewer_stations() -> None:
    whole = Cubic().pull(DUCT, 25.4).to_force(2.0).sample(STATIONS)
    some = whole.subset(slice(1, 3))
    same(some, Cubic().pull(DUCT, 25.4).to_force(2.0).sample(STATIONS[1:3]))
    assert some.stations.tolist() == [12.0, 25.4]


def test_grasp_lies_between_the_clamps() -> None:
    for theory in (Cubic(), Exact()):
        with pytest.raises(ValueError, match="grasp must lie"):
            theory.pull(DUCT, 60.0)


def test_sections_and_beam_have_one_span() -> None:
    longer = Beam.round(span=60.0, diameter=8.89, modulus=0.310264)
    with pytest.raises(ValueError, match=r"must have the span and modulus of all, 50\.8 mm"):
        replace(VARYING, weakest=longer)
