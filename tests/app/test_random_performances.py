"""Random hands at an anatomy lose, gain and undefine nothing; a replay has the same bits."""

from dataclasses import astuple
from functools import cache
from typing import Literal

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.anatomy import Anatomy, anatomy_named
from app.simulation import FEW, Replay, Session, Specimen, performed, run_json
from app.simulation.inputs.inputs import Instrument
from app.simulation.scripts.performance import Script, Step
from physics.bed import EnergyBalance
from physics.bed.kernels import RETRACED

SPANS = {"common": 58.0, "cystic": 22.9, "gallbladder": 75.0, "rha": 37.8, "artery": 25.4}
"""mm, of the usual anatomy's tubes."""
UNBALANCED, RESIDUAL_MJ = 0.1, 0.05
"""Of the energy that has gone round, and mJ, what the balance may leave unexplained.

Hands that leap at 60 mm/s left up to 4.5 %, others less than 1 %."""
RETRACED_UNBALANCED, RETRACED_MJ = 1e-4, 1e-3
"""And of a balance that is retraced."""


@cache
def usual() -> Anatomy:
    return anatomy_named("normal")


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False).map(lambda value: round(value, 2))


places = st.tuples(numbers(20.0, 60.0), numbers(-5.0, 30.0), numbers(-8.0, 15.0))
offsets = st.tuples(numbers(-6.0, 6.0), numbers(-6.0, 6.0), numbers(-2.0, 6.0))
directions = st.tuples(numbers(-1.0, 1.0), numbers(-1.0, 1.0), numbers(0.1, 1.0))
hands: st.SearchStrategy[Literal[1, 2]] = st.sampled_from((1, 2))
speeds = numbers(10.0, 60.0)
HOLDING: tuple[Instrument, ...] = ("grasper", "hook")
PARTING: tuple[Instrument, ...] = (
    "dissector",
    "swab",
    "right angle",
    "clip applier",
    "scissors",
    "suction",
)


@st.composite
def held(draw: st.DrawFn) -> list[Step]:
    """A hand takes hold of a tube, draws it about, and may let go."""
    hand, tube = draw(hands), draw(st.sampled_from(sorted(SPANS)))
    steps = [
        Step(do="take", hand=hand, instrument=draw(st.sampled_from(HOLDING))),
        Step(do="grab", hand=hand, tube=tube, at_mm=draw(numbers(0.0, SPANS[tube]))),
        *(
            Step(do="lead", hand=hand, by_mm=offset, speed_mm_per_s=draw(speeds))
            for offset in draw(st.lists(offsets, min_size=1, max_size=3))
        ),
    ]
    return steps + [Step(do="release", hand=hand)] * draw(st.integers(0, 1))


@st.composite
def parted(draw: st.DrawFn) -> list[Step]:
    """A hand brings an instrument in, opens, clips or cuts, and goes on."""
    hand, instrument = draw(hands), draw(st.sampled_from(PARTING))
    ends = draw(st.lists(st.sampled_from(["open", "clip", "divide", "suck"]), max_size=3))
    opening = draw(numbers(0.0, 20.0))
    deeds = {
        "open": Step(do="open", hand=hand, opening_mm=opening),
        "clip": Step(do="clip", hand=hand),
        "divide": Step(do="divide", hand=hand),
        "suck": Step(do="suck", hand=hand, rate_ml_per_s=10.0),
    }
    return [
        Step(do="take", hand=hand, instrument=instrument),
        Step(do="aim", hand=hand, direction=draw(directions)),
        Step(do="spread", hand=hand, direction=draw(directions)),
        Step(do="lead", hand=hand, to_mm=draw(places), speed_mm_per_s=60),
        Step(do="lead", hand=hand, to_mm=draw(places), speed_mm_per_s=draw(speeds)),
        *(deeds[each] for each in ends),
    ]


scripts = st.lists(st.one_of(held(), parted()), min_size=1, max_size=3).map(
    lambda groups: Script(step=[step for group in groups for step in group])
)


def gone_round(energy: EnergyBalance) -> float:
    """Return the energy that hands, tissue and drag have taken and given, mJ."""
    return (
        energy.stored + energy.dissipated + energy.viscous + energy.snap + energy.drag
        + abs(energy.lag)
    )  # fmt: skip


@pytest.mark.parametrize("retraced", [False, pytest.param(True, marks=pytest.mark.long)])
@given(script=scripts)
@settings(
    deadline=None,
    max_examples=10,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
def test_random_hands_neither_lose_nor_gain_anything(retraced: bool, script: Script) -> None:
    session = Session(Specimen.of_anatomy(usual()), vertices=FEW)
    done = performed(script, session)
    tissue = session.spatial
    state, energy = tissue.beam.state, tissue.beam.energy
    assert all(np.isfinite(each).all() for each in (state.x, state.q, state.damage))
    assert np.isfinite(astuple(energy)).all()
    assert ((state.damage >= 0.0) & (state.damage <= 1.0)).all()
    assert energy.dissipated >= -1e-9
    assert abs(energy.residual) <= RESIDUAL_MJ + UNBALANCED * gone_round(energy)
    for flow in tissue.fluids.values():
        assert all(hole.lost >= 0.0 for hole in flow.holes)
        assert flow.left + flow.lost == pytest.approx(flow.fluid.volume, rel=1e-12)
    run = session.run_file()
    if not run.log.ticks:
        assert done.seconds == 0.0
        return
    assert session.specimen.organ is not None
    again = Replay(run.log, session.specimen.organ)
    replayed = again.session.spatial
    again.seek_tick(1)  # by then the tissue is a new one
    replayed.beam.state.sums[RETRACED] = retraced
    again.seek_tick(run.log.ticks)
    assert (replayed.beam.places == tissue.beam.places).all()
    assert (replayed.beam.damage == tissue.beam.damage).all()
    assert replayed.events == tissue.events
    if retraced:  # the hands' work is measured better, and what it tells of
        energy = replayed.beam.energy
        assert abs(energy.residual) <= RETRACED_MJ + RETRACED_UNBALANCED * gone_round(energy)
    else:
        assert run_json(again.run_file()) == run_json(run)
