"""An organ's surface: a closed skin bound to its beam, torn pieces, and the files of meshes."""

from organ_geometry.mesh.color import (
    COLOR_MAP,
    INSIDE,
    OUTER_WALL,
    Color,
    color_map,
    linear_light,
    srgb_color,
    stress_colors,
)
from organ_geometry.mesh.gltf_file import GLTF_FROM_MM, Finish, GltfFile, VectorKind, metres, turned
from organ_geometry.mesh.gltf_mesh import skin_primitives
from organ_geometry.mesh.mesh_file import COLORED_SUFFIXES, NAMED_SUFFIXES, SUFFIXES, mesh_content
from organ_geometry.mesh.normals import vertex_normals
from organ_geometry.mesh.skin import BoundSkin, Skin, Surface, organ_skin, ring_angles
from organ_geometry.mesh.tear import TornPiece, torn_pieces
from organ_geometry.mesh.vtk_file import pvd_content, vtp_content

__all__ = [
    "COLORED_SUFFIXES",
    "COLOR_MAP",
    "GLTF_FROM_MM",
    "INSIDE",
    "NAMED_SUFFIXES",
    "OUTER_WALL",
    "SUFFIXES",
    "BoundSkin",
    "Color",
    "Finish",
    "GltfFile",
    "Skin",
    "Surface",
    "TornPiece",
    "VectorKind",
    "color_map",
    "linear_light",
    "mesh_content",
    "metres",
    "organ_skin",
    "pvd_content",
    "ring_angles",
    "skin_primitives",
    "srgb_color",
    "stress_colors",
    "torn_pieces",
    "turned",
    "vertex_normals",
    "vtp_content",
]
