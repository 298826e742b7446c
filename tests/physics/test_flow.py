"""Flow through tubes: resistances in series and parallel by hand, volumes that stay, clips."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physics.bed import BeamOnBed, Flow, Fluid, Join, Network, SpaceBeam
from tests.physics.test_network import TUBE, straight

BLOOD = Fluid(viscosity=3.5e-6, pressure=12.0, supply=4000.0, volume=5e6)
FEED = BLOOD.pressure / BLOOD.supply


def pipe(length: float, bore: float) -> float:
    return 8 * BLOOD.viscosity * length / (math.pi * bore**4)


def orifice(radius: float, wall: float = 0.0) -> float:
    return 3 * BLOOD.viscosity / radius**3 + 8 * BLOOD.viscosity * wall / (math.pi * radius**4)


def branched() -> BeamOnBed:
    """An artery fed at both ends, and a branch from its place at 20 mm."""
    a = straight([0, 0, 0], [60, 0, 0], 12, TUBE, ("clamped", "clamped"), (20.0,))
    b = straight([20, 0, 0], [20, 30, 0], 10, TUBE, ("free", "clamped"))
    return BeamOnBed(Network({"a": a, "b": b}, [Join("b", 0, "a", 20.0)]))


def vessels(bed: BeamOnBed) -> Flow:
    return Flow(bed, BLOOD, {"a": 1.2, "b": 0.7}, [("a", 0), ("a", 1)])


def test_a_torn_branch_bleeds_by_resistances_in_series_and_parallel() -> None:
    bed = branched()
    flow = vessels(bed)
    assert flow.advance(0.1) == 0.0
    element = bed.tear(13.0, "b")
    flow.advance(1e-3)
    one, other = FEED + pipe(20.0, 1.2), FEED + pipe(40.0, 1.2)
    stump = float(bed.stations_of("b")[element])
    whole = 1 / (1 / one + 1 / other) + pipe(stump, 0.7) + orifice(0.7)
    near, far = flow.holes
    assert near.flow == pytest.approx(BLOOD.pressure / whole, rel=1e-11)
    assert far.flow == 0.0  # nothing feeds the far stump
    assert (near.tube, near.station) == ("b", stump)


def test_a_nick_in_a_loop_is_fed_from_both_sides() -> None:
    """A ring of two ways, and the hole in one of them."""
    a = straight([0, 0, 0], [60, 0, 0], 12, TUBE, ("clamped", "free"), (20.0, 50.0))
    b = SpaceBeam.from_axis(
        elements=9, stiffness=TUBE, ends=("free", "free"), radius=1.0,
        axis=np.array([[20.0, 0, 0], [35.0, 8, 0], [50.0, 0, 0]]), nodes_at=(14.0,),
    )  # fmt: skip
    bed = BeamOnBed(Network({"a": a, "b": b}, [Join("b", 0, "a", 20.0), Join("b", 1, "a", 50.0)]))
    flow = Flow(bed, BLOOD, {"a": 1.0, "b": 0.6}, [("a", 0)])
    flow.nick(14.0, "b", 0.3, 0.2)
    flow.advance(1e-3)
    # Chords: what flows, flows along elements.
    x = bed.places[bed.nodes_of("b")]
    lengths = np.sqrt((np.diff(x, axis=0) ** 2).sum(axis=1))
    k = int(np.argmin(np.abs(bed.stations_of("b") - 14.0)))
    bores = 0.6 * np.sqrt(np.diff(bed.stations_of("b")) / lengths)
    each = 8 * BLOOD.viscosity * lengths / (math.pi * bores**4)
    near, far = each[:k].sum(), each[k:].sum() + pipe(30.0, 1.0)
    whole = FEED + pipe(20.0, 1.0) + 1 / (1 / near + 1 / far) + orifice(0.3, 0.2)
    assert flow.rate == pytest.approx(BLOOD.pressure / whole, rel=1e-11)


def test_clips_on_both_sides_of_a_division_let_nothing_out() -> None:
    bed = branched()
    flow = vessels(bed)
    flow.clip(10.0, "b")
    flow.clip(20.0, "b")
    bed.tear(15.0, "b")
    assert flow.advance(1.0) == pytest.approx(0.0, abs=1e-9)
    other = vessels(bed)
    other.clip(20.0, "b")
    assert other.advance(1.0) > 1000.0


def test_a_stretched_tube_lets_less_through() -> None:
    """Its bore's volume stays: the resistance grows with the cube of its length."""
    bed = BeamOnBed(straight([0, 0, 0], [30, 0, 0], 6, TUBE, ("clamped", "free")))
    flow = Flow(bed, BLOOD, {"beam": 0.5}, [("beam", 0)])
    flow.nick(30.0, "beam", 0.2, 0.0)
    node = bed.take(30.0)
    bed.lead(node, (33.0, 0.0, 0.0))
    bed.advance()
    flow.advance(1e-3)
    whole = FEED + pipe(30.0, 0.5) * 1.1**3 + orifice(0.2)
    assert flow.rate == pytest.approx(BLOOD.pressure / whole, rel=1e-9)


@settings(deadline=None, max_examples=60)
@given(st.data())
def test_what_is_lost_and_left_is_all_there_was(data: Any) -> None:
    """Whatever is torn, nicked and clipped, whatever the step; what goes in comes out."""
    bed = branched()
    small = Fluid(viscosity=3.5e-6, pressure=12.0, supply=4000.0, volume=3000.0)
    flow = Flow(bed, small, {"a": 1.2, "b": 0.7}, [("a", 0), ("a", 1)])
    for _ in range(data.draw(st.integers(1, 6))):
        tube = data.draw(st.sampled_from(["a", "b"]))
        at = data.draw(st.floats(0.5, 29.5))
        what = data.draw(st.sampled_from(["tear", "nick", "clip"]))
        if what == "tear":
            bed.tear(at, tube)
        elif what == "nick":
            flow.nick(at, tube, data.draw(st.floats(0.05, 0.5)), 0.2)
        else:
            flow.clip(at, tube)
        before = flow.left
        gone = flow.advance(data.draw(st.floats(1e-4, 10.0)))
        assert gone >= 0.0
        assert flow.left >= -1e-9
        assert flow.left + flow.lost == pytest.approx(small.volume, rel=1e-12)
        assert before - flow.left == pytest.approx(gone, abs=1e-9)
        fed = sum(
            small.supply * (before / small.volume - flow.pressures[node] / small.pressure)
            for node in (int(bed.nodes_of("a")[0]), int(bed.nodes_of("a")[-1]))
        )
        if flow.holes:
            assert fed == pytest.approx(flow.rate, rel=1e-9, abs=1e-6)
        assert np.all(np.isfinite(flow.pressures))


def test_flows_that_cannot_be_are_refused() -> None:
    bed = branched()
    with pytest.raises(ValueError, match="viscosity of a fluid must be above 0"):
        Fluid(viscosity=0.0, pressure=1.0, supply=1.0, volume=1.0)
    with pytest.raises(ValueError, match="end 0 of tube 'b' is fed, and has none of the fluid"):
        Flow(bed, BLOOD, {"a": 1.0}, [("b", 0)])
    with pytest.raises(ValueError, match="bore of tube 'a' must be above 0 mm"):
        Flow(bed, BLOOD, {"a": 0.0}, [])
    with pytest.raises(ValueError, match="31 mm is not on the tube, which runs from 0 to 30 mm"):
        vessels(bed).clip(31.0, "b")
