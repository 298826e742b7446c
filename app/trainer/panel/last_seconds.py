"""The last seconds as a plot: both hands' forces and the distance to break."""

import math

import numpy as np
import viser
from viser import uplot

from app.simulation import HANDS, TICK_SECONDS, Reading, Session
from app.trainer.panel.controls import on_input, set_if_changed
from app.trainer.panel.plots import (
    AXIS_COLOUR,
    DISTANCE_COLOUR,
    GRID,
    HAND_COLOURS,
    LIMIT_COLOUR,
    TO_BREAK,
    key_html,
    line,
)
from app.trainer.viser_bridge.fast_transport import set_plot

SECONDS = 20.0
"""Length of the plot, s."""
MOST_POINTS = 110
"""Points kept: some more than a panel shows that is updated five times a second."""
# Height of an axis over its largest figure.
ABOVE = 1.08
IDLE_SECONDS = 1.0
"""Between points while nothing moves, s."""
FORCES = (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""Largest figures of the axis of the forces, N: the first that holds what is shown."""
_PERCENT = "%"
_NOTHING = (np.zeros(1),) * (3 + HANDS)


class LastSeconds:
    """One client's plot; while it is hidden, none of its data are sent to the page."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._wanted = gui.add_checkbox(
            "Plot", initial_value=True, hint="Forces and distance to break, the last 20 seconds"
        )
        names = ("left hand (N)", "right hand (N)")
        hands = [line(*each, 2.0) for each in zip(names, HAND_COLOURS, strict=True)]
        distance = line(TO_BREAK, DISTANCE_COLOUR, 2.0)
        limit = line("limit (%)", LIMIT_COLOUR, 1.5, (6, 4))
        distance["scale"] = limit["scale"] = _PERCENT
        # Rows: time of the run, s; each hand's force, N; distance to break, %; its limit, %.
        self._rows = np.full((3 + HANDS, MOST_POINTS), np.nan)
        self._run: object = None
        self._top = FORCES[0]
        self._chart = gui.add_uplot(
            _NOTHING,
            (uplot.Series(label="s ago"), *hands, distance, limit),
            scales=_scales(self._top),
            axes=(
                uplot.Axis(stroke=AXIS_COLOUR, size=26, grid=GRID),
                uplot.Axis(stroke=AXIS_COLOUR, size=38, grid=GRID),
                uplot.Axis(
                    stroke=AXIS_COLOUR,
                    size=38,
                    scale=_PERCENT,
                    side=1,
                    grid=uplot.Axis_Grid(show=False),
                ),
            ),
            legend=uplot.Legend(show=False),
            aspect=2.8,
        )
        marks = [*hands, distance]
        self._keys = key_html(marks), key_html([*marks, limit])
        self._key = gui.add_html(self._keys[0])
        on_input(self._wanted, lambda _: self._draw())

    def show(self, session: Session, reading: Reading, *, figures: bool) -> None:
        """Add what the instruments show now; forget all where figures are hidden."""
        run, rows = session.run, self._rows
        if not figures or run is not self._run or run.seconds < rows[0, -1]:  # or gone back in time
            rows.fill(np.nan)
        self._run = run
        set_if_changed(self._wanted, visible=figures)
        if figures:
            limits = {} if run.exercise is None else run.exercise.limit_of
            if run.seconds - rows[0, -1] > IDLE_SECONDS:  # nothing has moved since
                rows[:, :-1] = rows[:, 1:]
                rows[0, -1] = run.seconds - TICK_SECONDS
            rows[:, :-1] = rows[:, 1:]
            rows[0, -1] = run.seconds
            rows[1:-2, -1] = [math.hypot(*force) for force in reading.forces]
            rows[-2, -1] = 100.0 * max(0.0, reading.distance_to_break)
            rows[-1, -1] = 100.0 * (1.0 - limits.get("peak_stress_ratio", math.nan))
        self._draw()

    def needs_redraw(self, session: Session) -> bool:
        """Whether time has gone by that moves what is drawn: level lines stay as they are."""
        rows, run = self._rows, session.run
        if not self._chart.visible or run is not self._run:
            return False
        if run.seconds - rows[0, -1] < IDLE_SECONDS:
            return False
        return bool(np.ptp(rows[1:-1, rows[0] >= rows[0, -1] - SECONDS], axis=1).any())

    def _draw(self) -> None:
        visible = self._wanted.visible and self._wanted.value
        if visible != self._chart.visible:
            self._chart.visible = self._key.visible = visible
            if not visible:
                self._chart.data = _NOTHING
        if not visible:
            return
        times, now = self._rows[0], self._rows[0, -1]
        first = int(np.argmax(times >= now - SECONDS))
        if first and np.isfinite(times[first - 1]):  # from beyond the left edge
            first -= 1
        drawn = self._rows[:, first:]
        highest = float(drawn[1:-2].max(initial=0.0))
        top = next((each for each in FORCES if each >= highest), highest)
        if top != self._top:
            self._top = top
            self._chart.scales = _scales(top)
        set_plot(self._chart, (drawn[0] - now, *drawn[1:].copy()))
        set_if_changed(self._key, content=self._keys[bool(np.isfinite(drawn[-1, -1]))])


def _scales(top: float) -> dict[str, uplot.Scale]:
    return {
        "x": uplot.Scale(time=False, range=(-SECONDS, 0.0)),
        "y": uplot.Scale(range=(0.0, ABOVE * top)),
        _PERCENT: uplot.Scale(range=(0.0, 100.0 * ABOVE)),
    }
