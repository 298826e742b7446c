"""A skin in a glTF file: two primitives, the outer wall and the inside, each with its material."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from organ_geometry.mesh.color import INSIDE, OUTER_WALL, Color, linear_light
from organ_geometry.mesh.gltf_file import Finish, GltfFile, metres, turned
from organ_geometry.mesh.normals import vertex_normals
from organ_geometry.mesh.skin import Side, Skin

_WHITE = (255, 255, 255)  # under the colours of vertices
_WALLS: tuple[tuple[Side, str, Color, float], ...] = (
    ("outer", "outer wall", OUTER_WALL, 0.45),
    ("inside", "inside", INSIDE, 0.35),
)
"""Part of a skin, name of its material, sRGB colour, roughness."""


class Primitive(NamedTuple):
    """A primitive, to be put into a mesh, and (W,) the skin's vertices that its own stand at."""

    item: dict[str, Any]
    numbers: NDArray[np.intp]


def skin_primitives(
    file: GltfFile,
    skin: Skin,
    vertices: NDArray[np.float32],
    *,
    colors: NDArray[np.uint8] | None = None,
) -> list[Primitive]:
    """Add a skin's places, normals and triangles: (V, 3) mm, (V, 3) sRGB colours if any."""
    found: list[Primitive] = []
    for side, name, color, roughness in _WALLS:
        numbers, faces = skin.side(side)
        places = vertices[numbers]
        attributes = {
            "POSITION": file.accessor(metres(places), "VEC3", target="vertices", bounded=True),
            "NORMAL": file.accessor(
                turned(vertex_normals(places, faces)), "VEC3", target="vertices"
            ),
        }
        if colors is not None:
            shown = np.full((len(places), 4), 65535, np.uint16)
            shown[:, :3] = np.rint(65535.0 * linear_light(colors[numbers]))
            attributes["COLOR_0"] = file.accessor(shown, "VEC4", target="vertices", normalized=True)
        finish = Finish(color if colors is None else _WHITE, roughness)
        item = {
            "attributes": attributes,
            "indices": file.indices(faces, len(places)),
            "material": file.material(finish, name),
        }
        found.append(Primitive(item, numbers))
    return found
