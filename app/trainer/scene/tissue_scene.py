"""The scene of a tissue: a duct between its clamps, its strands, the hands, and what is marked."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal
from weakref import WeakMethod

import numpy as np
import viser
from numpy.typing import NDArray
from viser import transforms

from app.simulation import TOWARDS_VIEWER, Hand, Phase, Preset, Reading, Session
from app.trainer.scene.annotations import Annotations
from app.trainer.scene.drag_proxy import DragProxy, Hold
from app.trainer.scene.force_arrow import ForceArrow
from app.trainer.scene.policy_ghost import PolicyGhost
from app.trainer.stage.appearance import Appearance, appearance_of, drawn_radius
from app.trainer.stage.camera import ELEVATION
from app.trainer.stage.contact import Contact, HookPlace, sink
from app.trainer.stage.hook import LIFT_AFTER_TEAR
from app.trainer.stage.instruments import DrawnInstrument
from app.trainer.stage.lighting import Look
from app.trainer.stage.plain_tissue import PlainTissue
from app.trainer.stage.stage import Stage
from app.trainer.stage.strands import StrandsInBed
from app.trainer.stage.tissue import Tissue, cut_end, send_finish
from app.trainer.stage.wall_texture import mean_color
from organ_geometry import Organ
from organ_geometry.mesh import Surface
from physics.bed import Strands

Colours = Literal["tissue", "stress", "freed"]
"""How a duct is coloured: as tissue, by the stress in its wall, or by what is freed of it."""

# Relative change of span and radius too small to be seen: a megabyte need not be sent for it.
SAME_STAGE = 0.01
# Where a hook throws no shadow that can be seen, mm.
AWAY = (1e3, 0.0, 0.0)
LIFT_IN_SPACE, ELEVATION_IN_SPACE = 0.3, 0.47
"""Height over the duct that the camera keeps in its picture, in spans, and its elevation, rad."""
ARROW_FOOT = 1.25
"""Distance of an arrow's foot from the duct's axis, in radii: outside the wall."""
LEAST_FORCE, LEAST_RATIO = 0.02, 0.02
"""N, and of the force at break, below which no arrow is drawn; least stress that scales one."""


@dataclass(frozen=True, slots=True, eq=False)
class DrawnSurface:
    """A surface of the session, the marks of the instruments on it, and how it is drawn."""

    surface: Surface
    contact: Contact
    tissue: Tissue | PlainTissue


class TissueScene:
    """One client's picture of its session's tissue; the look is "plain" for slow machines."""

    def __init__(self, client: viser.ClientHandle, session: Session, look: Look) -> None:
        self._client, self._session = client, session
        self._look: Look = look
        self._stage: Stage | None = None
        self._in_plane = True
        self._drawn: list[DrawnSurface] = []
        self._shape = -1
        self._divided: bool = False  # whether no clamp holds the duct's far end
        self._clamps: tuple[float, float] | None = None
        self._organ: Organ | None = None
        self._preset: Preset | None = None
        self._first = np.zeros(3)  # the organ's axis at the first clamp
        self._arch = 0.0
        self._drag: DragProxy | None = None
        self._finish: tuple[Appearance, float] | None = None
        self._strands: StrandsInBed | None = None
        self._strands_of: Strands | None = None
        self._instruments: list[DrawnInstrument] = []
        self._values: list[NDArray[np.float32]] = []
        self._arrows: list[ForceArrow] = []
        self._ghost: PolicyGhost | None = None
        self._annotations = Annotations(client)
        # Once for the client, not for each stage: viser keeps callbacks as long as the client.
        # It does not keep a scene that has been removed.
        moved = WeakMethod(self._camera_moved)

        def camera_moved(camera: viser.CameraHandle) -> None:
            if (follow := moved()) is not None:
                follow(camera)

        client.camera.on_update(camera_moved)
        self.draw(session.reading())

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

    def draw(
        self,
        reading: Reading,
        colours: Colours = "tissue",
        *,
        figures: bool = True,
        overlay: bool = False,
        lit: int | None = None,
    ) -> None:
        """Draw the session as it is now, with the `figures` of forces and comparisons or without.

        An `overlay` is the model's points; a hand that is `lit` has made an error.
        """
        session = self._session
        with self._client.atomic():
            stage = self._set_stage()
            self._set_surfaces()
            self._set_strands(stage)
            stage.set_lift(self._lift(stage, reading), self._client)
            if reading.phase is Phase.TORN:
                stage.spill(reading.check.station)
            else:
                stage.wipe()
            self._draw_forces(reading, stage, figures=figures)
            hooks = self._draw_hands(reading, stage)
            rods = None if self._in_plane else session.spatial.beam.state.rods
            for drawn in self._drawn:
                drawn.contact.mark(drawn.surface.vertices, *hooks)
                if rods is not None:
                    drawn.contact.press_rods(rods, self._first)
                for nick in reading.nicks:
                    drawn.contact.open_nick(nick.station, nick.side, nick.depth)
            self._show([] if colours == "tissue" else self.values(colours))
            self._annotations.draw(session, reading, figures=figures, overlay=overlay, lit=lit)

    def show_ghost(self, ghost: Session | None) -> None:
        """Draw a policy's ghost beside the session, or none."""
        if ghost is None:
            if self._ghost is not None:
                self._ghost.remove()
                self._ghost = None
            return
        if self._ghost is None:
            self._ghost = PolicyGhost(self._client.scene, ghost.spatial)
            self._ghost.visible = True
        self._ghost.show(ghost.spatial)

    def say_standing(self, *, figures: bool) -> None:
        """Write at a goal what to do now; the text changes with time even if nothing moves."""
        self._annotations.say_standing(self._session, figures=figures)

    def values(self, colours: Colours) -> list[NDArray[np.float32]]:
        """Return what each drawn surface's vertices are coloured by, 0 to 1; overwritten."""
        session = self._session
        with session.lock:
            if session.drawn.shape != self._shape:  # a click has made others: none until they are
                return []
            surfaces = session.drawn.surfaces
            if [len(each) for each in self._values] != [len(each.vertices) for each in surfaces]:
                self._values = [np.empty(len(each.vertices), np.float32) for each in surfaces]
            for number, (out, surface) in enumerate(zip(self._values, surfaces, strict=True)):
                if colours == "stress":
                    session.stress(out, number)
                    out /= session.tissue.threshold
                else:
                    clamp = session.tissue.dissection.clamps[0]
                    out[:] = session.spatial.freed_at(surface.skin.stations - clamp)
            return self._values

    @property
    def view(self) -> Sequence[float]:
        """Direction to the client's camera and its place, in the frame of stage and duct."""
        seen = None if self._stage is None else self._stage.view(self._client)
        return TOWARDS_VIEWER.tolist() if seen is None else seen

    def frame_camera(self) -> None:
        """Keep both clamps in the client's picture."""
        self._set_stage().frame_camera(self._client)

    def remove(self) -> None:
        """Remove everything from the scene; the next `draw` builds it anew."""
        self._clear()
        self.show_ghost(None)
        self._annotations.remove()
        for drawn in self._drawn:
            drawn.tissue.remove()
        self._drawn = []

    # The mouse

    def let_drag(
        self,
        grabbed: Callable[[Hold], None],
        moved: Callable[[Hold], None],
        released: Callable[[], None],
    ) -> None:
        """Let the mouse drag the duct and the instruments, from the next `draw` on."""
        self._drag = DragProxy(self._client, grabbed=grabbed, moved=moved, released=released)
        self._offer_drags()

    def advance(self, ticks: int) -> bool:
        """Nothing here moves by itself."""
        return False

    def lead_into_picture(self, into: bool) -> None:
        """Let drags go into the picture, and those with Shift in its plane; or the other way."""
        if self._drag is not None:
            self._drag.swapped = into and not self._in_plane

    def _offer_drags(self) -> None:
        """Let the mouse hold the duct as it is drawn now, whole or in pieces."""
        drag, dissection = self._drag, self._session.tissue.dissection
        if drag is None:
            return
        drag.let_go()
        drag.in_depth = not self._in_plane
        drag.set_duct([drawn.surface.skin for drawn in self._drawn], dissection)
        for number, drawn in enumerate(self._instruments):
            drag.set_instrument(number, drawn.name, drawn.grip)
        drag.follow([drawn.contact.vertices for drawn in self._drawn])

    # What is around the duct

    def _camera_moved(self, camera: viser.CameraHandle) -> None:
        if self._stage is not None:
            self._stage.camera_moved(camera.client)

    def _clear(self) -> None:
        self._shape = -1  # another thread may have set a new duct, but not its surfaces yet
        if self._drag is not None:
            self._drag.let_go()
        if self._stage is not None:
            self._stage.remove()
            self._stage = None
        if self._strands is not None:
            self._strands.remove()
            self._strands = None
        for each in (*self._instruments, *self._arrows):
            each.remove()
        self._instruments, self._arrows = [], []

    def _set_stage(self) -> Stage:
        """Return the stage for the session's clamps; a new one if they have moved."""
        session = self._session
        in_plane = session.specimen.theory is not None
        if in_plane != self._in_plane:
            self._clear()
            self._in_plane = in_plane
        dissection = session.tissue.dissection
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
        radius = drawn_radius(dissection)
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
                elevation=ELEVATION if in_plane else ELEVATION_IN_SPACE,
                hook=False,
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

    def _lift(self, stage: Stage, reading: Reading) -> float:
        """Return the height to show, mm; in a plane the arch and the deflection at break."""
        if not self._in_plane:
            return LIFT_IN_SPACE * stage.span
        event = reading.breaks_at
        pulled = max(reading.deepest, 0.0 if event is None else event.deflection)
        tenth = 0.1 * stage.span
        # In steps, so that the camera moves when another duct is chosen, not at every reading.
        return max(3.0, np.ceil((self._arch + 1.1 * pulled) / tenth)) * tenth

    # The duct

    def _set_surfaces(self) -> None:
        """Draw the session's present surfaces, if they are others than those drawn."""
        session = self._session
        divided: bool = not self._in_plane and session.spatial.divided
        if session.drawn.shape == self._shape and divided == self._divided:
            return
        self._shape, self._divided = session.drawn.shape, divided
        if self._stage is not None:
            self._stage.show_second_clamp(not divided)
        for drawn in self._drawn:
            drawn.tissue.remove()
        dissection, scene = session.tissue.dissection, self._client.scene
        radius, look = drawn_radius(dissection), appearance_of(dissection.preset)
        if self._look == "full" and self._finish != (look, radius):
            self._finish = look, radius
            send_finish(scene, look, radius)
        self._drawn = []
        for surface in session.drawn.surfaces:
            name = surface.name
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
        self._offer_drags()

    def _show(self, values: list[NDArray[np.float32]]) -> None:
        """Send the surfaces with their marks, as tissue or by the values at their vertices."""
        if self._drag is not None:
            self._drag.follow([drawn.contact.vertices for drawn in self._drawn])
        for number, drawn in enumerate(self._drawn):
            contact = drawn.contact
            if not values:
                drawn.tissue.show(contact.vertices, contact.shade)
            else:
                drawn.tissue.show_stress(contact.vertices, values[number])

    def _set_strands(self, stage: Stage) -> None:
        strands = None if self._in_plane else self._session.spatial.beam.strands
        if self._strands is not None and strands is not self._strands_of:
            self._strands.remove()
            self._strands = None
        if strands is None or not strands.count:  # a free duct
            return
        duct = self._session.spatial
        if self._strands is None:
            # The skin is not the beam's: how far off its place each strand is drawn, mm.
            _, ends, _ = duct.surface.strands_at_rest()
            aside = (ends - self._first) @ duct.dissection.frame - strands.ends
            self._strands_of = strands
            self._strands = StrandsInBed(
                self._client.scene,
                duct.beam,
                aside=aside,
                stage=stage,
                fibres=2 if self._look == "full" else 1,
            )
        else:
            self._strands.show(duct.beam)

    # The hands

    def _draw_hands(self, reading: Reading, stage: Stage) -> list[HookPlace | None]:
        """Draw the hands' instruments; return where each is a hook that holds the duct."""
        hands = self._session.tissue.hands
        depth = sink(reading.stress_ratio, stage.radius)
        frame = self._session.tissue.dissection.frame
        lamp, hooks = AWAY, list[HookPlace | None]()
        for number, hand in enumerate(hands):
            drawn = self._instrument(number, hand, stage)
            hooked = hand.instrument == "hook" and hand.node is not None
            above = depth if hooked else 0.0
            if self._in_plane and not hooked:  # the duct in two lies where the hook was
                above = LIFT_AFTER_TEAR * stage.radius
            drawn.show(hand, sunk=above)
            x, y, z = hand.place.tolist()
            center = x, y, z + above
            if hand.instrument == "hook" and lamp is AWAY:  # light and shadow are of one hook
                lamp = center
            hooks.append(
                HookPlace(self._first + frame @ np.array(center), frame, stage.radius)
                if hooked
                else None
            )
        stage.place_hook(lamp)
        return hooks

    def _instrument(self, number: int, hand: Hand, stage: Stage) -> DrawnInstrument:
        """Return a hand's instrument as it is drawn, a new one if the hand has another."""
        there = self._instruments
        if number < len(there):
            if there[number].instrument == hand.instrument:
                return there[number]
            if self._drag is not None:
                self._drag.forget_instrument(there[number].name)
            there[number].remove()
        drawn = DrawnInstrument(
            self._client.scene,
            f"/bed/hand_{number}",
            hand.instrument,
            duct_radius=stage.radius,
            mirrored=number > 0,
            look=self._look,
        )
        there[number : number + 1] = [drawn]
        if self._drag is not None:
            self._drag.set_instrument(number, drawn.name, drawn.grip)
        return drawn

    def _draw_forces(self, reading: Reading, stage: Stage, *, figures: bool) -> None:
        """Draw what each hand pulls or pushes with; at the break the larger is of full length."""
        if not self._arrows:
            if not figures or not any(map(any, reading.forces)):
                return
            self._arrows = [
                ForceArrow(self._client.scene, stage.span, f"/organ/force_{number}")
                for number in range(len(reading.forces))
            ]
        frame = self._session.tissue.dissection.frame
        sizes = [math.hypot(*force) for force in reading.forces]
        event = reading.breaks_at
        at_break = max(sizes) / max(reading.stress_ratio, LEAST_RATIO)
        if event is not None:
            at_break = event.force
        least = min(LEAST_FORCE, LEAST_RATIO * at_break)
        for arrow, place, force, size in zip(
            self._arrows, reading.places, reading.forces, sizes, strict=True
        ):
            arrow.visible = wanted = figures and size > least and reading.phase is Phase.INTACT
            if wanted:
                direction = np.array(force) / size
                foot = self._first + frame @ (place + ARROW_FOOT * stage.radius * direction)
                arrow.show(foot, frame @ np.array(force), at_break=at_break)
