"""Mesh files: STL, PLY and OBJ in mm, GLB in metres with y up."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from organ_geometry.atomic_file import check_target, write_atomic
from organ_geometry.mesh.gltf_file import GltfFile
from organ_geometry.mesh.gltf_mesh import primitive, surface_materials
from organ_geometry.mesh.shaded_wall import shaded_walls
from organ_geometry.mesh.skin import Skin

__all__ = [
    "PAINTED_SUFFIXES",
    "SUFFIXES",
    "ClosedSurface",
    "check_mesh_path",
    "mesh_content",
    "write_mesh",
]

SUFFIXES = (".stl", ".ply", ".obj", ".glb")
"""Kinds of file, by suffix."""
PAINTED_SUFFIXES = (".ply", ".glb")
"""Those that keep the colours of vertices."""


@dataclass(frozen=True, slots=True, eq=False)
class ClosedSurface:
    """One closed surface, ready to be written.

    Attributes
    ----------
    vertices
        (V, 3) places, mm.
    faces
        (F, 3) vertex numbers, anticlockwise seen from outside; those of the outer wall come first.
    outer_faces
        How many faces the outer wall has.
    colors
        (V, 3) sRGB colours, 0 to 255, or None.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    outer_faces: int
    colors: NDArray[np.uint8] | None = None

    @classmethod
    def of(
        cls,
        skin: Skin,
        vertices: NDArray[np.float32] | None = None,
        colors: NDArray[np.uint8] | None = None,
    ) -> "ClosedSurface":
        """Return a skin's surface.

        Parameters
        ----------
        skin
            The skin.
        vertices
            (V, 3) where its vertices are, mm; at rest when None.
        colors
            (V, 3) sRGB colours, 0 to 255, or None.

        Returns
        -------
        ClosedSurface
            The surface.
        """
        places = skin.vertices if vertices is None else vertices
        return cls(places, skin.faces, skin.outer_faces, colors)


def check_mesh_path(path: Path, *, painted: bool = False) -> None:
    """Raise if a mesh cannot be written there."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(
            f"cannot write {path}: its name must end in the kind of mesh, one of "
            f"{', '.join(SUFFIXES)}"
        )
    if painted and suffix not in PAINTED_SUFFIXES:
        raise ValueError(
            f"cannot write {path}: {suffix} keeps no colours; take one of "
            f"{', '.join(PAINTED_SUFFIXES)}"
        )
    check_target(path)


def write_mesh(parts: Mapping[str, ClosedSurface], path: Path) -> None:
    """Write closed surfaces to one file, whole or not at all."""
    check_mesh_path(path, painted=any(part.colors is not None for part in parts.values()))
    write_atomic(path, mesh_content(parts, path.suffix.lower()))


def mesh_content(parts: Mapping[str, ClosedSurface], suffix: str) -> bytes:
    """Return closed surfaces as a file's content."""
    if suffix == ".glb":
        return _glb(parts)
    return _flat(list(parts.values()), suffix.removeprefix("."))


def _glb(parts: Mapping[str, ClosedSurface]) -> bytes:
    """Return the parts as a binary glTF, each a node with its name."""
    file = GltfFile()
    painted = any(part.colors is not None for part in parts.values())
    materials = surface_materials(file, painted=painted)
    for name, part in parts.items():
        walls = zip(shaded_walls(part.faces, part.outer_faces), materials, strict=True)
        mesh = {
            "name": name,
            "primitives": [
                primitive(file, wall, part.vertices, material, colors=part.colors)
                for wall, material in walls
            ],
        }
        file.add_root({"name": name, "mesh": file.add("meshes", mesh)})
    return file.content()


def _flat(parts: list[ClosedSurface], kind: str) -> bytes:
    """Return the parts as one mesh in a format without nodes."""
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts)])
    colors = [part.colors for part in parts if part.colors is not None]
    import trimesh  # here: half a second that only a mesh's file needs

    whole = trimesh.Trimesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + offset for offset, part in zip(offsets, parts, strict=False)]),
        vertex_colors=np.concatenate(colors) if colors else None,
        process=False,
    )
    content = whole.export(file_type=kind)  # pyright: ignore[reportUnknownMemberType,reportUnknownVariableType,reportCallIssue]
    return content.encode() if isinstance(content, str) else bytes(content)  # pyright: ignore[reportUnknownArgumentType]
