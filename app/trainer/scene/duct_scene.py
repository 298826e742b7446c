"""The scene: the duct of one client between its clamps, and the hook that pulls it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import NDArray
from viser import transforms

from app.simulation import Phase, Preset, Reading, Session
from app.trainer.scene.drag_proxy import DragProxy, Hold
from app.trainer.stage.appearance import Appearance, appearance_of, drawn_lumen, drawn_radius
from app.trainer.stage.contact import Contact, HookPlace, sink
from app.trainer.stage.lighting import Look
from app.trainer.stage.plain_tissue import PlainTissue
from app.trainer.stage.stage import Stage
from app.trainer.stage.tissue import Tissue, TornEnd, send_finish
from app.trainer.stage.wall_texture import mean_color
from organ_geometry import Organ
from organ_geometry.mesh import Surface

__all__ = ["DuctScene"]

SAME_STAGE = 0.01
"""Relative change of span and radius too small to be seen: a megabyte need not be sent for it."""
LIFT_AFTER_TEAR = 2.5
"""Height of the hook above where the torn duct lay, in radii."""
TORN_ENDS: dict[str, TornEnd] = {"first_piece": "last", "second_piece": "first"}


@dataclass(frozen=True, slots=True, eq=False)
class _Drawn:
    """A surface of the session, the marks of the instruments on it, and how it is drawn."""

    surface: Surface
    contact: Contact
    tissue: Tissue | PlainTissue


class DuctScene:
    """One client's picture of its session; the look is "plain" for slow machines."""

    def __init__(self, client: viser.ClientHandle, session: Session, look: Look) -> None:
        self._client, self._session = client, session
        self._look: Look = look
        self._stage: Stage | None = None
        self._drawn: list[_Drawn] = []
        self._shape = -1
        self._clamps: tuple[float, float] | None = None
        self._organ: Organ | None = None
        self._preset: Preset | None = None
        self._appearance: Appearance | None = None
        self._first = np.zeros(3)  # the organ's axis at the first clamp
        self._arch = 0.0
        self._hand: DragProxy | None = None
        self._finish: tuple[Appearance, float] | None = None
        self.draw(session.reading())
        # Once for the client, not for each stage: viser keeps callbacks as long as the client.
        client.camera.on_update(self._camera_moved)

    def _camera_moved(self, camera: viser.CameraHandle) -> None:
        if self._stage is not None:
            self._stage.camera_moved(camera.client)

    def watch(self, session: Session) -> None:
        """Show another session of the same organ from the next `draw` on."""
        if session is not self._session:
            self._session, self._shape = session, -1

    def draw(self, reading: Reading, stress: Sequence[NDArray[np.float32]] | None = None) -> None:
        """Draw the session as it is now, as tissue or by the stress at each surface's vertices."""
        with self._client.atomic():
            stage = self._set_stage()
            stage.set_lift(self._lift(stage, reading), self._client)
            if self._session.drawn.shape != self._shape:
                self._rebuild()
            if reading.phase is Phase.TORN:
                stage.spill(
                    appearance_of(self._session.duct.dissection.preset), reading.check.station
                )
            else:
                stage.wipe()
            hook = self._place_hook(stage, reading)
            for drawn in self._drawn:
                drawn.contact.mark(drawn.surface.vertices, hook)
            if self._hand is not None:
                self._hand.follow([drawn.contact.vertices for drawn in self._drawn])
            for number, drawn in enumerate(self._drawn):
                contact = drawn.contact
                if stress is None:
                    drawn.tissue.show(contact.vertices, contact.shade)
                else:
                    drawn.tissue.show_stress(contact.vertices, stress[number])

    def set_look(self, look: Look) -> None:
        """Use another look from the next `draw` on."""
        if look == self._look:
            return
        self._look = look
        self._finish = None
        self._shape = -1
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
        """Let the mouse drag the duct and the hook, from the next `draw` on."""
        self._hand = DragProxy(self._client, grabbed=grabbed, moved=moved, released=released)
        self._offer_hand()

    def _offer_hand(self) -> None:
        """Let the mouse hold the duct as it is drawn now, whole or in pieces."""
        hand, dissection = self._hand, self._session.duct.dissection
        if hand is None:
            return
        hand.let_go()
        hand.set_duct([drawn.surface.skin for drawn in self._drawn], dissection.frame, self._first)
        hand.set_hook(self._radius)
        hand.follow([drawn.contact.vertices for drawn in self._drawn])

    def frame_camera(self) -> None:
        """Keep both clamps in the client's picture."""
        self._set_stage().frame_camera(self._client)

    @property
    def _radius(self) -> float:
        """Radius of the duct as it is drawn, mm."""
        return drawn_radius(self._session.duct.dissection)

    def _place_hook(self, stage: Stage, reading: Reading) -> HookPlace | None:
        """Put the hook where it pulls, sunk into the wall, and return where that is."""
        if reading.phase is Phase.TORN:
            up = LIFT_AFTER_TEAR * stage.radius
            stage.place_hook(np.add(reading.hook, (0.0, 0.0, up)), (0.0, 0.0, 1.0))
            return None
        dissection = self._session.duct.dissection
        share = 1.0 - reading.check.distance_to_break
        center = np.add(reading.hook, (0.0, 0.0, sink(share, stage.radius)))
        stage.place_hook(center, (0.0, 0.0, 1.0))
        place = self._first + dissection.frame @ center
        return HookPlace(place, dissection.frame, stage.radius)

    def _lift(self, stage: Stage, reading: Reading) -> float:
        """Return the height to show, mm: the duct's arch at rest plus its deflection at break."""
        event = reading.breaks_at
        pulled = max(reading.deepest, 0.0 if event is None else event.deflection)
        tenth = 0.1 * stage.span
        # In steps, so that the camera moves when another duct is chosen, not at every reading.
        return max(3.0, np.ceil((self._arch + 1.1 * pulled) / tenth)) * tenth

    def _set_stage(self) -> Stage:
        """Return the stage for the session's clamps; a new one if they have moved."""
        dissection = self._session.duct.dissection
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
            and appearance == self._appearance
        ):
            if self._hand is not None:
                self._hand.let_go()  # of the stage's hook
            self._shape = -1  # another thread may have set the new duct, but not its surfaces yet
            self._stage.remove()
            self._stage = None
        self._appearance = appearance
        if self._stage is None:
            self._stage = Stage(
                self._client.scene,
                span=span,
                radius=radius,
                look=self._look,
                bite=appearance.bite,
                tissue=mean_color(appearance),
                surroundings=appearance.surroundings,
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

    def _rebuild(self) -> None:
        """Replace the drawn surfaces by the session's present ones."""
        self._shape = self._session.drawn.shape
        for drawn in self._drawn:
            drawn.tissue.remove()
        dissection, scene = self._session.duct.dissection, self._client.scene
        organ, radius = dissection.organ, self._radius
        look = appearance_of(dissection.preset)
        if self._look == "full" and self._finish != (look, radius):
            self._finish = look, radius
            send_finish(scene, look, radius)
        self._drawn = []
        for surface in self._session.drawn.surfaces:
            skin, node = surface.skin, f"/organ/{surface.name}"
            torn_end = TORN_ENDS.get(surface.name)
            contact = Contact(
                skin,
                organ.axis_at(skin.stations),
                dissection.frame,
                dissection.clamps,
                radius,
                thickness=radius / organ.mean_radius,
                bite=look.bite,
            )
            if self._look == "full":
                tissue = Tissue(
                    scene,
                    node,
                    contact,
                    look=look,
                    radius=radius,
                    lumen=drawn_lumen(dissection),
                    torn_end=torn_end,
                )
            else:
                tissue = PlainTissue(
                    scene, node, contact, radius=radius, color=mean_color(look), torn_end=torn_end
                )
            self._drawn.append(_Drawn(surface, contact, tissue))
        self._offer_hand()
