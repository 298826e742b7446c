"""VTK's glTF reader, which is ParaView's: it moves what is in a rigged file as our own skinning."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rigged import Rigged, rigged
from test_rigged_organ import OF_RADIUS, SPECK, largest, size
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOGeometry import vtkGLTFReader

from app.simulation import PIECES


def blocks(path: Path, animation: str | None = None, time: float = 0.0) -> list[np.ndarray]:
    """(V, 3) places of each primitive at a time of an animation, m, in the order of the nodes."""
    reader = vtkGLTFReader()
    reader.SetFileName(str(path))
    reader.SetApplyDeformationsToGeometry(True)
    reader.UpdateInformation()
    for number in range(reader.GetNumberOfAnimations()):
        if reader.GetAnimationName(number) == animation:
            reader.EnableAnimation(number)
    if animation is not None:
        reader.UpdateInformation()
        reader.UpdateTimeStep(time)
    reader.Update()
    found: list[np.ndarray] = []
    iterator = reader.GetOutput().NewIterator()
    iterator.InitTraversal()
    while not iterator.IsDoneWithTraversal():
        points = iterator.GetCurrentDataObject().GetPoints()
        found.append(vtk_to_numpy(points.GetData()).copy())
        iterator.GoToNextItem()
    return found


def named(duct: Rigged, found: list[np.ndarray]) -> dict[str, list[np.ndarray]]:
    """The primitives by mesh: their nodes come in the order of the file."""
    counts = {
        name: [len(wall) for wall in duct.rest(name)]
        for name in ("first_piece", "organ", PIECES[1])
    }
    assert [len(block) for block in found] == [n for each in counts.values() for n in each]
    blocks = iter(found)
    return {name: [next(blocks) for _ in each] for name, each in counts.items()}


@pytest.mark.parametrize(("animation", "key"), [("pull", -1), ("tear", 0), ("tear", -1)])
def test_vtk_plays_what_our_own_skinning_gives(tmp_path: Path, animation: str, key: int) -> None:
    duct = rigged()
    path = tmp_path / "duct.glb"
    path.write_bytes(duct.content)
    (motion,) = [each for each in duct.motions if each.name == animation]
    key %= len(motion.times)
    seen = duct.shown(motion, key)
    for name, got in named(duct, blocks(path, animation, float(motion.times[key]))).items():
        if name in seen:
            assert largest(got, seen[name]) < OF_RADIUS * duct.radius
        else:
            assert size(got) < SPECK


def test_vtk_reads_still_files(tmp_path: Path) -> None:
    order = rigged().order
    for name, wanted, count in (
        ("still", replace(order, static=True), 2),
        ("torn", replace(order, torn=True), 4),
        ("stress", replace(order, stress_colors=True, force=2.0), 2),
    ):
        path = tmp_path / f"{name}.glb"
        wanted.write(path)
        assert len(blocks(path)) == count
