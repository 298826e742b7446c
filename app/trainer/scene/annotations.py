"""Annotations of the scene: goals, model points, ghost and mass-spring chain."""

import numpy as np
import viser

from app.simulation import Dissection, Exercise, FreeLength, Phase, Reading, Session
from app.trainer.scene.comparison_meshes import ChainLines, GhostMesh
from app.trainer.scene.goal_band import (
    HALF_LENGTH,
    GoalBand,
    GoalStretch,
    HoldMark,
    LitHand,
    MoveMark,
)
from app.trainer.scene.overlay import Overlay
from app.trainer.stage.appearance import drawn_radius

# Distance of the chain before the duct's axis, in radii: the viewer sees it beside the duct.
CHAIN_ASIDE = 1.9


class Annotations:
    """All annotations of one client's scene, each added when it is first shown."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client = client
        self._dissection: Dissection | None = None
        self._goal: GoalBand | None = None
        self._stretch: GoalStretch | None = None
        self._stretch_of: Exercise | None = None
        self._holds: HoldMark | None = None
        self._move: MoveMark | None = None
        self._overlay: Overlay | None = None
        self._ghost: GhostMesh | None = None
        self._chain: ChainLines | None = None
        self._lit: LitHand | None = None
        self._nodes = np.zeros((0, 3))
        # Found once for each organ: its sections take milliseconds.
        self._radius, self._first = 0.0, np.zeros(3)

    def draw(
        self,
        session: Session,
        reading: Reading,
        *,
        figures: bool,
        overlay: bool,
        lit: int | None = None,
    ) -> None:
        """Draw the annotations that are wanted, as they are now."""
        dissection, whole = session.tissue.dissection, reading.phase is Phase.INTACT
        with self._client.atomic():
            if dissection is not self._dissection:
                self.remove()
                self._dissection = dissection
                organ = dissection.organ
                self._radius = organ.mean_radius
                self._first = organ.axis_at(np.array(dissection.clamps[:1]))[0]
            self._draw_goal(session, reading, figures)
            self._draw_stretch(session)
            self._draw_overlay(session, overlay and whole)
            self._draw_ghost(session, figures)
            self._draw_chain(session, figures)
            self._light_hand(session, lit)

    def say_standing(self, session: Session, *, figures: bool) -> None:
        """Write at the goal what to do now; the text changes with time even if nothing moves."""
        if self._goal is not None:
            self._goal.say((figures and session.run.standing) or "Goal")
        holding = session.holding if figures else None
        marked = holding is not None and holding.strands > 0
        if marked and self._holds is None:
            self._holds = HoldMark(self._client.scene, self._radius)
        if self._holds is not None:
            self._holds.visible = marked
            if holding is not None and marked:
                self._holds.show(holding.strands, holding.station)
        to = None if holding is None else holding.move.to
        if to is not None and self._move is None:
            self._move = MoveMark(self._client.scene)
        if self._move is not None:
            self._move.visible = to is not None
            if to is not None:
                jaws = next(e for e in session.spatial.hands if e.instrument == "dissector")
                self._move.show(jaws.place, to)

    def _draw_goal(self, session: Session, reading: Reading, figures: bool) -> None:
        band = session.goal
        if band is None or reading.phase is not Phase.INTACT:
            if self._goal is not None:
                self._goal.remove()
                self._goal = None
            return
        if self._goal is None:
            self._goal = GoalBand(self._client.scene)
        frame = session.tissue.dissection.frame
        # The duct's upper edge at rest, at the hook.
        rest = np.array(reading.hook) - (0.0, 0.0, reading.deflection)
        edge = self._first + frame @ rest + self._radius * frame[:, 2]
        low, high = (edge + each * frame[:, 2] for each in band)
        self._goal.show(low, high, HALF_LENGTH * session.tissue.dissection.beam.span * frame[:, 0])
        self.say_standing(session, figures=figures)

    def _draw_stretch(self, session: Session) -> None:
        """Mark the stretch that an exercise is about, if that is not the whole duct."""
        exercise = None if session.run.over else session.run.exercise
        if exercise is self._stretch_of:
            return
        self._stretch_of = exercise
        if self._stretch is not None:
            self._stretch.remove()
            self._stretch = None
        goal = None if exercise is None else exercise.goal
        if exercise is None or exercise.opening is None or not isinstance(goal, FreeLength):
            return
        divided = exercise.opening.divided
        if divided or goal.from_mm > 0.0:
            # Of a divided duct, from where it is free already.
            low = goal.to_mm - goal.length_mm if divided else goal.from_mm
            radius = drawn_radius(session.tissue.dissection)
            self._stretch = GoalStretch(self._client.scene, low, goal.to_mm, radius)

    def _draw_overlay(self, session: Session, wanted: bool) -> None:
        if self._overlay is None:
            if not wanted:
                return
            dissection = session.tissue.dissection
            self._overlay = Overlay(self._client.scene, dissection.organ, dissection.driving)
        self._overlay.visible = wanted
        if wanted:
            self._overlay.show(session.drawn.transforms, session.tissue.dissection.frame[:, 2])

    def _light_hand(self, session: Session, lit: int | None) -> None:
        """Mark the hand that has made an error, or none."""
        hands = session.tissue.hands
        if self._lit is None:
            if lit is None:
                return
            self._lit = LitHand(self._client.scene)
        self._lit.visible = lit is not None
        if lit is not None:
            whose = f"{('left', 'right')[lit]} " if len(hands) > 1 else ""
            self._lit.show(hands[lit].place, f"This {whose}hand")

    def _draw_ghost(self, session: Session, figures: bool) -> None:
        ghost = session.ghost if figures else None
        if self._ghost is None:
            if ghost is None:
                return
            self._ghost = GhostMesh(self._client.scene, ghost.surface.skin)
        self._ghost.visible = ghost is not None
        if ghost is not None:
            self._ghost.show(ghost.surface.vertices)

    def _draw_chain(self, session: Session, figures: bool) -> None:
        chain = session.chain if figures else None
        if self._chain is None:
            if chain is None:
                return
            self._chain = ChainLines(self._client.scene, len(chain.places))
            self._nodes = np.empty_like(chain.places)
        self._chain.visible = chain is not None
        if chain is not None:
            dissection = session.tissue.dissection
            aside = CHAIN_ASIDE * self._radius * dissection.frame[:, 1]
            np.matmul(chain.places, dissection.frame.T, out=self._nodes)
            self._nodes += self._first - aside
            self._chain.show(self._nodes)

    def remove(self) -> None:
        """Remove all annotations from the scene."""
        for aid in (
            self._goal, self._stretch, self._holds, self._move, self._overlay, self._ghost,
            self._chain, self._lit,
        ):  # fmt: skip
            if aid is not None:
                aid.remove()
        self._goal = self._stretch = self._stretch_of = self._holds = self._move = None
        self._overlay = self._ghost = self._chain = self._lit = None
