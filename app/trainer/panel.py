"""The panel: read-outs, sliders, choices and the force-deflection plot of one client."""

import html
from collections.abc import Callable
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray
from viser import theme, uplot

from app.simulation.preset import OrganBeam
from app.simulation.session import Phase, Reading, Session
from app.trainer.readout import KPA_PER_MPA, readout_html
from physics import Cubic, Exact, Fem, TautString, Theory

__all__ = ["DISCLAIMER", "OFFERED_THEORIES", "Panel"]

DISCLAIMER = "Not clinically validated, not a medical device."
WIDTH = 330
"""px."""
BRAND = (38, 166, 154)
OFFERED_THEORIES: dict[str, Theory] = {
    "Cubic beam (Rayleigh)": Cubic(),
    "String (very large deflection)": TautString(),
    "Exact beam": Exact(),
    "Exact beam, shear, neo-Hookean": Exact(shear=True, law="neo-hooke"),
    "Finite elements (the thesis's reference)": Fem(),
}
"""Theories that are quick enough to be stepped for a room of trainees, by their label."""
AXIS_COLOUR = "#c9ccd1"
GRID = uplot.Axis_Grid(stroke="rgba(255,255,255,.08)")

HELP = """\
**Goal.** Free the duct without tearing it.

1. Raise *Force F*: the hook pulls, the duct stretches and bends.
2. Watch *Distance to break* turn amber, then red.
3. Past the threshold the duct tears. *Reset* gives a new one.

Drag the picture to look around, scroll to come nearer.

**What is computed.** The duct is one beam between two clamps. It tears where
normal stress + bending stress > threshold T. How the torn ends gape and swing
is drawn, not computed.
"""


class Panel:
    """One client's panel: it writes inputs into the session and shows its readings.

    Parameters
    ----------
    gui
        The client's own GUI.
    session
        The client's session.
    refused
        Shows the client why a choice cannot be made.
    """

    def __init__(self, gui: viser.GuiApi, session: Session, refused: Callable[[str], None]) -> None:
        self._gui, self._session, self._refused = gui, session, refused
        gui.configure_theme(
            titlebar_content=theme.TitlebarConfig(
                buttons=(),
                image=theme.TitlebarImage(
                    image_url_light=_LOGO,
                    image_url_dark=_LOGO,
                    image_alt="Blunt-dissection trainer",
                    href=None,
                ),
            ),
            dark_mode=True,
            show_logo=False,
            show_share_button=False,
            brand_color=BRAND,
        )
        gui.set_panel_label("Blunt dissection")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH)
        self._readout = gui.add_html(readout_html(session.reading()))
        tabs = gui.add_tab_group()
        with tabs.add_tab("Train", viser.Icon.HAND_MOVE):
            self._add_inputs()
            self._plot = self._add_plot()
        with tabs.add_tab("Model", viser.Icon.ADJUSTMENTS):
            self._about = gui.add_html(self._model_html())
        with tabs.add_tab("Help", viser.Icon.HELP):
            gui.add_markdown(HELP)
        gui.add_html(
            f"<div data-testid='disclaimer' style='padding:4px 14px 10px;font-size:11px;"
            f"opacity:.75'>{DISCLAIMER}</div>"
        )
        self._shown = session.reading()
        self._curve_key: object = None
        self.show(self._shown)

    def show(self, reading: Reading) -> None:
        """Show a reading.

        Parameters
        ----------
        reading
            The session's reading.
        """
        self._readout.content = readout_html(reading)
        self._draw_curve(reading)
        if (reading.phase is Phase.INTACT) != (self._shown.phase is Phase.INTACT):
            # Hidden, not disabled: viser leaves a disabled slider's number field open to typing.
            for handle in (self._force, self._grasp, self._threshold, self._preset, self._theory):
                handle.visible = reading.phase is Phase.INTACT
        if reading.phase is Phase.TORN and self._shown.phase is not Phase.TORN:
            self._force.value = 0.0
        self._shown = reading

    def _add_inputs(self) -> None:
        gui, session = self._gui, self._session
        low, high = session.grasp_range
        self._force = gui.add_slider(
            "Force F (N)",
            min=0.0,
            max=session.force_limit,
            step=_step(session.force_limit),
            initial_value=0.0,
            hint="The grasper's whole force across the duct",
        )
        self._grasp = gui.add_slider(
            "Grasp (mm)",
            min=round(low, 1),
            max=round(high, 1),
            step=0.1,
            initial_value=round(session.grasp, 1),
            hint="Where the hook holds the duct, from the left clamp",
        )
        low, high, step, value = self._threshold_scale()
        self._threshold = gui.add_slider(
            "Threshold (kPa)",
            min=low,
            max=high,
            step=step,
            initial_value=value,
            hint="Normal plus bending stress at which the duct tears",
        )
        self._titles = {preset.title: preset.name for preset in session.presets_offered()}
        self._preset = gui.add_dropdown(
            "Duct",
            tuple(self._titles),
            initial_value=session.dissection.preset.title,
            hint="Material, section and break, with their sources under Model",
        )
        self._theory = gui.add_dropdown(
            "Theory",
            tuple(OFFERED_THEORIES),
            initial_value=_label(session.theory),
            hint="How the beam is solved; each theory has its own threshold",
        )
        reset = gui.add_button(
            "Reset", icon=viser.Icon.REFRESH, hint="Let go and start with a whole duct"
        )

        _on_input(self._force, lambda value: session.set_force(_number(value)))
        _on_input(self._grasp, lambda value: session.set_grasp(_number(value)))
        _on_input(
            self._threshold, lambda value: session.set_threshold(_number(value) / KPA_PER_MPA)
        )
        _on_choice(self._preset, self._choose_preset)
        _on_choice(self._theory, self._choose_theory)

        @reset.on_click
        async def _(_: object) -> None:
            session.reset()
            self._force.value = 0.0

    def _choose_preset(self, title: object) -> None:
        name = self._titles.get(str(title))
        if name is not None and name != self._session.dissection.preset.name:
            self._choose(lambda: self._session.choose_preset(name))

    def _choose_theory(self, label: object) -> None:
        theory = OFFERED_THEORIES.get(str(label))
        if theory is not None and theory != self._session.theory:
            self._choose(lambda: self._session.choose_theory(theory))

    def _choose(self, choice: Callable[[], None]) -> None:
        """Make a choice, or say why it cannot be made, and show what holds then."""
        try:
            choice()
        except ValueError as error:
            self._refused(str(error))
        self._take_ranges()

    def _take_ranges(self) -> None:
        """Bring the inputs' ranges and values in line with the session's."""
        session = self._session
        self._preset.value = session.dissection.preset.title
        self._theory.value = _label(session.theory)
        self._force.max = session.force_limit
        self._force.step = _step(session.force_limit)
        self._force.value = session.force_wanted
        low, high = session.grasp_range
        self._grasp.min, self._grasp.max = round(low, 1), round(high, 1)
        self._grasp.value = round(session.grasp, 1)
        low, high, step, value = self._threshold_scale()
        self._threshold.min, self._threshold.max, self._threshold.step = low, high, step
        self._threshold.value = value
        self._about.content = self._model_html()

    def _threshold_scale(self) -> tuple[float, float, float, float]:
        """Return the threshold slider's ends, step and value, kPa, in round numbers."""
        low, high = (KPA_PER_MPA * end for end in self._session.threshold_range)
        step = _step(high)
        value = KPA_PER_MPA * self._session.threshold
        low, high, value = (round(step * round(end / step), 9) for end in (low, high, value))
        return low, high, step, value

    def _add_plot(self) -> viser.GuiUplotHandle:
        nothing = np.zeros(2)
        return self._gui.add_uplot(
            (np.array([0.0, 1.0]), nothing, nothing, nothing),
            (
                uplot.Series(label="deflection, mm"),
                uplot.Series(label="theory, N", stroke="#7d8590", width=1.5),
                uplot.Series(label="this pull, N", stroke="#35c28f", width=3),
                uplot.Series(label="break, N", stroke="#ff6b5e", width=1.5, dash=(6, 4)),
            ),
            scales={"x": uplot.Scale(time=False), "y": uplot.Scale(auto=True)},
            axes=(
                uplot.Axis(
                    stroke=AXIS_COLOUR, label="deflection (mm)", labelSize=18, size=34, grid=GRID
                ),
                uplot.Axis(
                    stroke=AXIS_COLOUR, label="force F (N)", labelSize=18, size=52, grid=GRID
                ),
            ),
            legend=uplot.Legend(show=False),
            aspect=1.75,
        )

    def _draw_curve(self, reading: Reading) -> None:
        """Draw the theory's curve, the part of it this pull has covered, and the break."""
        session, event = self._session, reading.breaks_at
        key = (
            session.dissection.preset.name,
            session.theory,
            session.grasp,
            event.force if event else None,
        )
        if key != self._curve_key or reading.deepest > self._curve[0][-1]:
            self._curve_key = key
            self._curve: tuple[NDArray[np.float64], NDArray[np.float64]] = session.curve()
            # Said outright: the chart keeps the range that an earlier curve has left it.
            self._plot.scales = {
                end: uplot.Scale(time=False, range=(0.0, float(values[-1])))
                for end, values in zip(("x", "y"), self._curve, strict=True)
            }
        deflections, forces = self._curve
        # The pull's own end is a point of the grid, so that its curve ends where the hook is.
        grid = np.union1d(deflections, [reading.deepest])
        theory = np.interp(grid, deflections, forces)
        pulled = np.where(grid <= reading.deepest, theory, np.nan)
        level = np.full_like(grid, event.force if event else np.nan)
        self._plot.data = (grid, theory, pulled, level)

    def _model_html(self) -> str:
        session = self._session
        preset, beam = session.dissection.preset, session.dissection.beam
        own = isinstance(preset.beam, OrganBeam)
        section = (
            "the organ's weakest section (the exact beam takes all)" if own else "a full round bar"
        )
        geometry = (
            f"{beam.span:.1f} mm between the clamps, {section}: area {beam.area:.1f} mm², "
            f"second moment {beam.second_moment:.0f} mm⁴, outer fibre at "
            f"{beam.fibre_distance:.2f} mm. Young's modulus {KPA_PER_MPA * beam.modulus:,.0f} kPa, "
            f"Poisson's ratio {beam.poisson_ratio:g}."
        )
        paragraphs = (
            (preset.title, preset.description),
            ("Beam", geometry),
            ("Source", preset.source),
            (f"Confidence: {preset.confidence}", preset.confidence_note),
        )
        return "".join(
            f"<div style='padding:6px 14px;font-size:13px'><b>{html.escape(heading)}</b>"
            f"<div style='opacity:.85;margin-top:2px'>{html.escape(text)}</div></div>"
            for heading, text in paragraphs
        )


def _on_choice(handle: viser.GuiDropdownHandle[str], take: Callable[[object], None]) -> None:
    """Call back with what the browser chooses, in a thread of its own: it may take a while."""

    @handle.on_update
    def _(event: viser.GuiEvent[Any]) -> None:
        if event.client_id is not None:
            take(handle.value)


def _on_input(handle: viser.GuiSliderHandle[float], take: Callable[[object], None]) -> None:
    """Call back with what the browser sets, in order; not with what we set ourselves."""

    @handle.on_update
    async def _(event: viser.GuiEvent[Any]) -> None:
        if event.client_id is not None:
            take(handle.value)


def _label(theory: Theory) -> str:
    """Return the label of a theory that is offered."""
    return next(label for label, offered in OFFERED_THEORIES.items() if offered == theory)


def _number(value: object) -> float:
    """Return what a browser sent as a number, NaN where it is none."""
    return float(value) if isinstance(value, int | float) else float("nan")


def _step(limit: float) -> float:
    """Return the power of ten that divides a scale into some hundred to a thousand steps."""
    return float(10.0 ** (np.floor(np.log10(limit)) - 2.0))


_LOGO = (
    "data:image/svg+xml;utf8,"
    "<svg xmlns='http://www.w3.org/2000/svg' width='310' height='32'>"
    "<path d='M4 21C14 21 14 11 24 11s10 10 20 10' stroke='%23d9a066' stroke-width='8' "
    "fill='none' stroke-linecap='round'/>"
    "<path d='M24 1v8a4 4 0 0 0 8 0' stroke='%23cfd4d9' stroke-width='2.5' fill='none' "
    "stroke-linecap='round'/>"
    "<text x='58' y='22' font-family='sans-serif' font-size='17' font-weight='600' "
    "fill='%23e8eaed'>Blunt-dissection trainer</text></svg>"
)
