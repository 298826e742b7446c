"""The force that pulls a duct in the plane of its pull, and where the hook holds it."""

import time

import numpy as np
import viser

from app.simulation import Phase, Reading
from app.trainer.client.page_state import HAND_ONLY, PageState
from app.trainer.panel.controls import note, number, on_input, set_if_changed, slider_step
from app.trainer.viser_bridge.page import set_arrow_step

# Change of the force by an arrow key, over the force at break.
ARROW = 0.01
CROSSING_SECONDS = 0.5
"""Within it a force set here and one set in the page may have met on their way."""


class ForceBox:
    """The sliders of force and grasp."""

    def __init__(self, gui: viser.GuiApi, state: PageState) -> None:
        self._state = state
        session = state.session
        self._scale = 0.0
        low, high = session.planar.grasp_range
        self._force = gui.add_slider(
            "Force F (N)",
            min=0.0,
            max=session.planar.force_limit,
            step=_force_step(session.planar.force_limit),
            initial_value=session.planar.grasper.slider_force,
            hint="The grasper's whole force across the duct. Or drag the duct with the mouse.",
        )
        self._grasp = gui.add_slider(
            "Grasp (mm)",
            min=round(low, 1),
            max=round(high, 1),
            step=0.1,
            initial_value=round(session.planar.grasp, 1),
            hint="Where the hook holds the duct, from the left clamp",
        )
        self._hand_only = gui.add_html(note(HAND_ONLY, "hand-only"), visible=False)
        self._model: object = None
        self._cause: object = None
        self._set_at = -CROSSING_SECONDS
        self._waited = False  # for what the page has set to be taken

        on_input(self._force, lambda value: self._take_force(number(value)))
        on_input(self._grasp, lambda value: self._take_grasp(number(value)))
        self.take_ranges()

    def _take_force(self, force: float) -> None:
        """Pull with the force of the slider."""
        self._known = self._values
        self._state.set_target_force(force)
        if time.monotonic() - self._set_at < CROSSING_SECONDS:
            # The page may have taken the force set here after its own: it is sent what acts. viser
            # sends a value that has changed only, and of several the last.
            self._force.value = 0.0 if force > 0.0 else self._force.max
            self._force.value = force

    def _take_grasp(self, at: float) -> None:
        self._known = self._values
        self._state.session.set_grasp(at)

    @property
    def _values(self) -> tuple[float, float]:
        """What the sliders have: set here, or by the page and perhaps not yet taken."""
        return self._force.value, self._grasp.value

    def take_ranges(self) -> None:
        """Bring the ranges of the inputs in line with the session's."""
        session = self._state.session
        model = session.tissue.dissection, session.planar.theory
        if model == self._model:
            return
        self._model = model
        limit = session.planar.force_limit
        step = _force_step(limit)
        self._force.max, self._force.step = limit, step
        self._force.precision = max(0, -round(np.log10(step)))
        low, high = session.planar.grasp_range
        self._grasp.min, self._grasp.max = round(low, 1), round(high, 1)
        self._grasp.value = round(session.planar.grasp, 1)
        self._set_force(min(session.planar.grasper.slider_force, limit))
        self._known = self._values

    def show(self, reading: Reading) -> None:
        """Show a reading."""
        state = self._state
        visible = state.figures_visible
        self.take_ranges()
        hand_only = state.session.run.hand_only
        live = state.playback is None and reading.phase is Phase.INTACT
        set_if_changed(self._hand_only, visible=state.playback is None and hand_only)
        set_if_changed(self._force, visible=state.playback is None and visible)
        set_if_changed(self._grasp, visible=state.playback is None)
        for slider in (self._force, self._grasp):  # a torn duct keeps their place
            set_if_changed(slider, disabled=not live or hand_only)
        self._follow(reading, live=live, visible=visible)
        event = reading.breaks_at
        scale = self._force.max if event is None else event.force
        if visible and scale != self._scale:
            self._scale = scale
            set_arrow_step(state.client, self._force, ARROW * scale)

    def _follow(self, reading: Reading, *, live: bool, visible: bool) -> None:
        """Let the sliders follow changes they did not make: a hand, a reset, a ramp or a tear.

        A slider's own change is never sent back: the hand on it is ahead of what has arrived here.
        """
        session = self._state.session
        cause = (self._state.pulls, live, visible, reading.by_hand)
        if cause == self._cause and not reading.by_hand:
            return
        # What the page has set and is not yet taken is not set back: it has a frame's time for it.
        if self._values != self._known and not self._waited:
            self._waited = True
            return
        self._cause, self._waited = cause, False
        wanted = session.planar.grasper.slider_force if live and visible else 0.0
        step = self._force.step
        force = min(max(round(wanted / step) * step, 0.0), self._force.max)
        self._set_force(force)
        set_if_changed(self._grasp, value=round(session.planar.grasp, 1))
        self._known = self._values

    def _set_force(self, force: float) -> None:
        if abs(self._force.value - force) > 1e-9:  # more than the page's rounding of its own value
            self._force.value = force
            self._set_at = time.monotonic()


def _force_step(limit: float) -> float:
    """Return a slider step of at most a tenth of a percent of the limit."""
    return 0.1 * slider_step(limit)
