"""Mesh files: STL, PLY and OBJ in mm, GLB in metres with y up."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.exchange.gltf import export_glb  # pyright: ignore[reportUnknownVariableType]
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from organ_geometry.whole_file import check_target, write_whole

__all__ = ["SUFFIXES", "check_mesh_path", "write_mesh"]

SUFFIXES = (".stl", ".ply", ".obj", ".glb")
"""Kinds of file, by suffix."""

GLTF_FROM_MM = 1e-3 * np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""glTF is metres with +y up; ours is mm with +z up."""

TISSUE = PBRMaterial(
    name="tissue", baseColorFactor=[205, 140, 92, 255], metallicFactor=0.0, roughnessFactor=0.45
)
"""What a GLB's surfaces are made of."""

Triangles = tuple[NDArray[np.float32], NDArray[np.int32]]
"""(V, 3) vertices, mm, and (F, 3) vertex numbers."""


def check_mesh_path(path: Path) -> None:
    """Raise if a mesh cannot be written there.

    Parameters
    ----------
    path
        Where the mesh is to be written.

    Raises
    ------
    ValueError
        If the suffix is unknown or the folder is not there.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(
            f"cannot write {path}: its name must end in the kind of mesh, one of "
            f"{', '.join(SUFFIXES)}"
        )
    check_target(path)


def write_mesh(parts: Mapping[str, Triangles], path: Path) -> None:
    """Write closed surfaces to one file, whole or not at all.

    Parameters
    ----------
    parts
        Surfaces by name. A GLB keeps them apart under their names.
    path
        The file; its suffix says which kind.

    Raises
    ------
    ValueError
        If the suffix is unknown or the folder is not there.
    """
    check_mesh_path(path)
    kind = path.suffix.lower().removeprefix(".")
    write_whole(path, _glb(parts) if kind == "glb" else _flat(parts, kind))


def _glb(parts: Mapping[str, Triangles]) -> bytes:
    """Return the parts as a binary glTF, each a node with its name."""
    scene = trimesh.Scene()
    for name, (vertices, faces) in parts.items():
        metres = (vertices.astype(np.float64) @ GLTF_FROM_MM.T).astype(np.float32)
        mesh = trimesh.Trimesh(
            metres, faces, vertex_normals=vertex_normals(metres, faces), process=False
        )
        mesh.visual = TextureVisuals(material=TISSUE)
        scene.add_geometry(  # pyright: ignore[reportUnknownMemberType]
            mesh, node_name=name, geom_name=name
        )
    return bytes(export_glb(scene, include_normals=True))


def vertex_normals(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return unit normals of a mesh's vertices: the mean of their faces' by area.

    Parameters
    ----------
    vertices
        (V, 3) places.
    faces
        (F, 3) vertex numbers.

    Returns
    -------
    NDArray[np.float64]
        (V, 3) normals, outwards.
    """
    corners = vertices.astype(np.float64)[faces]
    of_faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros((len(vertices), 3))
    for corner in range(3):
        np.add.at(sums, faces[:, corner], of_faces)
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)


def _flat(parts: Mapping[str, Triangles], kind: str) -> bytes:
    """Return the parts as one mesh in a format without nodes."""
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in parts.values())])
    whole = trimesh.Trimesh(
        np.concatenate([vertices for vertices, _ in parts.values()]),
        np.concatenate(
            [faces + offset for offset, (_, faces) in zip(offsets, parts.values(), strict=False)]
        ),
        process=False,
    )
    content = whole.export(file_type=kind)  # pyright: ignore[reportUnknownMemberType,reportUnknownVariableType,reportCallIssue]
    return content.encode() if isinstance(content, str) else bytes(content)  # pyright: ignore[reportUnknownArgumentType]
