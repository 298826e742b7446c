"""A rigged organ: glTF with a joint at each driving point, and its motions as animations.

Each vertex follows two driving points by linear weights, which is what every viewer's skinning
does; so a joint needs only its driving point's rotation and position. The joints form a chain from
the clamp on, each a child of the one before, as programs with bones expect them. With a driving
point at p_i at rest and its transform [R_i | t_i] at a key, it stands at q_i = R_i p_i + t_i, and
relative to its parent its joint has
    rotation  R_{i-1}^T R_i,    translation  R_{i-1}^T (q_i - q_{i-1});
the first joint's parent is the anchor, which does not move.

The whole organ and its two pieces are three meshes that share no vertex, each with its own joints.
While the organ is whole the pieces' joints are scaled to a speck, and from the tear on the whole
organ's are. This is how the glTF specification hides a skinned mesh (3.5.3), and it needs no
extension; only its scale of zero is avoided, because some readers divide by it. So `pull` moves one
closed surface, the same as the static mesh, which has no seam.

Each chain hangs on a root of its own. Blender turns such a root into an armature, and the node of a
mesh whose shapes are animated into an empty object, unless that node is also the root of joints. So
the first piece's mesh is on the root of the whole organ's joints, and the second's on that of the
first's. (On the root of its own joints it would be lost to a reader such as Godot, which moves a
mesh below its joints.)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.anatomy.anatomy_mesh import EDGE_FRACTION
from app.export.motion import Motion
from app.export.snapshot import NAMES
from app.export.strand_mesh import StrandMesh, strand_mesh
from app.export.strands import BedTrack
from app.export.torn_rim import RimShapes, rim_shapes
from app.simulation import PIECES, Tubes
from organ_geometry import DrivingPoints
from organ_geometry.mesh import (
    GLTF_FROM_MM,
    BoundSkin,
    Finish,
    GltfFile,
    Skin,
    TornPiece,
    metres,
    organ_skin,
    skin_primitives,
    turned,
)

STRANDS = "strands"
"""Name of the mesh of a bed's strands."""
STRAND_FINISH = Finish((236, 226, 208), roughness=0.4)
# Largest error of a torn rim's vertices, over the organ's radius.
RIM_TOLERANCE = 2e-5
# Largest deviation of a driving point's transform from a rotation: joints have no shear.
RIGID = 1e-6
MOST_VERTICES = 300_000
"""Largest skin: viewers still animate it smoothly."""
# Scale of a hidden mesh: a duct is then half a micrometre long.
HIDDEN = 1e-5
LEAD = 5.0
"""mm behind the clamp at which a chain is anchored. Blender draws a bone whose next joint is nearer
than 4 mm as long as the bone before it, or a metre long if there is none."""


@dataclass(frozen=True, slots=True, eq=False)
class _Chain:
    """Joints, each a child of the one before."""

    # (J,) driving points that they follow; reversed in a piece held at the organ's end
    points: NDArray[np.intp]
    places: NDArray[np.float64]  # (J, 3) at rest, mm
    anchor: NDArray[np.float64]  # (3,) where the bone that they hang on begins, mm
    root: int  # number of the node above the chain
    joints: list[int]  # (J,) node numbers
    skin: int  # number of the glTF skin


class Rig(NamedTuple):
    """An organ that moves: what `rigged_organs` needs of each."""

    skin: Skin
    driving: DrivingPoints
    motions: Sequence[Motion]  # as many, and of the same names, for each organ of a file
    pieces: tuple[TornPiece, TornPiece] | None
    radius: float  # mm
    names: tuple[str, str, str] = NAMES  # of its mesh, and of its pieces'


def rigged_organ(
    skin: Skin,
    driving: DrivingPoints,
    motions: Sequence[Motion],
    pieces: tuple[TornPiece, TornPiece] | None = None,
    *,
    radius: float,
) -> bytes:
    """Return an organ as a binary glTF that moves."""
    return rigged_organs([Rig(skin, driving, motions, pieces, radius)])


def rigged_organs(rigs: Sequence[Rig]) -> bytes:
    """Return organs, each with its own rig, as one binary glTF that moves."""
    for rig in rigs:
        _check(rig)
    file = GltfFile()
    made = [_Rigged(file, rig) for rig in rigs]
    for number, motion in enumerate(rigs[0].motions):
        animation = _Animation(file)
        for each in made:
            each.animate(animation, number)
        nicks = [
            {"mesh": rig.names[0], **nick} for rig in rigs for nick in rig.motions[number].nicks()
        ]
        animation.close(motion.name, nicks)
    return file.content()


def rigged_tubes(tubes: Tubes) -> bytes:
    """Return tubes at rest as a binary glTF: each a mesh by its name, with its own rig."""
    rigs: list[Rig] = []
    for name, dissection in zip(tubes.names, tubes.dissections, strict=True):
        radius = dissection.organ.mean_radius
        skin = organ_skin(dissection.organ, edge_length=EDGE_FRACTION * radius)
        rigs.append(Rig(skin, dissection.driving, [], None, radius, (name, name, name)))
    return rigged_organs(rigs)


def _check(rig: Rig) -> None:
    if len(rig.skin.vertices) > MOST_VERTICES:
        raise ValueError(
            f"edge_length gives {len(rig.skin.vertices):,} vertices and viewers move at most "
            f"{MOST_VERTICES:,}; take a larger one, or export a still mesh"
        )
    if rig.pieces is None and not all(motion.whole.all() for motion in rig.motions):
        raise ValueError("a motion tears the organ and its pieces are not given")
    for motion in rig.motions:
        for piece in range(len(PIECES)):
            turns = np.eye(3) + motion.of_piece(piece).transforms[..., :3]
            if np.abs(np.swapaxes(turns, -1, -2) @ turns - np.eye(3)).max() > RIGID:
                raise ValueError(f"transforms of motion {motion.name!r} must be rigid")


class _Rigged:
    """An organ's meshes and joints in a file."""

    def __init__(self, file: GltfFile, rig: Rig) -> None:
        self._rig, motions, driving = rig, rig.motions, rig.driving
        first, last = _moving(motions) if motions else (0, len(driving.stations) - 1)
        named, *piece_names = rig.names
        self._whole = whole = _chain(file, named, driving, np.arange(first, last + 1), shown=True)
        mesh = _mesh(file, named, rig.skin.bound_to(driving), whole)
        file.add_root({"name": named, "mesh": mesh, "skin": whole.skin})
        self._torn: list[tuple[_Chain, int, RimShapes]] = []
        self._holder = whole.root
        for number, piece in enumerate(rig.pieces or ()):
            name, bound = piece_names[number], piece.skin.bound_to(driving)
            moved = [motion.of_piece(number) for motion in motions]
            rim = rim_shapes(piece, bound, moved, tolerance=RIM_TOLERANCE * rig.radius)
            start = min(max(first, bound.index.min()), bound.index.max())
            points = np.arange(start, max(start + 1, min(last, bound.index.max() + 1)) + 1)
            if number:
                points = points[::-1]  # it is held at the organ's end
            chain = _chain(file, name, driving, points, shown=False)
            mesh = _mesh(file, name, bound, chain, rim.shapes)
            file.extend("nodes", self._holder, {"mesh": mesh, "skin": chain.skin})
            self._torn.append((chain, self._holder, rim))
            self._holder = chain.root
        self._beds = [None if motion.bed is None else strand_mesh(motion.bed) for motion in motions]
        self._hung = whole  # what the strands' ends follow: once there are pieces, their own joints
        if motions and self._beds[0] is not None and motions[0].bed is not None:
            if self._torn:
                self._hung = _chain(file, STRANDS, driving, np.arange(first, last + 1), shown=True)
            mesh = _strands(file, self._beds[0], motions[0].bed, driving, self._hung)
            file.extend("nodes", self._holder, {"mesh": mesh, "skin": self._hung.skin})

    def animate(self, animation: "_Animation", number: int) -> None:
        """Add a motion, by its number, to an animation."""
        motion, driving = self._rig.motions[number], self._rig.driving
        animation.add_joints(self._whole, motion, motion.whole)
        torn_keys = ~motion.whole
        for piece, (chain, node, rim) in enumerate(self._torn):
            animation.add_joints(chain, motion.of_piece(piece), torn_keys)
            if torn_keys.any() and len(rim.shapes):
                # From the start on: Blender before 4.4 begins an action with its first key.
                times = np.append(motion.times[0], motion.times[torn_keys])
                weights = np.pad(rim.weights[number], ((1, 0), (0, 0)), mode="edge")
                new = np.append(True, np.diff(times) > 0.0)
                animation.add(node, "weights", times[new], weights[new].ravel())
        bed = self._beds[number]
        if bed is not None:
            later = np.append(np.diff(motion.times) > 0.0, True)  # no two keys at one time
            if self._hung is not self._whole:
                animation.add_joints(self._hung, motion.of_strands(driving), later)
            if len(bed.shapes):
                weights = bed.weights[later].ravel()
                animation.add(self._holder, "weights", motion.times[later], weights)
        if self._torn:
            animation.add_shown(self._whole, motion.times, motion.whole)
            for chain, _, _ in self._torn:
                animation.add_shown(chain, motion.times, torn_keys)


def _moving(motions: Sequence[Motion]) -> tuple[int, int]:
    """Return the driving points before the first that moves and after the last."""
    poses = [motion.of_piece(piece).transforms for motion in motions for piece in (0, 1)]
    moving = np.logical_or.reduce([pose.any(axis=(0, 2, 3)) for pose in poses])
    which = np.flatnonzero(moving)
    if not which.size:
        return 0, len(moving) - 1
    return max(int(which[0]) - 1, 0), min(int(which[-1]) + 1, len(moving) - 1)


def _chain(
    file: GltfFile, name: str, driving: DrivingPoints, points: NDArray[np.intp], *, shown: bool
) -> _Chain:
    """Add an anchor and a joint at each of some driving points, each a child of the one before."""
    places = driving.positions[points]
    along = (places[1] - places[0]) / np.linalg.norm(places[1] - places[0])
    anchor = places[0] - LEAD * along
    stands = metres(np.vstack([anchor, places]))
    steps = np.diff(stands, axis=0, prepend=np.zeros((1, 3), np.float32)).tolist()
    names = [f"{name}_anchor", *(f"{name}_joint_{number:03d}" for number in range(len(places)))]
    joints: list[int] = []
    for number in reversed(range(len(names))):
        joint: dict[str, Any] = {"name": names[number], "translation": steps[number]}
        if joints:
            joint["children"] = joints[:1]
        if number == 1 and not shown:
            joint["scale"] = [HIDDEN] * 3
        joints.insert(0, file.add("nodes", joint))
    root = file.add_root({"name": f"{name}_rig", "children": joints[:1]})
    inverse = np.tile(np.eye(4, dtype=np.float32), (len(stands), 1, 1))
    inverse[:, 3, :3] = -stands  # columns come one after the other
    binds = file.accessor(inverse.reshape(-1, 16), "MAT4")
    skin = file.add("skins", {"name": name, "joints": joints, "inverseBindMatrices": binds})
    return _Chain(points, places, anchor, root, joints[1:], skin)


def _mesh(
    file: GltfFile,
    name: str,
    bound: BoundSkin,
    chain: _Chain,
    shapes: NDArray[np.float32] | None = None,
) -> int:
    primitives: list[dict[str, Any]] = []
    for item, numbers in skin_primitives(file, bound.skin, bound.skin.vertices):
        item["attributes"] |= _binding(
            file, bound.index[numbers], bound.weight[numbers], chain.points
        )
        if shapes is not None and len(shapes):
            item["targets"] = [_target(file, shape[numbers]) for shape in shapes]
        primitives.append(item)
    return _mesh_of(file, name, primitives, 0 if shapes is None else len(shapes))


def _strands(
    file: GltfFile, strands: StrandMesh, bed: BedTrack, driving: DrivingPoints, chain: _Chain
) -> int:
    """Add strands between the bed, which is the chain's anchor, and the organ."""
    index, weight = bed.binding(driving, strands.stations)
    attributes = {
        "POSITION": file.accessor(
            metres(strands.vertices), "VEC3", target="vertices", bounded=True
        ),
        "NORMAL": file.accessor(turned(strands.normals), "VEC3", target="vertices"),
    }
    item: dict[str, Any] = {
        "attributes": attributes | _binding(file, index, weight, chain.points, strands.on_bed),
        "indices": file.indices(strands.faces, len(strands.vertices)),
        "material": file.material(STRAND_FINISH, STRANDS),
    }
    if len(strands.shapes):
        item["targets"] = [_target(file, shape) for shape in strands.shapes]
    return _mesh_of(file, STRANDS, [item], len(strands.shapes))


def _mesh_of(file: GltfFile, name: str, primitives: list[dict[str, Any]], shapes: int) -> int:
    mesh: dict[str, Any] = {"name": name, "primitives": primitives}
    if shapes:
        mesh["weights"] = [0.0] * shapes
    return file.add("meshes", mesh)


def _binding(
    file: GltfFile,
    index: NDArray[np.int32],
    weight: NDArray[np.float64],
    points: NDArray[np.intp],
    anchored: NDArray[np.bool_] | None = None,
) -> dict[str, int]:
    """Store the two joints that each of some vertices follows, and their weights."""
    numbers = np.empty(points.max() + 1, np.intp)
    numbers[points] = np.arange(len(points))
    followed = np.stack([index, index + 1], axis=1).clip(points.min(), points.max())
    after = np.rint(65535.0 * weight).astype(np.uint16)
    weights = np.zeros((len(index), 4), np.uint16)
    weights[:, 0], weights[:, 1] = 65535 - after, after
    # Beyond the outermost joint both are that one, but glTF allows each joint only once a vertex.
    same = followed[:, 0] == followed[:, 1]
    joints = np.zeros((len(index), 4), np.uint8 if len(points) < 256 else np.uint16)
    joints[:, :2] = 1 + numbers[followed]
    if anchored is not None:
        joints[anchored, 0] = 0
        same = same | anchored
    weights[same, :2] = 65535, 0
    # glTF wants joint 0, which is the anchor, where the weight is zero.
    joints[weights == 0] = 0
    return {
        "JOINTS_0": file.accessor(joints, "VEC4", target="vertices"),
        "WEIGHTS_0": file.accessor(weights, "VEC4", target="vertices", normalized=True),
    }


def _target(file: GltfFile, shape: NDArray[np.float32]) -> dict[str, int]:
    """Store a displacement of the wall's vertices as a morph target."""
    moved = metres(shape)
    where = np.flatnonzero(moved.any(axis=1)).astype(np.uint32)
    where = where if where.size else np.zeros(1, np.uint32)
    return {"POSITION": file.sparse_accessor(len(moved), where, moved[where])}


def _quaternions(turns: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return (..., 4) unit quaternions x, y, z, w, each of the sign nearest to the one before."""
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
    """One animation while it is put together."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._samplers: list[dict[str, Any]] = []
        self._channels: list[dict[str, Any]] = []

    def add(self, node: int, path: str, times: NDArray[np.float64], values: NDArray[Any]) -> None:
        """Animate a node's property by linear interpolation between keys."""
        kind = "SCALAR" if path == "weights" else "VEC3"
        self._add(node, path, self._times(times), self._file.accessor(values, kind), "LINEAR")

    def add_joints(self, chain: _Chain, motion: Motion, keys: NDArray[np.bool_]) -> None:
        """Animate a chain's joints by their driving points, at some keys of a motion."""
        if not keys.any():
            return
        clock = self._times(motion.times[keys])
        transforms = motion.transforms[keys][:, chain.points]
        changes, shifts = transforms[..., :3], transforms[..., 3]
        places = chain.places + np.einsum("tjik,jk->tji", changes, chain.places) + shifts
        into = 1e3 * GLTF_FROM_MM
        turns = into @ (np.eye(3) + changes) @ into.T
        # Relative to each joint's parent; the anchor does not rotate.
        back = np.swapaxes(turns, -1, -2)
        back = np.concatenate([np.broadcast_to(np.eye(3), back[:, :1].shape), back[:, :-1]], axis=1)
        before = np.broadcast_to(chain.anchor, places[:, :1].shape)
        steps = np.diff(places, axis=1, prepend=before) @ GLTF_FROM_MM.T
        steps = np.einsum("tjik,tjk->jti", back, steps).astype(np.float32)
        rotations = np.swapaxes(_quaternions(back @ turns), 0, 1)
        for joint, translation, rotation in zip(
            chain.joints,
            self._file.accessors(steps, "VEC3"),
            self._file.accessors(rotations, "VEC4"),
            strict=True,
        ):
            self._add(joint, "translation", clock, translation, "LINEAR")
            self._add(joint, "rotation", clock, rotation, "LINEAR")

    def add_shown(self, chain: _Chain, times: NDArray[np.float64], keys: NDArray[np.bool_]) -> None:
        """Show a chain's mesh from its own keys on, and hide it from the others' on."""
        # Where the organ comes apart two keys have one time; the pieces' key counts.
        last = np.append(np.diff(times) > 0.0, True)
        times, keys = times[last], keys[last]
        change = np.append(True, keys[1:] != keys[:-1])
        scales = np.repeat(np.where(keys[change], 1.0, HIDDEN)[:, np.newaxis], 3, axis=1)
        clock = self._times(times[change])
        self._add(
            chain.joints[0],
            "scale",
            clock,
            self._file.accessor(scales.astype(np.float32), "VEC3"),
            "STEP",
        )

    def close(self, name: str, nicks: Sequence[Mapping[str, object]]) -> None:
        """Write the animation to the file, with the walls that tear in part, if any does."""
        item: dict[str, Any] = {
            "name": name,
            "samplers": self._samplers,
            "channels": self._channels,
        }
        if nicks:
            item["extras"] = {"nicks": nicks}
        self._file.add("animations", item)

    def _times(self, times: NDArray[np.float64]) -> int:
        return self._file.accessor(times.astype(np.float32), "SCALAR", bounded=True)

    def _add(self, node: int, path: str, clock: int, output: int, interpolation: str) -> None:
        sampler = {"input": clock, "output": output, "interpolation": interpolation}
        self._samplers.append(sampler)
        self._channels.append(
            {"sampler": len(self._samplers) - 1, "target": {"node": node, "path": path}}
        )
