"""An organ's surface: a closed skin bound to its beam, torn pieces, and the files of meshes."""

from organ_geometry.mesh.gltf_file import GLTF_FROM_MM, GltfFile, metres
from organ_geometry.mesh.gltf_mesh import INSIDE, OUTER_WALL, primitive, surface_materials
from organ_geometry.mesh.mesh_file import PAINTED_SUFFIXES, SUFFIXES, ClosedSurface, mesh_content
from organ_geometry.mesh.shaded_wall import ShadedWall, shaded_walls
from organ_geometry.mesh.skin import BoundSkin, Skin, organ_skin, ring_angles
from organ_geometry.mesh.tear import TornPiece, torn_pieces
from organ_geometry.mesh.vtk_file import pvd_content, vtp_content

__all__ = [
    "GLTF_FROM_MM",
    "INSIDE",
    "OUTER_WALL",
    "PAINTED_SUFFIXES",
    "SUFFIXES",
    "BoundSkin",
    "ClosedSurface",
    "GltfFile",
    "ShadedWall",
    "Skin",
    "TornPiece",
    "mesh_content",
    "metres",
    "organ_skin",
    "primitive",
    "pvd_content",
    "ring_angles",
    "shaded_walls",
    "surface_materials",
    "torn_pieces",
    "vtp_content",
]
