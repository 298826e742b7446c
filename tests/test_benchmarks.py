"""What the benchmarks do besides timing: the same problem for all, and peers that are missing."""

import itertools
from importlib import import_module

import numpy as np
import pytest
from simulated import phantom

from app.simulation import Session, free_specimen
from app.validation.network_checks import FRAME_HEIGHT, y_frame
from benchmarks import mujoco_chain, opensees_beam
from benchmarks.duct import CENTRE, DUCT, FORCE, STEP, relative_error, walk_about
from benchmarks.engine import Engine
from benchmarks.opensees_frame import MESHES, extrapolated, opensees_height
from benchmarks.page_protocol import hand_forces
from physics import Exact


def test_walk_goes_by_one_percent_and_comes_back() -> None:
    loads = walk_about(2.0, 161)
    steps = np.abs(np.diff(np.log(loads)))
    assert steps == pytest.approx(np.full(160, np.log1p(STEP)), rel=1e-12)
    assert loads[[0, 80, 160]] == pytest.approx(np.full(3, 2.0), rel=1e-15)
    assert np.sqrt(loads.min() * loads.max()) == pytest.approx(2.0, rel=1e-12)


def test_duct_is_that_of_table_6_3() -> None:
    """At P = 0.4 lbf the exact beam without shear is 0.466 in deflected, to its three digits."""
    deflection = Exact().pull(DUCT, CENTRE).to_force(FORCE).deflection
    assert deflection / 25.4 == pytest.approx(0.466, abs=5e-4)
    assert abs(relative_error(deflection)) < 1e-6


def test_engine_that_solves_another_problem_has_no_time() -> None:
    assert Engine("k", "right", 1.0, error=0.009).checked().time == 1.0
    for error in (0.011, -0.02, float("nan")):
        wrong = Engine("k", "wrong", 1.0, error=error).checked()
        assert wrong.time is None
        assert "wrong: the deflection is" in wrong.note


@pytest.mark.parametrize(
    ("peer", "timed"),
    [
        (opensees_beam, opensees_beam.opensees_engine),
        (mujoco_chain, mujoco_chain.mujoco_engine),
    ],
)
def test_missing_peer_is_said(monkeypatch: pytest.MonkeyPatch, peer, timed) -> None:
    def missing(name: str):
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr(peer, "import_module", missing)
    engine = timed()
    assert engine.time is None
    assert engine.note == f"{peer.NAME} is not installed: pip install .[bench]"


def test_peer_that_does_not_load_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(name: str):
        try:
            raise ImportError("libblas.so.3: cannot open shared object file")
        except ImportError:
            raise RuntimeError("Failed to import") from None

    monkeypatch.setattr(opensees_beam, "import_module", broken)
    note = opensees_beam.opensees_engine().note
    assert note == "OpenSeesPy does not run here: libblas.so.3: cannot open shared object file"


@pytest.mark.long
def test_a_y_frame_is_lifted_as_in_opensees() -> None:
    """In the same run, elements without length; and it gives the constant of the validation."""
    try:
        import_module("openseespy.opensees")
    except (ImportError, RuntimeError) as missing:  # as where a library of the system is
        pytest.skip(f"OpenSeesPy does not run here: {missing}")
    theirs = extrapolated(*map(opensees_height, MESHES))
    assert theirs == pytest.approx(FRAME_HEIGHT, abs=1e-6)
    ours = extrapolated(*(y_frame(each).found for each in MESHES))
    assert ours == pytest.approx(theirs, rel=2e-6)


def test_hand_never_lets_the_duct_rest_nor_tears_it() -> None:
    """So every tick of a client has a frame, and frames that are missing were left out."""
    session = Session(free_specimen(phantom()))
    for force in itertools.islice(hand_forces(), 100):
        session.set_target_force(force)
        for _ in range(3):  # ticks from move to move
            assert session.advance()
            assert session.reading().phase == "intact"
