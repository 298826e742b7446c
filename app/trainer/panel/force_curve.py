"""The force-deflection plot of a duct in a plane: its theory, the pull so far, other theories."""

import threading
from contextlib import suppress

import numpy as np
import viser
from viser import uplot

from app.simulation import BeamModel, Dissection, GraspedBeam, Reading, Session
from app.trainer.client.page_state import PageState
from app.trainer.panel.plots import Curve, axes, dots, goal_area, key_html, line
from app.validation.thesis_tables import INCH, LBF, TABLES
from physics import Beam, Cubic, Exact, Theory

_SERIES = {
    "theory": line("chosen theory", "#9aa3ad"),
    "pull": line("this pull", "#35c28f", 3.0),
    "break": line("break", "#ff6b5e", 1.5, (6, 4)),
    "cubic": line("thesis's cubic", "#f2b134", 1.2, (5, 3)),
    "exact": line("exact beam", "#5aa9ff", 1.2, (2, 3)),
    "ansys": dots("ANSYS, by the thesis", "#e8eaed"),
    "goal": goal_area(),
}
REFERENCE_POINTS = 50
# Relative difference between a beam's numbers and a table's that the table's rounding explains.
SAME_BEAM = 1e-3
STEP = 1e-6
"""Width of a step in a plot, over the plot's width: vertical to the eye."""
MIDDLE = 0.05
"""mm from mid-span within which a grasp counts as in the middle: half of the slider's step."""

_Pair = tuple[Curve, Curve]


def ansys_points(beam: Beam, grasp: float) -> _Pair | None:
    """Return ANSYS's deflections and forces for a beam, where the thesis has printed them."""
    if abs(grasp - 0.5 * beam.span) > MIDDLE:
        return None
    for table in TABLES:
        theirs = table.beam
        if np.allclose(
            [beam.span, beam.area, beam.second_moment, beam.modulus],
            [theirs.span, theirs.area, theirs.second_moment, theirs.modulus],
            rtol=SAME_BEAM,
        ):
            rows = np.array([(ansys * INCH, 2.0 * pull * LBF) for pull, _, ansys in table.rows])
            return rows[:, 0], rows[:, 1]
    return None


class ForceCurve:
    """One client's force-deflection plot; a worker solves the other theories' curves."""

    def __init__(self, gui: viser.GuiApi, state: PageState) -> None:
        nothing = np.zeros(2)
        self._state = state
        self._lock = threading.Lock()
        self._key: object = None
        self._others_key: object = None
        self._curve: _Pair = (np.array([0.0, 1.0]), nothing)
        self._cubic: _Pair | None = None
        self._exact: _Pair | None = None
        self._ansys: _Pair | None = None
        self._goal: tuple[float, float] | None = None
        self._deepest = 0.0
        self._level = np.nan
        self._chart = gui.add_uplot(
            (np.array([0.0, 1.0]), *[nothing] * len(_SERIES)),
            (uplot.Series(label="deflection"), *_SERIES.values()),
            scales={"x": uplot.Scale(time=False), "y": uplot.Scale(auto=True)},
            axes=axes("deflection (mm)", "force F (N)"),
            legend=uplot.Legend(show=False),
            aspect=1.75,
        )
        self._legend = gui.add_html("")

    @property
    def visible(self) -> bool:
        """Whether it is shown; while it is hidden, none of its data are sent to the page."""
        return self._chart.visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        if visible != self._chart.visible:
            self._chart.visible = self._legend.visible = visible
            if not visible:
                with self._lock:
                    self._key = None
                    nothing = np.zeros(2)
                    self._chart.data = (np.array([0.0, 1.0]), *[nothing] * len(_SERIES))

    def show(self, session: Session, reading: Reading) -> None:
        """Draw the theory's curve, the part that this pull has covered, and the break."""
        event = reading.breaks_at
        self._take_others(session)
        with self._lock:
            key = (
                session.tissue.dissection,
                session.planar.theory,
                session.planar.grasp,
                event and event.force,
            )
            if key != self._key or reading.deepest > self._curve[0][-1]:
                self._key = key
                self._curve = session.curve()
                # The range is always set: else the chart would keep that of an earlier curve.
                self._chart.scales = {
                    end: uplot.Scale(time=False, range=(0.0, float(values[-1])))
                    for end, values in zip(("x", "y"), self._curve, strict=True)
                }
            goal = session.goal
            if goal != self._goal:
                self._goal = goal
                self._explain()
            self._deepest = reading.deepest
            self._level = event.force if event else np.nan
            self._draw()

    def _take_others(self, session: Session) -> None:
        """Have the thesis's cubic and the exact beam solved for a new duct or grasp."""
        dissection, grasp, chosen = (
            session.tissue.dissection,
            session.planar.grasp,
            session.planar.theory,
        )
        key = (dissection, grasp, chosen, session.tissue.threshold)
        if key == self._others_key:
            return
        self._others_key = key
        threshold = session.tissue.threshold

        def solve() -> None:
            cubic = _curve(dissection, Cubic(), chosen, grasp, threshold)
            exact = _curve(dissection, Exact(), chosen, grasp, threshold)
            with self._lock:
                if key == self._others_key:
                    self._cubic, self._exact = cubic, exact
                    self._ansys = ansys_points(dissection.beam, grasp)
                    self._explain()
                    if self._chart.visible and self._key is not None:
                        self._draw()

        with self._lock:
            self._cubic = self._exact = self._ansys = None
        workers = self._state.workers
        self._state.when_free(workers.background, (id(self), "others"), solve)

    def _explain(self) -> None:
        there = {
            "cubic": self._cubic,
            "exact": self._exact,
            "ansys": self._ansys,
            "goal": self._goal,
        }
        self._legend.content = key_html(
            [each for name, each in _SERIES.items() if there.get(name, True) is not None]
        )

    def _draw(self) -> None:
        """Send all series on one common grid that contains every point to be hit exactly."""
        deflections, forces = self._curve
        last = float(deflections[-1])
        marks = np.empty(0) if self._ansys is None else self._ansys[0][self._ansys[0] <= last]
        # A vertical step at each of its ends: two points almost at one place.
        goal = np.array(self._goal or (), np.float64)
        beside = np.add(goal, (-STEP * last, STEP * last)) if goal.size else goal
        grid = np.union1d(np.concatenate([deflections, [self._deepest], goal, beside]), marks)
        theory = np.interp(grid, deflections, forces)
        nowhere = np.full_like(grid, np.nan)
        shown = nowhere.copy()
        if self._ansys is not None and marks.size:
            shown[np.searchsorted(grid, marks)] = self._ansys[1][: marks.size]
        self._chart.data = (
            grid,
            theory,
            np.where(grid <= self._deepest, theory, np.nan),
            np.full_like(grid, self._level),
            nowhere if self._cubic is None else np.interp(grid, *self._cubic, right=np.nan),
            nowhere if self._exact is None else np.interp(grid, *self._exact, right=np.nan),
            shown,
            np.where((grid >= goal[0]) & (grid <= goal[1]), forces[-1], 0.0)
            if goal.size
            else nowhere,
        )


def _curve(
    dissection: Dissection, theory: Theory, chosen: Theory, grasp: float, threshold: float
) -> _Pair | None:
    """Return a theory's curve; None for the theory in use, or where it has none."""
    if theory == chosen:
        return None
    with suppress(ValueError):
        duct = GraspedBeam(BeamModel.of(dissection, theory), grasp, threshold)
        return duct.curve(REFERENCE_POINTS)
    return None
