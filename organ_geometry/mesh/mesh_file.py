"""Mesh files: STL, PLY and OBJ in mm, GLB in metres with y up, ZIP of an STL for each surface."""

from collections.abc import Sequence
from io import BytesIO
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np
from numpy.typing import NDArray

from organ_geometry.atomic_file import file_name
from organ_geometry.mesh.gltf_file import GltfFile
from organ_geometry.mesh.gltf_mesh import skin_primitives
from organ_geometry.mesh.skin import Surface

SUFFIXES = (".stl", ".ply", ".obj", ".glb", ".zip")
"""Kinds of file, by suffix."""
NAMED_SUFFIXES = (".glb", ".zip")
"""Those that have each surface by its name."""
COLORED_SUFFIXES = (".ply", ".glb")
"""Those that keep the colours of vertices."""


def mesh_content(
    surfaces: Sequence[Surface], suffix: str, colors: Sequence[NDArray[np.uint8]] = ()
) -> bytes:
    """Return closed surfaces as a file; (V, 3) sRGB colours for each of them, or none."""
    if suffix == ".glb":
        return _glb(surfaces, colors)
    if suffix == ".zip":
        return _zip(surfaces)
    return _flat(surfaces, suffix.removeprefix("."), colors)


def _glb(surfaces: Sequence[Surface], colors: Sequence[NDArray[np.uint8]]) -> bytes:
    file = GltfFile()
    for surface, shown in zip(surfaces, colors or [None] * len(surfaces), strict=True):
        found = skin_primitives(file, surface.skin, surface.vertices, colors=shown)
        mesh = {"name": surface.name, "primitives": [each.item for each in found]}
        file.add_root({"name": surface.name, "mesh": file.add("meshes", mesh)})
    return file.content()


def _zip(surfaces: Sequence[Surface]) -> bytes:
    """Return an archive of an STL for each surface, with its name."""
    packed, names = BytesIO(), set[str]()
    with ZipFile(packed, "w") as archive:
        for surface in surfaces:
            name = file_name(surface.name)
            if name.casefold() in names:
                raise ValueError(f"two surfaces have the file name {name}.stl: rename one of them")
            names.add(name.casefold())
            # Of a fixed date, so that the same surfaces give the same bytes.
            entry = ZipInfo(f"{name}.stl")
            archive.writestr(entry, _flat([surface], "stl", ()), ZIP_DEFLATED)
    return packed.getvalue()


def _flat(surfaces: Sequence[Surface], kind: str, colors: Sequence[NDArray[np.uint8]]) -> bytes:
    """Return one mesh in a format without nodes."""
    before = np.cumsum([0, *(len(each.vertices) for each in surfaces)])
    import trimesh  # here: half a second that only a mesh's file needs

    whole = trimesh.Trimesh(
        np.concatenate([each.vertices for each in surfaces]),
        np.concatenate(
            [each.skin.faces + first for first, each in zip(before, surfaces, strict=False)]
        ),
        vertex_colors=np.concatenate(colors) if colors else None,
        process=False,
    )
    content = whole.export(file_type=kind)  # pyright: ignore[reportUnknownMemberType,reportUnknownVariableType,reportCallIssue]
    return content.encode() if isinstance(content, str) else bytes(content)  # pyright: ignore[reportUnknownArgumentType]
