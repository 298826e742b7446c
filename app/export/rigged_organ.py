"""A rigged organ: glTF with a joint at each driving point, and its motions as animations.

A vertex that follows two driving points by linear weights is what every viewer's skinning does, so
the joints need no more than each driving point's own turn and place.

The whole organ and its two pieces are three meshes that share no vertex. The whole one hangs on one
set of joints, the pieces on another; while the organ is whole the pieces' joints are scaled to
nothing, and from the tear on the whole organ's are. That is the way of the glTF specification to
show and hide a skinned mesh (3.5.3, the note on a scale of zero), and needs no extension. So `pull`
moves one closed surface, the same as the still mesh, and its seam cannot show.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.export.motion import Motion
from app.export.torn_rim import RimShapes, rim_shapes
from app.simulation.dissection import PIECES
from organ_geometry.driving_points import DrivingPoints
from organ_geometry.mesh.gltf_file import GLTF_FROM_MM, GltfFile, metres
from organ_geometry.mesh.gltf_mesh import primitive, surface_materials
from organ_geometry.mesh.shaded_wall import ShadedWall, shaded_walls
from organ_geometry.mesh.skin import BoundSkin, Skin
from organ_geometry.mesh.tear import TornPiece

__all__ = ["ORGAN", "rigged_organ"]

ORGAN = "organ"
"""Name of the whole organ's node."""
RIM_TOLERANCE = 2e-5
"""How near a torn rim is shown to where it is, in parts of the organ's radius."""
RIGID = 1e-6
"""How far a driving point's transform may be from a rotation."""
MOST_VERTICES = 300_000
"""A skin that viewers still move smoothly."""


@dataclass(frozen=True, slots=True, eq=False)
class _Rig:
    """A set of joints.

    Attributes
    ----------
    root, joints
        Numbers of their nodes.
    skin
        Number of the glTF skin.
    """

    root: int
    joints: list[int]
    skin: int


@dataclass(frozen=True, slots=True, eq=False)
class _Poses:
    """Where the joints are at each key of a motion, in glTF's frame.

    Attributes
    ----------
    translations
        (D, T, 3) places from the rig's root, m.
    rotations
        (D, T, 4) unit quaternions x, y, z, w.
    moving
        (D,) which joints leave their place or turn at all.
    """

    translations: NDArray[np.float32]
    rotations: NDArray[np.float32]
    moving: NDArray[np.bool_]


def rigged_organ(
    skin: Skin,
    driving: DrivingPoints,
    motions: Sequence[Motion],
    pieces: tuple[TornPiece, TornPiece] | None = None,
    *,
    radius: float,
) -> bytes:
    """Return an organ as a binary glTF that moves.

    Parameters
    ----------
    skin
        The whole organ's skin.
    driving
        The driving points.
    motions
        What it does, each an animation of its name; one that tears it needs the pieces.
    pieces
        The two pieces that it tears into, or None.
    radius
        The organ's mean radius, mm: what a rim is shown exactly by.

    Returns
    -------
    bytes
        The file: nodes `organ`, `first_piece` and `second_piece`, metres, y up.

    Raises
    ------
    ValueError
        If a transform is not rigid, a motion needs pieces that are not given, or the skin has more
        vertices than viewers move.
    """
    if len(skin.vertices) > MOST_VERTICES:
        raise ValueError(
            f"edge_length gives {len(skin.vertices):,} vertices and viewers move at most "
            f"{MOST_VERTICES:,}; take a larger one, or export a still mesh"
        )
    if pieces is None and not all(motion.whole.all() for motion in motions):
        raise ValueError("a motion tears the organ and its pieces are not given")
    file = GltfFile()
    materials = surface_materials(file, painted=False)
    middle = metres(0.5 * (driving.positions[0] + driving.positions[-1]))
    poses = [_poses(driving, motion, middle) for motion in motions]
    moving = np.logical_or.reduce([each.moving for each in poses])

    whole = _rig(file, ORGAN, driving, middle, shown=True)
    _add_mesh(file, ORGAN, skin, skin.bound_to(driving), whole, materials)
    torn: _Rig | None = None
    rims: list[tuple[int, RimShapes]] = []
    if pieces is not None:
        torn = _rig(file, "pieces", driving, middle, shown=False)
        for name, piece in zip(PIECES, pieces, strict=True):
            bound = piece.skin.bound_to(driving)
            rim = rim_shapes(piece, bound, list(motions), tolerance=RIM_TOLERANCE * radius)
            node = _add_mesh(file, name, piece.skin, bound, torn, materials, rim.shapes)
            rims.append((node, rim))

    for number, (motion, pose) in enumerate(zip(motions, poses, strict=True)):
        animation = _Animation(file)
        animation.add_joints(whole, pose, motion.times, motion.whole, moving)
        if torn is not None:
            torn_keys = ~motion.whole
            animation.add_joints(torn, pose, motion.times, torn_keys, moving)
            for node, rim in rims:
                if torn_keys.any() and len(rim.shapes):
                    animation.add(
                        node, "weights", motion.times[torn_keys], rim.weights[number].ravel()
                    )
            animation.add_shown(whole, motion.times, motion.whole)
            animation.add_shown(torn, motion.times, torn_keys)
        animation.close(motion.name)
    return file.content()


def _rig(
    file: GltfFile,
    name: str,
    driving: DrivingPoints,
    middle: NDArray[np.float32],
    *,
    shown: bool,
) -> _Rig:
    """Add a joint for each driving point, all of them children of a root in the organ's middle."""
    places = metres(driving.positions)
    joints = [
        file.add("nodes", {"name": f"{name}_joint_{number:03d}", "translation": place})
        for number, place in enumerate((places - middle).tolist())
    ]
    root: dict[str, Any] = {
        "name": f"{name}_rig",
        "translation": middle.tolist(),
        "children": joints,
    }
    if not shown:
        root["scale"] = [0.0, 0.0, 0.0]
    number = file.add_root(root)
    inverse = np.tile(np.eye(4, dtype=np.float32), (len(places), 1, 1))
    inverse[:, 3, :3] = -places  # columns come one after the other
    binds = file.accessor(inverse.reshape(-1, 16), "MAT4")
    skin = file.add(
        "skins",
        {"name": name, "joints": joints, "skeleton": number, "inverseBindMatrices": binds},
    )
    return _Rig(number, joints, skin)


def _add_mesh(
    file: GltfFile,
    name: str,
    skin: Skin,
    bound: BoundSkin,
    rig: _Rig,
    materials: tuple[int, int],
    shapes: NDArray[np.float32] | None = None,
) -> int:
    """Add a skinned mesh and return its node."""
    primitives: list[dict[str, Any]] = []
    walls = shaded_walls(skin.faces, skin.outer_faces)
    for wall, material in zip(walls, materials, strict=True):
        item = primitive(file, wall, skin.vertices, material)
        item["attributes"] |= _binding(file, bound, wall)
        if shapes is not None and len(shapes):
            item["targets"] = [_target(file, shape[wall.source]) for shape in shapes]
        primitives.append(item)
    mesh: dict[str, Any] = {"name": name, "primitives": primitives}
    if shapes is not None and len(shapes):
        mesh["weights"] = [0.0] * len(shapes)
    return file.add_root({"name": name, "mesh": file.add("meshes", mesh), "skin": rig.skin})


def _binding(file: GltfFile, bound: BoundSkin, wall: ShadedWall) -> dict[str, int]:
    """Store which two joints each vertex of a wall follows, and how much."""
    index = bound.index[wall.source]
    after = np.rint(65535.0 * bound.weight[wall.source]).astype(np.uint16)
    weights = np.zeros((len(index), 4), np.uint16)
    weights[:, 0], weights[:, 1] = 65535 - after, after
    joints = np.zeros((len(index), 4), np.uint8 if index.max() < 255 else np.uint16)
    # A joint without weight must be number 0.
    joints[:, 0] = np.where(weights[:, 0] > 0, index, 0)
    joints[:, 1] = np.where(weights[:, 1] > 0, index + 1, 0)
    return {
        "JOINTS_0": file.accessor(joints, "VEC4", target="vertices"),
        "WEIGHTS_0": file.accessor(weights, "VEC4", target="vertices", normalized=True),
    }


def _target(file: GltfFile, shape: NDArray[np.float32]) -> dict[str, int]:
    """Store a displacement of a wall's vertices."""
    moved = metres(shape)
    where = np.flatnonzero(moved.any(axis=1)).astype(np.uint32)
    where = where if where.size else np.zeros(1, np.uint32)
    return {"POSITION": file.sparse_accessor(len(moved), where, moved[where])}


def _poses(driving: DrivingPoints, motion: Motion, middle: NDArray[np.float32]) -> _Poses:
    """Return the joints' places and turns at each key of a motion."""
    changes, shifts = motion.transforms[..., :3], motion.transforms[..., 3]
    turns = np.eye(3) + changes
    if np.abs(np.swapaxes(turns, -1, -2) @ turns - np.eye(3)).max() > RIGID:
        raise ValueError(f"transforms of motion {motion.name!r} must be rigid")
    places = driving.positions + np.einsum("tdij,dj->tdi", changes, driving.positions) + shifts
    into = 1e3 * GLTF_FROM_MM
    rotations = _quaternions(into @ turns @ into.T)
    return _Poses(
        np.ascontiguousarray(np.swapaxes(metres(places) - middle, 0, 1)),
        np.ascontiguousarray(np.swapaxes(rotations, 0, 1)),
        np.asarray(motion.transforms.any(axis=(0, 2, 3))),
    )


def _quaternions(turns: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return (..., 4) unit quaternions x, y, z, w of rotations, none far from the one before."""
    diagonal = np.diagonal(turns, axis1=-2, axis2=-1)
    trace = diagonal.sum(axis=-1, keepdims=True)
    squares = np.concatenate([1.0 + 2.0 * diagonal - trace, 1.0 + trace], axis=-1)
    # The largest of the four components divides the others (Shepperd 1978).
    lower, upper = np.tril_indices(3, -1)
    sums = turns[..., lower, upper] + turns[..., upper, lower]  # yx, zx, zy
    less = turns[..., lower, upper] - turns[..., upper, lower]
    wx, wy, wz = less[..., 2], -less[..., 1], less[..., 0]
    xy, xz, yz = sums[..., 0], sums[..., 1], sums[..., 2]
    products = np.stack(
        [
            np.stack([squares[..., 0], xy, xz, wx], axis=-1),
            np.stack([xy, squares[..., 1], yz, wy], axis=-1),
            np.stack([xz, yz, squares[..., 2], wz], axis=-1),
            np.stack([wx, wy, wz, squares[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    largest = np.argmax(squares, axis=-1)[..., np.newaxis, np.newaxis]
    found = np.take_along_axis(products, largest, axis=-2)[..., 0, :]
    found /= np.linalg.norm(found, axis=-1, keepdims=True)
    # q and -q are one rotation; a viewer goes the short way only between like signs.
    signs = np.sign(np.sum(found[1:] * found[:-1], axis=-1, keepdims=True))
    first = np.where(found[:1, ..., 3:] < 0.0, -1.0, 1.0)
    following = np.concatenate([first, np.where(signs < 0.0, -1.0, 1.0)])
    return (found * np.cumprod(following, axis=0)).astype(np.float32)


class _Animation:
    """One animation in the making."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._samplers: list[dict[str, Any]] = []
        self._channels: list[dict[str, Any]] = []

    def add(self, node: int, path: str, times: NDArray[np.float64], values: NDArray[Any]) -> None:
        """Let a node's property follow values, straight from key to key."""
        kind = "SCALAR" if path == "weights" else "VEC3"
        self._add(node, path, self._times(times), self._file.accessor(values, kind), "LINEAR")

    def add_joints(
        self,
        rig: _Rig,
        poses: _Poses,
        times: NDArray[np.float64],
        keys: NDArray[np.bool_],
        moving: NDArray[np.bool_],
    ) -> None:
        """Let a rig's moving joints follow their poses at some keys."""
        if not keys.any() or not moving.any():
            return
        clock = self._times(times[keys])
        translations = self._file.accessors(poses.translations[moving][:, keys], "VEC3")
        rotations = self._file.accessors(poses.rotations[moving][:, keys], "VEC4")
        for path, outputs in (("translation", translations), ("rotation", rotations)):
            for joint, output in zip(np.flatnonzero(moving).tolist(), outputs, strict=True):
                self._add(rig.joints[joint], path, clock, output, "LINEAR")

    def add_shown(self, rig: _Rig, times: NDArray[np.float64], keys: NDArray[np.bool_]) -> None:
        """Show a rig from keys that are its own on, and hide it from others on."""
        # Of two keys at one time, the last of the whole and the first of the pieces, the last.
        last = np.append(np.diff(times) > 0.0, True)
        times, keys = times[last], keys[last]
        change = np.append(True, keys[1:] != keys[:-1])
        scales = np.repeat(keys[change].astype(np.float32)[:, np.newaxis], 3, axis=1)
        clock = self._times(times[change])
        self._add(rig.root, "scale", clock, self._file.accessor(scales, "VEC3"), "STEP")

    def close(self, name: str) -> None:
        """Put the animation into the file."""
        item = {"name": name, "samplers": self._samplers, "channels": self._channels}
        self._file.add("animations", item)

    def _times(self, times: NDArray[np.float64]) -> int:
        return self._file.accessor(times.astype(np.float32), "SCALAR", bounded=True)

    def _add(self, node: int, path: str, clock: int, output: int, way: str) -> None:
        sampler = {"input": clock, "output": output, "interpolation": way}
        self._samplers.append(sampler)
        self._channels.append(
            {"sampler": len(self._samplers) - 1, "target": {"node": node, "path": path}}
        )
