"""An organ's surface in a glTF file: two primitives, the outer wall and the inside."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from organ_geometry.mesh.gltf_file import GltfFile, metres, turned
from organ_geometry.mesh.shaded_wall import ShadedWall, vertex_normals

__all__ = ["INSIDE", "OUTER_WALL", "primitive", "surface_materials"]

OUTER_WALL = (192, 124, 80)
INSIDE = (138, 48, 40)
"""sRGB colours of the outer wall, and of the lumen and torn tissue."""
_SRGB_TOE = 0.04045


def surface_materials(file: GltfFile, *, painted: bool) -> tuple[int, int]:
    """Add the materials of an organ's walls."""
    colors = ((255, 255, 255),) * 2 if painted else (OUTER_WALL, INSIDE)
    first, second = (
        file.add(
            "materials",
            {
                "name": name,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [*_linear(np.array(color)).round(5).tolist(), 1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": roughness,
                },
            },
        )
        for name, color, roughness in zip(
            ("outer wall", "inside"), colors, (0.45, 0.35), strict=True
        )
    )
    return first, second


def primitive(
    file: GltfFile,
    wall: ShadedWall,
    vertices: NDArray[np.float32],
    material: int,
    *,
    colors: NDArray[np.uint8] | None = None,
) -> dict[str, Any]:
    """Add a wall's places, normals and triangles.

    Parameters
    ----------
    file
        The file.
    wall
        The wall.
    vertices
        (V, 3) the surface's vertices, mm.
    material
        Number of its material.
    colors
        (V, 3) sRGB colours of the surface's vertices, 0 to 255, or None.

    Returns
    -------
    dict[str, Any]
        The primitive, to be put into a mesh.
    """
    places = vertices[wall.source]
    normals = turned(vertex_normals(places, wall.faces))
    attributes = {
        "POSITION": file.accessor(metres(places), "VEC3", target="vertices", bounded=True),
        "NORMAL": file.accessor(normals, "VEC3", target="vertices"),
    }
    if colors is not None:
        shown = np.full((len(places), 4), 65535, np.uint16)
        shown[:, :3] = np.rint(65535.0 * _linear(colors[wall.source]))
        attributes["COLOR_0"] = file.accessor(shown, "VEC4", target="vertices", normalized=True)
    return {
        "attributes": attributes,
        "indices": file.indices(wall.faces, len(places)),
        "material": material,
    }


def _linear(color: NDArray[Any]) -> NDArray[np.float64]:
    """Return sRGB colours, 0 to 255, as linear light, 0 to 1, as glTF wants them."""
    srgb = np.asarray(color, np.float64) / 255.0
    return np.where(srgb <= _SRGB_TOE, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
