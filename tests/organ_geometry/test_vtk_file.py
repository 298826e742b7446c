"""VTK's own readers find what was written."""

from pathlib import Path

import numpy as np
import pytest
from tubes import tube
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

from organ_geometry.mesh.skin import organ_skin
from organ_geometry.mesh.vtk_file import vtp_content


@pytest.mark.parametrize("wall", [None, 1.0])
def test_vtk_reads_points_faces_and_figures_to_the_bit(tmp_path: Path, wall: float | None) -> None:
    skin = organ_skin(tube(wall=wall), edge_length=1.0)
    random = np.random.default_rng(1)
    figures = {
        "displacement_mm": random.normal(size=skin.vertices.shape).astype(np.float32),
        'a "name" & <more>': random.normal(size=len(skin.vertices)).astype(np.float32),
    }
    path = tmp_path / "duct.vtp"
    path.write_bytes(vtp_content(skin.vertices, faces=skin.faces, point_data=figures))
    reader = vtkXMLPolyDataReader()
    assert reader.CanReadFile(str(path))
    reader.SetFileName(str(path))
    reader.Update()
    surface = reader.GetOutput()
    assert np.array_equal(vtk_to_numpy(surface.GetPoints().GetData()), skin.vertices)
    faces = surface.GetPolys()
    assert np.array_equal(vtk_to_numpy(faces.GetConnectivityArray()), skin.faces.ravel())
    ends = vtk_to_numpy(faces.GetOffsetsArray())
    assert np.array_equal(ends, 3 * np.arange(len(skin.faces) + 1))
    data = surface.GetPointData()
    assert data.GetNumberOfArrays() == len(figures)
    for name, array in figures.items():
        assert np.array_equal(vtk_to_numpy(data.GetArray(name)), array)
