"""A run at several tubes as a GLB: each tube a named mesh that moves as the session moved it."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from gltf_reader import Gltf
from other_programs import validated

from app.anatomy import anatomy_named
from app.command_line.replay import replay
from app.export.motion import WHOLE
from app.export.recorded_tubes import recorded_tubes, rigged_tubes
from app.simulation import FEW, Session, Specimen, performed, read_script, run_json
from assets import SCRIPTS


@cache
def hasty() -> Session:
    """Return a session in which hasty jaws tore the artery."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=FEW)
    performed(read_script(SCRIPTS / "hasty.toml"), session)
    return session


def test_each_tube_is_a_mesh_that_moves_by_its_own_rig() -> None:
    """The torn artery comes in two more pieces; driving points are where the tissue has them."""
    session = hasty()
    assert session.specimen.organ is not None
    runs = recorded_tubes(session.run_file().log, session.specimen.organ, frames=40)
    tissue = session.spatial
    assert tuple(runs) == tissue.tubes.names
    for name, run in runs.items():
        surface = tissue.tubes.surfaces[tissue.tubes.names.index(name)]
        last = run.motion.transforms[-1]
        whole = bool(run.motion.whole[-1])
        assert whole == (name != "artery")
        piece = None if whole else 0
        element = tissue.torn_elements[tissue.tubes.names.index(name)]
        wanted = surface.move(tissue.beam, np.empty_like(last), piece, element)
        assert (last == wanted).all()
    assert runs["artery"].motion.fronts[0] == WHOLE
    assert runs["artery"].motion.fronts[-1] == pytest.approx(2.0)
    gltf = Gltf(rigged_tubes(runs, edge_length=0.8))
    names = {mesh["name"] for mesh in gltf.tree["meshes"]}
    assert names == {*tissue.tubes.names, "artery_first_piece", "artery_second_piece"}
    assert [each["name"] for each in gltf.tree["animations"]] == ["run"]
    assert len(gltf.tree["skins"]) == len(names)


def test_a_run_at_an_anatomy_is_written_as_a_glb(tmp_path: Path) -> None:
    """The replay command plays it, and a glTF validator finds no error."""
    file, out = tmp_path / "run.json", tmp_path / "run.glb"
    file.write_bytes(run_json(hasty().run_file()))
    replay(file, output=out, frames=10, edge_length=1.0)
    report = validated(out)[0]
    assert report["issues"]["numErrors"] == 0
