"""The scene of a dissection: a duct in its bed, and the instruments of both hands."""

import math
from typing import Literal

import numpy as np
import viser
from numpy.typing import NDArray

from app.simulation import HANDS, Exercise, FreeLength, Reading, Session
from app.trainer.scene.drag_proxy import DragProxy
from app.trainer.scene.duct_on_stage import DuctOnStage
from app.trainer.scene.force_arrow import ForceArrow
from app.trainer.scene.goal_band import GoalStretch
from app.trainer.stage.contact import HookPlace, sink
from app.trainer.stage.instruments import DrawnInstrument
from app.trainer.stage.lighting import Look
from app.trainer.stage.stage import Stage
from app.trainer.stage.strands import StrandsInBed
from physics.bed import Strands

__all__ = ["BedScene", "Colours"]

Colours = Literal["tissue", "stress", "freed"]
"""How the duct is coloured: as tissue, by the stress in its wall, or by what is freed of it."""
# Where a hook throws no shadow that can be seen, mm.
AWAY = (1e3, 0.0, 0.0)
LIFT = 0.3
"""Height over the duct, in spans, that the camera keeps in its picture."""
ARROW_FOOT = 1.25
"""Distance of an arrow's foot from the duct's axis, in radii: outside the wall."""
LEAST_FORCE, LEAST_SHARE = 0.02, 0.02
"""N, below which no arrow is drawn; and the least share of the break that scales one."""


class BedScene(DuctOnStage):
    """One client's picture of its dissection; the look is "plain" for slow machines."""

    in_screen = True
    elevation = 0.47
    stage_hook = False

    def __init__(self, client: viser.ClientHandle, session: Session, look: Look) -> None:
        super().__init__(client, session, look)
        self._strands: StrandsInBed | None = None
        self._strands_of: Strands | None = None
        self._instruments: list[DrawnInstrument | None] = [None] * HANDS
        self._shares: list[NDArray[np.float32]] = []
        self._arrows: list[ForceArrow] = []
        self._goal: GoalStretch | None = None
        self._goal_of: Exercise | None = None
        self.draw(session.reading())

    def draw(self, reading: Reading, colours: Colours = "tissue", *, figures: bool = True) -> None:
        """Draw the session as it is now, with the hands' forces if `figures` are shown."""
        with self._client.atomic():
            stage = self._set_stage()
            divided = self._session.spatial.divided
            if divided != self._divided:
                self._divided, self._shape = divided, -1
            stage.show_second_clamp(not divided)
            stage.set_lift(LIFT * stage.span, self._client)
            self._set_surfaces()
            self._set_strands(stage)
            if reading.torn_at is None:
                stage.wipe()
            else:
                stage.spill(reading.torn_at)
            depth = sink(reading.stress_ratio, stage.radius)
            self._show_goal(stage)
            self._show_forces(reading, stage, figures=figures)
            hooks = [self._set_instrument(number, stage, depth) for number in range(HANDS)]
            # Light and shadow are those of one hook.
            shading = [
                hand.place for hand in self._session.spatial.hands if hand.instrument == "hook"
            ]
            stage.place_hook(shading[0] if shading else AWAY)
            rods = self._session.spatial.beam.state.rods
            for drawn in self._drawn:
                drawn.contact.mark(drawn.surface.vertices, *hooks)
                drawn.contact.press_rods(rods, self._first)
            self._show(None if colours == "tissue" else self._values(colours))

    def lead_into_picture(self, into: bool) -> None:
        """Let drags go into the picture, and those with Shift in its plane; or the other way."""
        if self._hand is not None:
            self._hand.swapped = into

    def _values(self, colours: Colours) -> list[NDArray[np.float32]]:
        """Return what each surface's vertices are coloured by, 0 to 1."""
        session, duct = self._session, self._session.spatial
        surfaces = session.drawn.surfaces
        if len(self._shares) != len(surfaces) or any(
            len(values) != len(surface.vertices)
            for values, surface in zip(self._shares, surfaces, strict=True)
        ):
            self._shares = [np.empty(len(each.vertices), np.float32) for each in surfaces]
        for number, (out, surface) in enumerate(zip(self._shares, surfaces, strict=True)):
            if colours == "stress":
                session.stress(out, number)
                out /= duct.threshold
            else:
                out[:] = duct.freed_at(surface.skin.stations - duct.dissection.clamps[0])
        return self._shares

    def _set_instrument(self, number: int, stage: Stage, depth: float) -> HookPlace | None:
        """Draw a hand's instrument where it is; return where it is a hook that holds the duct."""
        duct = self._session.spatial
        hand, drawn = duct.hands[number], self._instruments[number]
        if drawn is None or drawn.instrument != hand.instrument:
            if drawn is not None:
                if self._hand is not None:
                    self._hand.forget_instrument(drawn.name)
                drawn.remove()
            drawn = self._instruments[number] = DrawnInstrument(
                self._client.scene,
                f"/bed/hand_{number}",
                hand.instrument,
                duct_radius=stage.radius,
                mirrored=number > 0,
                look=self._look,
            )
            if self._hand is not None:
                self._hand.set_instrument(number, drawn.name, drawn.grip)
        hooked = hand.instrument == "hook" and hand.node is not None
        drawn.show(hand, sunk=depth if hooked else 0.0)
        if not hooked:
            return None
        frame = duct.dissection.frame
        center = self._first + frame @ (hand.place + np.array([0.0, 0.0, depth]))
        return HookPlace(center, frame, stage.radius)

    def _show_goal(self, stage: Stage) -> None:
        """Mark the stretch that an exercise is about, if that is not the whole duct."""
        session = self._session
        exercise = None if session.run.over else session.run.exercise
        if exercise is self._goal_of:
            return
        self._goal_of = exercise
        if self._goal is not None:
            self._goal.remove()
            self._goal = None
        goal = None if exercise is None else exercise.goal
        if exercise is None or exercise.opening is None or not isinstance(goal, FreeLength):
            return
        divided = exercise.opening.divided
        if divided or goal.from_mm > 0.0:
            # Of a divided duct, from where it is free already.
            low = goal.to_mm - goal.length_mm if divided else goal.from_mm
            self._goal = GoalStretch(self._client.scene, low, goal.to_mm, stage.radius)

    def _show_forces(self, reading: Reading, stage: Stage, *, figures: bool) -> None:
        """Draw what each hand pulls or pushes with; at the break the larger is of full length."""
        if not self._arrows:
            if not figures or not any(map(any, reading.forces)):
                return
            self._arrows = [
                ForceArrow(self._client.scene, stage.span, f"/organ/force_{number}")
                for number in range(HANDS)
            ]
        frame = self._session.tissue.dissection.frame
        sizes = [math.hypot(*force) for force in reading.forces]
        at_break = max(sizes) / max(reading.stress_ratio, LEAST_SHARE)
        hands = self._session.spatial.hands
        for arrow, hand, force, size in zip(
            self._arrows, hands, np.array(reading.forces), sizes, strict=True
        ):
            arrow.visible = wanted = figures and size > LEAST_FORCE
            if wanted:
                out = ARROW_FOOT * stage.radius / size * force
                foot = self._first + frame @ (hand.place + out)
                arrow.show(foot, frame @ force, at_break=at_break)

    def _offer_instruments(self, hand: DragProxy) -> None:
        for number, drawn in enumerate(self._instruments):
            if drawn is not None:
                hand.set_instrument(number, drawn.name, drawn.grip)

    def _set_strands(self, stage: Stage) -> None:
        duct = self._session.spatial
        beam = duct.beam
        if self._strands is not None and beam.strands is not self._strands_of:
            self._strands.remove()
            self._strands = None
        if not beam.strands.count:  # a free duct
            return
        if self._strands is None:
            self._strands_of = beam.strands
            self._strands = StrandsInBed(
                self._client.scene,
                beam,
                aside=self._aside(),
                stage=stage,
                fibres=2 if self._look == "full" else 1,
            )
        else:
            self._strands.show(beam)

    def _aside(self) -> NDArray[np.float64]:
        """Return how far off its place each strand is drawn, mm: the skin is not the beam's."""
        duct = self._session.spatial
        _, ends, _ = duct.surface.strands_at_rest()
        return (ends - self._first) @ duct.dissection.frame - duct.beam.strands.ends

    def _clear(self) -> None:
        super()._clear()
        if self._strands is not None:
            self._strands.remove()
            self._strands = None
        for drawn in self._instruments:
            if drawn is not None:
                drawn.remove()
        for arrow in self._arrows:
            arrow.remove()
        self._instruments, self._arrows = [None] * HANDS, []
        if self._goal is not None:
            self._goal.remove()
        self._goal = self._goal_of = None
