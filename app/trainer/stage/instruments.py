"""Instruments of a dissection besides the hook: grasper, dissector and swab.

Each is drawn in a frame of its own whose origin is the hand's tip: a grasper's on the duct's axis
between its jaws, a dissector's between the ends of its jaws, a swab's at the end of its ball. What
meets tissue has the place, direction and radius of the rods that are solved; what is behind leans
out of the picture, to the right for the first hand and to the left for the second.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import viser
from numpy.typing import NDArray

from app.simulation import JAW_RADIUS, SWAB_RADIUS, TOWARDS_HAND, Hand, Instrument
from app.trainer.stage.clamps import INSULATION, steel
from app.trainer.stage.drawn import add_mesh, add_model
from app.trainer.stage.hook import SHAFT_LENGTH, grip_solid, hook_glb
from app.trainer.stage.lighting import Look
from app.trainer.stage.solids import (
    Piece,
    Solid,
    smooth_path,
    solids_glb,
    swept_solid,
)
from app.trainer.viser_bridge.fast_transport import place_node
from app.trainer.viser_bridge.page import run_function
from organ_geometry.mesh import Finish

SHAFT_RADIUS = 2.25
GRASPER_LEAN, DISSECTOR_LEAN = np.array([0.50, 0.22, 0.84]), np.array([0.72, -0.58, 0.38])
# Directions of the shafts of the first hand's instruments, not of unit length.
SWAB_LEAN = np.array([0.66, 0.0, 0.75])
# Height of a grasper's hinge over the duct's axis, in radii.
HINGE = 2.7
# Length of a dissector's jaws that runs as the rods do, mm.
STRAIGHT = 13.0
GAUZE = Finish(color=(226, 214, 204), roughness=1.0, specular=0.1)
# Length of a swab's ball, in its radii.
BALL = 2.5
# By which each jaw of an empty grasper is turned outwards, rad.
OPEN_TURN = 0.28
GAP = 2.1
"""Distance of a closed dissector's axes, in radii of its jaws."""
_STATIONS = 40


class DrawnInstrument:
    """A hand's instrument on one client's scene: the scene node `name` and what is under it.

    It is made for a duct of `duct_radius`, mm; `mirrored`, its shaft leans to the left, as the
    second hand's; "plain" is the `look` for slow machines.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        instrument: Instrument,
        *,
        duct_radius: float,
        mirrored: bool,
        look: Look,
    ) -> None:
        self.instrument, self.name = instrument, name
        self._jaws: Jaws | None = None
        self._halves: list[viser.FrameHandle] = []
        self._node = scene.add_frame(name, show_axes=False)
        self._holds: bool | None = None
        detail = 1.0 if look == "full" else 0.5

        if instrument == "hook":
            add_model(scene, f"{name}/wire", hook_glb(duct_radius, detail=detail))
            self.grip = grip_solid(duct_radius)
        elif instrument == "grasper":
            hinge = HINGE * duct_radius
            shaft = grasper_shaft_glb(duct_radius, mirrored, detail=detail)
            add_model(scene, f"{name}/hinge", shaft, position=(0.0, 0.0, hinge))
            for side, turn in (("near", 0.0), ("far", np.pi)):
                half = scene.add_frame(
                    f"{name}/{side}", show_axes=False, position=(0.0, 0.0, hinge)
                )
                self._halves.append(half)
                add_model(
                    scene,
                    f"{name}/{side}/jaw",
                    grasper_jaw_glb(duct_radius, detail=detail),
                    wxyz=(np.cos(0.5 * turn), 0.0, 0.0, np.sin(0.5 * turn)),
                )
            back = np.array([0.0, 0.0, hinge]) + 25.0 * _leaning(GRASPER_LEAN, mirrored)
            self.grip = _grip([np.zeros(3), np.array([0.0, 0.0, hinge]), back], duct_radius)
        elif instrument == "dissector":
            self._jaws = Jaws(scene, name, radius=JAW_RADIUS, mirrored=mirrored, detail=detail)
            joint = np.array([0.0, -STRAIGHT - 11.0, 1.5])
            back = joint + 25.0 * _leaning(DISSECTOR_LEAN, mirrored)
            self.grip = _grip([np.zeros(3), joint, back], 2.5 * JAW_RADIUS)
        else:
            swab = swab_glb(TOWARDS_HAND["swab"], SWAB_RADIUS, mirrored, detail=detail)
            add_model(scene, f"{name}/ball", swab)
            ball = BALL * SWAB_RADIUS * np.array(TOWARDS_HAND["swab"])
            back = ball + 25.0 * _leaning(SWAB_LEAN, mirrored)
            self.grip = _grip([np.zeros(3), ball, back], SWAB_RADIUS)

    def show(self, hand: Hand, *, sunk: float = 0.0) -> None:
        """Draw it where the hand has it, a hook `sunk` into the wall, mm."""
        x, y, z = hand.place.tolist()
        place_node(self._node, x, y, z + sunk)
        if self._jaws is not None:
            self._jaws.open(hand.opening + GAP * self._jaws.radius)
        holds = hand.node is not None
        if self._halves and holds is not self._holds:
            self._holds = holds
            turn = 0.5 * (0.0 if holds else OPEN_TURN)
            for half, sign in zip(self._halves, (-1.0, 1.0), strict=True):
                half.wxyz = (np.cos(turn), np.sin(sign * turn), 0.0, 0.0)

    def remove(self) -> None:
        """Remove it from the scene."""
        self._node.remove()


@lru_cache(maxsize=16)
def grasper_jaw_glb(radius: float, *, detail: float = 1.0) -> bytes:
    """Return the jaw on the viewer's side, as a GLB file, mm, its origin in the hinge."""
    # A bar that runs down from the hinge, around a window that the wall bulges into, and back.
    corners = max(8, round(14 * detail))
    wide, low = 0.46 * radius, -(HINGE + 0.42) * radius
    side = np.array(
        [
            [0.10 * radius, 0.0, 0.15 * radius],
            [0.13 * radius, 0.0, -0.6 * radius],
            [0.9 * wide, 0.0, -1.35 * radius],
            [wide, 0.0, 0.5 * (low - 1.35 * radius)],
            [0.92 * wide, 0.0, low + 0.45 * radius],
        ]
    )
    knots = [*side, np.array([0.0, 0.0, low]), *(side[::-1] * (-1.0, 1.0, 1.0))]
    path = smooth_path(knots, max(36, round(72 * detail)))
    # The section of a duct is round: below the hinge the jaw bows about it.
    depth = path[:, 2] + HINGE * radius
    bow = np.sqrt(np.maximum(1.0 - (depth / radius) ** 2, 0.0)) * radius + 0.06 * radius
    open_ = np.interp(path[:, 2], [-1.5 * radius, -0.2 * radius], [0.62 * radius, 0.12 * radius])
    path[:, 1] = -np.maximum(bow, open_)
    return solids_glb(
        [
            Piece(
                swept_solid(
                    path,
                    np.interp(path[:, 2], [low, -1.4 * radius, 0.0], [0.13, 0.12, 0.17]) * radius,
                    0.10 * radius,
                    side=(1.0, 0.0, 0.0),
                    squareness=0.25,
                    corners=corners,
                ),
                steel(detail),
            )
        ]
    )


@lru_cache(maxsize=16)
def grasper_shaft_glb(radius: float, mirrored: bool, *, detail: float = 1.0) -> bytes:
    """Return the hinge and the shaft, as a GLB file, mm, the origin in the hinge."""
    axis = _leaning(GRASPER_LEAN, mirrored)
    pin = np.array([[-0.26, 0, 0], [0, 0, 0], [0.26, 0, 0]]) * radius
    pieces = [Piece(swept_solid(pin, 0.2 * radius, side=(0, 0, 1), corners=16), steel(detail))]
    return solids_glb([*pieces, *_shaft(np.zeros(3), axis, 0.22 * radius, detail)])


@lru_cache(maxsize=16)
def swab_glb(
    axis: tuple[float, float, float], radius: float, mirrored: bool, *, detail: float = 1.0
) -> bytes:
    """Return a swab whose ball ends at the origin, mm, and lies back along `axis` from there."""
    back = np.array(axis) / np.linalg.norm(axis)
    along = np.linspace(0.0, 1.0, 24)
    path = (0.02 + BALL * radius * along)[:, None] * back
    ball = radius * np.minimum(
        1.0, np.sqrt(np.maximum(1.0 - (np.abs(along - 0.42) / 0.62) ** 2.6, 0.12))
    )
    gauze = swept_solid(path, ball, corners=max(12, round(28 * detail)), cap_rings=7)
    # Folds of the gauze.
    angle = np.arctan2(*(gauze.normals @ _across(back).T).T)
    height = gauze.vertices @ back
    folds = 0.05 * np.sin(3.0 * angle + 1.9 * height) + 0.03 * np.sin(7.0 * angle - 2.7 * height)
    gauze = Solid(
        gauze.vertices + (folds - 0.05)[:, None] * gauze.normals, gauze.faces, gauze.normals
    )
    return solids_glb(
        [
            Piece(gauze, GAUZE),
            *_shaft(0.75 * BALL * radius * back, _leaning(SWAB_LEAN, mirrored), 0.6, detail),
        ]
    )


class Jaws:
    """A dissector's two jaws, the scene nodes `name`/left, /right and /shaft under its frame."""

    def __init__(
        self, scene: viser.SceneApi, name: str, *, radius: float, mirrored: bool, detail: float
    ) -> None:
        self.radius, self._mirrored = radius, mirrored
        self._corners = max(8, round(14 * detail))
        self._opening = -1.0
        self._meshes: list[viser.MeshHandle] = []
        finish = steel(detail)
        gloss = {"roughness": finish.roughness, "metalness": finish.metallic}
        for node, side in ((f"{name}/left", -1.0), (f"{name}/right", 1.0)):
            solid = self._solid(0.0, side)
            mesh = add_mesh(scene, node, solid.vertices, solid.faces, color=finish.color)
            self._meshes.append(mesh)
            run_function(scene, "bluntdissectStrands.polish", node, gloss)
        axis = _leaning(DISSECTOR_LEAN, mirrored)
        joint = self._middle(0.0, 0.0)[-1]
        shaft = solids_glb(_shaft(joint - 1.5 * axis, axis, 1.5, detail))
        add_model(scene, f"{name}/shaft", shaft)

    def open(self, apart: float) -> None:
        """Draw the jaws with their axes `apart`, mm."""
        if apart == self._opening:
            return
        self._opening = apart
        for mesh, side in zip(self._meshes, (-1.0, 1.0), strict=True):
            mesh.vertices = self._solid(apart, side).vertices.astype(np.float32)

    def _solid(self, apart: float, side: float) -> Solid:
        """Return a jaw, of a round section that thins out towards its end."""
        path = self._middle(0.5 * apart, side)
        at = np.linspace(0.0, 1.0, len(path))
        radii = self.radius * np.interp(at, [0.0, 0.08, 0.5, 1.0], [0.72, 1.0, 1.0, 1.25])
        return swept_solid(path, radii, side=(1.0, 0.0, 0.0), corners=self._corners)

    def _middle(self, aside: float, side: float) -> NDArray[np.float64]:
        """Return the middle of a jaw: as the rod runs, then to the joint with the other one."""
        axis = _leaning(DISSECTOR_LEAN, self._mirrored)
        x, tip = side * aside, 0.72 * self.radius
        joint = np.array([0.0, -STRAIGHT - 11.0, 1.5]) + 9.0 * axis
        knots = [
            [x, -tip, 0.0],
            [x, -0.5 * STRAIGHT, 0.0],
            [x, -STRAIGHT, 0.0],
            [0.86 * x, -STRAIGHT - 4.5, 0.25],
            (np.array([0.45 * x, -STRAIGHT - 9.0, 1.0]) + 2.0 * axis).tolist(),
            joint.tolist(),
        ]
        return smooth_path(knots, _STATIONS)


def _grip(path: Sequence[NDArray[np.float64]], radius: float) -> Solid:
    """Return a coarse bar along an instrument, for a mouse to pick."""
    return swept_solid(np.array(path), radius, corners=6, cap_rings=1)


def _leaning(lean: NDArray[np.float64], mirrored: bool) -> NDArray[np.float64]:
    return lean / np.linalg.norm(lean) * (np.array([-1.0, 1.0, 1.0]) if mirrored else 1.0)


def _across(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (2, 3) unit vectors at right angles to a direction and to one another."""
    side = np.cross(axis, (1.0, 0.0, 0.0))
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(axis, side)])


def _shaft(
    root: NDArray[np.float64], axis: NDArray[np.float64], neck: float, detail: float
) -> list[Piece]:
    """Return a ferrule that widens from the neck, and the insulated shaft behind it."""
    corners = max(10, round(20 * detail))
    taper = np.linspace(0.0, 1.0, 14)
    swelling = taper * taper * (3.0 - 2.0 * taper)
    ferrule = root + (8.0 * taper)[:, None] * axis
    shaft = root + np.array([[7.4], [7.8], [14.0], [60.0], [SHAFT_LENGTH]]) * axis
    return [
        Piece(
            swept_solid(ferrule, neck + (0.88 * SHAFT_RADIUS - neck) * swelling, corners=corners),
            steel(detail),
        ),
        Piece(
            swept_solid(shaft, [0.93 * SHAFT_RADIUS, *[SHAFT_RADIUS] * 4], corners=corners),
            INSULATION,
        ),
    ]
