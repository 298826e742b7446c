"""A duct on its stage, between its clamps: what the scenes of pulling and dissecting share."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from weakref import WeakMethod

import numpy as np
import viser
from numpy.typing import NDArray
from viser import transforms

from app.simulation import Preset, Session
from app.trainer.scene.drag_proxy import DragProxy, Hold
from app.trainer.stage.appearance import Appearance, appearance_of, drawn_radius
from app.trainer.stage.camera import ELEVATION
from app.trainer.stage.contact import Contact
from app.trainer.stage.lighting import Look
from app.trainer.stage.plain_tissue import PlainTissue
from app.trainer.stage.stage import Stage
from app.trainer.stage.tissue import Tissue, cut_end, send_finish
from app.trainer.stage.wall_texture import mean_color
from organ_geometry import Organ
from organ_geometry.mesh import Surface

__all__ = ["DrawnSurface", "DuctOnStage"]

# Relative change of span and radius too small to be seen: a megabyte need not be sent for it.
SAME_STAGE = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class DrawnSurface:
    """A surface of the session, the marks of the instruments on it, and how it is drawn."""

    surface: Surface
    contact: Contact
    tissue: Tissue | PlainTissue


class DuctOnStage:
    """One client's picture of its session; the look is "plain" for slow machines."""

    in_screen = False  # whether a drag moves in the screen's plane, or in that of the pull
    elevation = ELEVATION  # of the camera, rad
    stage_hook = True  # whether the stage has the hook

    def __init__(self, client: viser.ClientHandle, session: Session, look: Look) -> None:
        self._client, self._session = client, session
        self._look: Look = look
        self._stage: Stage | None = None
        self._drawn: list[DrawnSurface] = []
        self._shape = -1
        self._divided = False  # whether no clamp holds the duct's far end
        self._clamps: tuple[float, float] | None = None
        self._organ: Organ | None = None
        self._preset: Preset | None = None
        self._first = np.zeros(3)  # the organ's axis at the first clamp
        self._arch = 0.0
        self._hand: DragProxy | None = None
        self._finish: tuple[Appearance, float] | None = None
        # Once for the client, not for each stage: viser keeps callbacks as long as the client.
        # It does not keep a scene that has been removed.
        moved = WeakMethod(self._camera_moved)

        def camera_moved(camera: viser.CameraHandle) -> None:
            if (follow := moved()) is not None:
                follow(camera)

        client.camera.on_update(camera_moved)

    def _camera_moved(self, camera: viser.CameraHandle) -> None:
        if self._stage is not None:
            self._stage.camera_moved(camera.client)

    def watch(self, session: Session) -> None:
        """Show another session of the same organ from the next `draw` on."""
        if session is not self._session:
            self._session, self._shape = session, -1

    def set_look(self, look: Look) -> None:
        """Use another look from the next `draw` on."""
        if look == self._look:
            return
        self._look = look
        self._finish = None
        self._clear()

    def remove(self) -> None:
        """Remove everything from the scene; the next `draw` builds it anew."""
        self._clear()
        for drawn in self._drawn:
            drawn.tissue.remove()
        self._drawn = []

    def _clear(self) -> None:
        self._shape = -1  # another thread may have set a new duct, but not its surfaces yet
        if self._hand is not None:
            self._hand.let_go()
        if self._stage is not None:
            self._stage.remove()
            self._stage = None

    def let_drag(
        self,
        grabbed: Callable[[Hold], None],
        moved: Callable[[Hold], None],
        released: Callable[[], None],
    ) -> None:
        """Let the mouse drag the duct and the instruments, from the next `draw` on."""
        self._hand = DragProxy(
            self._client,
            in_screen=self.in_screen,
            grabbed=grabbed,
            moved=moved,
            released=released,
        )
        self._offer_hand()

    def _offer_hand(self) -> None:
        """Let the mouse hold the duct as it is drawn now, whole or in pieces."""
        hand, dissection = self._hand, self._session.tissue.dissection
        if hand is None:
            return
        hand.let_go()
        hand.set_duct([drawn.surface.skin for drawn in self._drawn], dissection)
        self._offer_instruments(hand)
        hand.follow([drawn.contact.vertices for drawn in self._drawn])

    def _offer_instruments(self, hand: DragProxy) -> None:
        raise NotImplementedError

    def frame_camera(self) -> None:
        """Keep both clamps in the client's picture."""
        self._set_stage().frame_camera(self._client)

    @property
    def _radius(self) -> float:
        """Radius of the duct as it is drawn, mm."""
        return drawn_radius(self._session.tissue.dissection)

    def _show(self, stress: Sequence[NDArray[np.float32]] | None) -> None:
        """Send the surfaces with their marks, as tissue or by the values at their vertices."""
        if self._hand is not None:
            self._hand.follow([drawn.contact.vertices for drawn in self._drawn])
        for number, drawn in enumerate(self._drawn):
            contact = drawn.contact
            if stress is None:
                drawn.tissue.show(contact.vertices, contact.shade)
            else:
                drawn.tissue.show_stress(contact.vertices, stress[number])

    def _set_stage(self) -> Stage:
        """Return the stage for the session's clamps; a new one if they have moved."""
        dissection = self._session.tissue.dissection
        organ, clamps = dissection.organ, dissection.clamps
        preset = dissection.preset
        shown = self._organ is organ and (self._clamps, self._preset) == (clamps, preset)
        if self._stage is not None and shown:
            return self._stage
        self._organ, self._clamps, self._preset = organ, clamps, preset
        appearance = appearance_of(preset)
        first, last = dissection.organ.axis_at(np.array(dissection.clamps))
        self._first = first
        span = float(np.linalg.norm(last - first))
        axis = dissection.organ.axis_at(np.linspace(*dissection.clamps, 41)) - first
        self._arch = max(0.0, float((axis @ dissection.frame[:, 2]).max()))
        radius = self._radius
        if self._stage is not None and not (
            math.isclose(span, self._stage.span, rel_tol=SAME_STAGE)
            and math.isclose(radius, self._stage.radius, rel_tol=SAME_STAGE)
            and appearance == self._stage.appearance
        ):
            self._clear()
        if self._stage is None:
            self._stage = Stage(
                self._client.scene,
                span=span,
                radius=radius,
                appearance=appearance,
                look=self._look,
                elevation=self.elevation,
                hook=self.stage_hook,
            )
            self._stage.frame_camera(self._client)
        # The browser compiles a shader when the camera first sees what uses it.
        self._client.scene.add_frame(
            "/finish", show_axes=False, position=(0.5 * self._stage.span, 0.0, 0.0)
        )
        # The organ is in its images' coordinates; the stage has the first clamp at the origin.
        turn = transforms.SO3.from_matrix(dissection.frame.T)
        self._client.scene.add_frame(
            "/organ", show_axes=False, wxyz=turn.wxyz, position=turn.apply(-first)
        )
        return self._stage

    def _set_surfaces(self) -> None:
        """Draw the session's present surfaces, if they are others than those drawn."""
        if self._session.drawn.shape == self._shape:
            return
        self._shape = self._session.drawn.shape
        for drawn in self._drawn:
            drawn.tissue.remove()
        dissection, scene = self._session.tissue.dissection, self._client.scene
        radius = self._radius
        look = appearance_of(dissection.preset)
        if self._look == "full" and self._finish != (look, radius):
            self._finish = look, radius
            send_finish(scene, look, radius)
        self._drawn = []
        for surface in self._session.drawn.surfaces:
            name, divided = surface.name, self._divided
            contact = Contact.of(dissection, surface.skin, divided=divided)
            if self._look == "full":
                tissue = Tissue.of(scene, name, contact, dissection, divided=divided)
            else:
                tissue = PlainTissue(
                    scene,
                    f"/organ/{name}",
                    contact,
                    radius=radius,
                    color=mean_color(look),
                    torn_end=cut_end(name, divided=divided),
                )
            self._drawn.append(DrawnSurface(surface, contact, tissue))
        self._offer_hand()
