"""The surfaces of an anatomy's tubes, one by one or as one closed surface, as a mesh file."""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from app.anatomy.anatomy_geometry import TubeLine
from app.anatomy.tables import Anatomy
from app.anatomy.tube_organ import tube_organ
from organ_geometry.mesh import NAMED_SUFFIXES, SUFFIXES, Surface, mesh_content, organ_skin

if TYPE_CHECKING:
    import trimesh

EDGE_FRACTION = 0.3
"""Of a tube's mean radius: edges of its triangles."""
# Of the merged surface: what it may be simplified by.
_SHORTEST_MM = 1e-3
# Of the way to a vertex's neighbours, and how often.
_NUDGE, _ROUNDS = 0.01, 4


def mesh_suffix(path: Path, *, merged: bool) -> str:
    """Return the kind of mesh that a file's name asks for; a ValueError if there is none."""
    suffix = path.suffix.lower()
    offered = [each for each in SUFFIXES if not (merged and each in NAMED_SUFFIXES)]
    if suffix not in offered:
        raise ValueError(f"a mesh's name must end in {', '.join(offered)}, not {path.name!r}")
    return suffix


def anatomy_mesh(
    anatomy: Anatomy, lines: dict[str, TubeLine], suffix: str, *, merged: bool
) -> bytes:
    """Return the closed surfaces of an anatomy's tubes as a mesh file.

    Parameters
    ----------
    anatomy, lines
        The anatomy and its tubes' axes.
    suffix
        Of `mesh_suffix`; a `.glb` is made by `app.export.rigged_organ.rigged_tubes`.
    merged
        Whether tubes become one closed surface, as far as they join.

    Returns
    -------
    bytes
        In the patient's LPS, where the anatomy has a place, else in its own frame.

    Raises
    ------
    ValueError
        If an organ cannot be read, or what merges surfaces is not installed.
    """
    surfaces: list[Surface] = []
    for tube in anatomy.tube:
        organ = tube_organ(anatomy, tube, lines[tube.name])
        skin = organ_skin(organ, edge_length=EDGE_FRACTION * organ.mean_radius)
        surfaces.append(Surface(tube.name, skin, skin.vertices))
    if not merged:
        return mesh_content(surfaces, suffix)
    return _merged(surfaces, suffix)


def _merged(surfaces: list[Surface], suffix: str) -> bytes:
    """Return the union of closed surfaces."""
    if find_spec("manifold3d") is None:
        raise ValueError(
            "surfaces are merged with manifold3d, which is missing: "
            "pip install 'bluntdissect[medical]'"
        )
    import trimesh
    from manifold3d import Manifold, Mesh64, OpType

    closed = [
        Manifold(Mesh64(one.vertices.astype(np.float64), one.skin.faces.astype(np.uint64)))
        for one in surfaces
    ]
    union: Any = Manifold.batch_boolean(closed, OpType.Add).simplify(_SHORTEST_MM).to_mesh64()
    whole = trimesh.Trimesh(union.vert_properties[:, :3], union.tri_verts, process=False)
    whole.vertices = _distinguished(whole)
    content = whole.export(file_type=suffix.removeprefix("."))  # pyright: ignore[reportUnknownMemberType,reportUnknownVariableType,reportCallIssue]
    return content.encode() if isinstance(content, str) else bytes(content)  # pyright: ignore[reportUnknownArgumentType]


def _distinguished(mesh: "trimesh.Trimesh") -> NDArray[np.float64]:
    """Return vertices of which no two are one in the 32 bits of a file: each moves a little."""
    # Such a pair, where surfaces nearly touch, would join them in a point.
    vertices = np.array(mesh.vertices, dtype=np.float64)
    for _ in range(_ROUNDS):
        _, of, counts = np.unique(
            vertices.astype(np.float32), axis=0, return_inverse=True, return_counts=True
        )
        for vertex in np.flatnonzero(counts[of.ravel()] > 1):
            around = vertices[mesh.vertex_neighbors[vertex]].mean(axis=0)
            vertices[vertex] += _NUDGE * (around - vertices[vertex])
    return vertices
