"""Drag proxies: invisible meshes by which a mouse picks and drags the duct or an instrument.

The duct itself is sent again at every frame, so viser cannot pick it. A coarse, transparent tube
inside it follows it instead, and others are about the instruments.
"""

import asyncio
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import viser
from numpy.typing import NDArray

from app.simulation import Dissection
from app.trainer.stage.drawn import add_mesh
from app.trainer.stage.solids import Solid, grid_faces
from app.trainer.stage.strands import differ
from app.trainer.viser_bridge.fast_transport import stream
from organ_geometry.mesh import Skin

RINGS, SIDES = 25, 8
SLACK = 1.0
"""mm that the duct moves before its tube is sent again: less than anybody can aim."""
SWITCH_SECONDS = 0.25
"""s after the end of a drag in which another with Shift, or without it, goes on with it."""
# The tube's radius over the duct's: inside it, the tube covers nothing, but can be picked. The page
# also accepts a press some pixels beside it (`viser_bridge`).
SHRUNK = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class Hold:
    """What a mouse holds, and where it is, in the frame of the duct, which is the stage's too."""

    # mm along the duct from its first clamp to the grab; None for an instrument
    station: float | None
    start: NDArray[np.float64]  # (3,) where it was grabbed, mm
    # (3,) the mouse now, mm, in the upright plane along the duct through `start`
    place: NDArray[np.float64]
    hand: int | None = None  # number of the instrument; None for the duct

    @property
    def moved(self) -> NDArray[np.float64]:
        """(3,) displacement of the hand since the grab, mm."""
        return self.place - self.start


_Start = Callable[[NDArray[np.float64], NDArray[np.float64]], Hold]
"""Gives the hold of a drag from where it was grabbed and where the mouse is, (3,) mm."""


class _Tube:
    """The coarse tube inside one surface of a duct, whole or torn."""

    def __init__(
        self, scene: viser.SceneApi, name: str, skin: Skin, dissection: Dissection
    ) -> None:
        self._dissection = dissection
        rings = np.linspace(0, skin.rings - 1, min(RINGS, skin.rings)).round().astype(int)
        self._ring_vertices = rings[:, None] * skin.sides + np.arange(skin.sides)
        self._drawn = self._ring_vertices[:, np.arange(SIDES) * skin.sides // SIDES].ravel()
        self._stations = skin.grid(skin.stations)[rings].mean(axis=1) - dissection.clamps[0]
        faces = grid_faces(len(rings), SIDES, closed=True)
        self.mesh = add_mesh(scene, name, self._places(skin.vertices), faces, **_UNSEEN)

    def follow(self, vertices: NDArray[np.float32]) -> None:
        self._vertices = vertices  # which each frame overwrites
        if differ(vertices[self._drawn].reshape(-1), self._at.reshape(-1), SLACK):
            stream(self.mesh, "vertices", self._places(vertices))

    def _places(self, vertices: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the tube's vertices inside a deformed skin."""
        self._vertices, self._at = vertices, vertices[self._drawn]
        axis = self._axis()[:, None]
        shown = axis + SHRUNK * (self._at.reshape(len(axis), -1, 3) - axis)
        return shown.reshape(-1, 3).astype(np.float32)

    def _axis(self) -> NDArray[np.float32]:
        """Return the middles of the rings, where they are now."""
        return self._vertices[self._ring_vertices].mean(axis=1)

    def hold(self, grip: NDArray[np.float64], place: NDArray[np.float64]) -> Hold:
        """Return a hold on the duct at the station nearest to the grip."""
        axis, dissection = self._axis(), self._dissection
        in_organ = dissection.axis_point(0.0) + dissection.frame @ grip
        spans = np.diff(axis, axis=0)
        along = np.sum((in_organ - axis[:-1]) * spans, axis=1) / np.sum(spans**2, axis=1)
        fraction = np.clip(along, 0.0, 1.0)
        nearest = axis[:-1] + fraction[:, None] * spans
        segment = int(np.argmin(np.sum((in_organ - nearest) ** 2, axis=1)))
        before, after = self._stations[segment : segment + 2].tolist()
        return Hold(before + float(fraction[segment]) * (after - before), grip, place)


class DragProxy:
    """What one client's mouse can drag.

    `grabbed` is called with the hold when a drag starts, `moved` whenever the hand has moved,
    `released` when the hand lets go or the duct cannot be held any more. They run in order on the
    server's event loop, some twenty times a second, so they must only write inputs. `in_depth`
    says whether what is held can also be led across that plane; it is set before what it is for.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        *,
        grabbed: Callable[[Hold], None],
        moved: Callable[[Hold], None],
        released: Callable[[], None],
    ) -> None:
        self._client, self.in_depth = client, False
        self._grabbed, self._moved, self._released = grabbed, moved, released
        self._tubes: list[_Tube] = []
        self._instruments: dict[str, tuple[int, viser.MeshHandle]] = {}
        self._hold: Hold | None = None
        self._depth = False  # whether the last drag was one into the picture
        self.swapped = False  # whether drags go into the picture, and those with Shift do not
        self._ending: asyncio.TimerHandle | None = None

    def set_duct(self, skins: Sequence[Skin], dissection: Dissection) -> None:
        """Let a dissection's duct be dragged by its skins, whole or torn."""
        self._remove_tubes()
        for number, skin in enumerate(skins):
            name = f"/organ/grip_{number}" if number else "/organ/grip"
            tube = _Tube(self._client.scene, name, skin, dissection)
            self._tubes.append(tube)
            self._listen(tube.mesh, tube.hold)

    def set_instrument(self, hand: int, node: str, solid: Solid) -> None:
        """Let a hand's instrument, a scene node, be dragged by a solid in the node's frame."""
        scene = self._client.scene
        mesh = add_mesh(scene, f"{node}/grip", solid.vertices, solid.faces, **_UNSEEN)
        self._instruments[node] = hand, mesh
        self._listen(mesh, lambda grip, place: Hold(None, grip, place, hand))

    def forget_instrument(self, node: str) -> None:
        """Let an instrument be dragged no more; an ongoing drag of it is released."""
        hand, mesh = self._instruments.pop(node)
        mesh.remove()
        if self._hold is not None and self._hold.hand == hand:
            self._hold = None
            self._released()

    def follow(self, surfaces: Sequence[NDArray[np.float32]]) -> None:
        """Move the tubes with the duct."""
        for tube, vertices in zip(self._tubes, surfaces, strict=True):
            tube.follow(vertices)

    def let_go(self) -> None:
        """Let nothing be dragged until something is set again; an ongoing drag is released."""
        self._remove_tubes()
        for node in list(self._instruments):
            self.forget_instrument(node)
        if self._hold is not None:
            self._hold = None
            self._released()

    def _remove_tubes(self) -> None:
        for tube in self._tubes:
            tube.mesh.remove()
        self._tubes = []

    def _listen(self, mesh: viser.MeshHandle, start: _Start) -> None:
        self._lead(mesh, start, button="left", modifier=None)
        if self.in_depth:
            self._lead(mesh, start, button="left", modifier="shift", depth=True)
            self._lead(mesh, start, button="right", modifier=None, depth=True)

    def _lead(
        self,
        mesh: viser.MeshHandle,
        start: _Start,
        *,
        button: Literal["left", "right"],
        modifier: Literal["shift"] | None,
        depth: bool = False,
    ) -> None:
        """Let a button lead what it takes of a mesh; with `depth`, up is into the picture."""
        # viser ends a drag when Shift is pressed or released within it, and starts another one a
        # moment later: that one goes on with what is held, from where it was.
        begun = at = np.zeros(3)
        into = depth

        @mesh.on_drag(button, modifier=modifier)
        async def _(event: viser.SceneNodeDragEvent[viser.MeshHandle]) -> None:
            nonlocal begun, at, into
            if not all(map(math.isfinite, event.end_position)):
                return
            hand = np.array(event.end_position, np.float64)
            if event.phase == "start":
                into = depth != self.swapped
                going_on = self._hold if self._ending is not None and into != self._depth else None
                self._end_now(released=going_on is None)
                self._depth = into
                grip = np.array(event.start_position, np.float64)
                begun, at = hand, grip
                if going_on is not None:
                    at = going_on.place
                    return
                place = grip if into else self._place_of(hand, grip)
                self._hold = start(grip, place)
                at = at if into else place
                self._grabbed(self._hold)
            elif self._hold is not None:
                held = self._hold
                if into:
                    place = at + self._into_picture(hand - begun)
                else:
                    place = at + self._place_of(hand, at) - self._place_of(begun, at)
                self._hold = Hold(held.station, held.start, place, held.hand)
                if event.phase != "end":
                    self._moved(self._hold)
                elif self.in_depth:
                    self._ending = asyncio.get_running_loop().call_later(
                        SWITCH_SECONDS, self._end_now
                    )
                else:
                    self._end_now()

    def _end_now(self, *, released: bool = True) -> None:
        """Release what is held, if a drag of it has ended; or let another drag go on with it."""
        if self._ending is not None:
            self._ending.cancel()
            self._ending = None
        if released and self._hold is not None:
            self._hold = None
            self._released()

    def _into_picture(self, moved: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the way into the picture, across the duct, for one up in the screen's plane."""
        eye = self._client.camera
        sight = np.asarray(eye.look_at) - np.asarray(eye.position)
        above = (0.0, 0.0, 1.0) - sight * sight[2] / (sight @ sight)
        size = float(np.linalg.norm(above))
        return np.array([0.0, float(moved @ above) / size if size > _LEAST_FACING else 0.0, 0.0])

    def _place_of(
        self, hand: NDArray[np.float64], through: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the place under the mouse in the upright plane along the duct through a place."""
        # viser gives the hand's place on a plane that faces the camera. The line of sight through
        # it intersects the upright plane at the place that the user points at: so up in the picture
        # is straight up off the bed, however far down the camera looks.
        eye = np.asarray(self._client.camera.position, np.float64)
        sight = hand - eye
        if abs(sight[1]) < _LEAST_FACING * float(np.linalg.norm(sight)):  # it is seen edge-on
            return hand
        return eye + sight * ((through - eye)[1] / sight[1])


_LEAST_FACING = 0.3  # sine of the line of sight to the plane; below it, the hand would jump
_UNSEEN: dict[str, Any] = {"color": (255, 255, 255), "opacity": 0.0, "side": "double"}
