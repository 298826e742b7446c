"""Model: which duct it is, when it tears, what is computed, and where its figures come from."""

import html

import viser

from app.simulation import BeamModel, Phase, Preset, Reading, fits
from app.trainer.client.pull_state import PullState
from app.trainer.panel.compare_tab import OFFERED_THEORIES
from app.trainer.panel.controls import (
    KPA_PER_MPA,
    figure,
    note,
    number,
    on_input,
    on_work,
    paragraphs_html,
    rows_html,
    set_if_changed,
)
from app.trainer.panel.preset_form import PresetForm
from app.trainer.panel.spread_box import SpreadBox
from app.trainer.panel.train_tab import slider_step

__all__ = ["SIMPLE_PICTURE", "ModelTab"]

SIMPLE_PICTURE = "Simple picture"

_POINTS = (
    "<span style='color:#40e0f0'>&#9679;</span> <b>Key points</b> on the sections kept from the "
    "images give the surface; the beam moves the <span style='color:#ffb220'>&#9679;</span> "
    "<b>driving points</b>, and the surface between them follows."
)


class ModelTab:
    """The tab of the model."""

    def __init__(self, gui: viser.GuiApi, state: PullState) -> None:
        self._state = state
        session = state.session
        self._own: Preset | None = None
        self._titles = self._offered()
        self._preset = gui.add_dropdown(
            "Duct",
            tuple(self._titles),
            initial_value=self._title(),
            hint="Material, section and break, with their sources below",
        )
        self._form = PresetForm(gui, state)
        low, high, step, value = self._threshold_scale()
        self._threshold = gui.add_slider(
            "Threshold (kPa)",
            min=low,
            max=high,
            step=step,
            initial_value=value,
            hint="Normal plus bending stress at which the duct tears",
        )
        self._points = gui.add_checkbox(
            "Points",
            initial_value=state.overlay,
            hint="Show the key points, the sections kept and the driving points",
        )
        self._plain = gui.add_checkbox(
            SIMPLE_PICTURE,
            initial_value=state.plain,
            hint="Two colours and no gloss, for a page that draws slowly",
        )
        gui.add_html(note(_POINTS))
        self._spread = SpreadBox(gui, state, lambda: state.session.tissue.dissection.preset)
        self._thresholds = gui.add_html("")
        self._about = gui.add_html(self._about_html())
        self._model: object = (session.tissue.dissection, session.planar.theory)
        self._solve_thresholds()
        on_work(self._preset, self._choose_preset)
        on_input(self._threshold, lambda kpa: self._set_threshold(number(kpa) / KPA_PER_MPA))
        on_input(self._plain, lambda value: state.show(plain=value is True))
        on_input(self._points, lambda value: state.show(overlay=value is True))

    def show(self, reading: Reading) -> None:
        """Enable what can be chosen now."""
        state = self._state
        set_if_changed(self._plain, value=state.plain)
        self._spread.show()
        free = reading.phase is Phase.INTACT and state.playback is None and not state.in_exercise
        for handle in (self._preset, self._threshold):
            set_if_changed(handle, visible=free)
        self._form.see(free)
        self.take_ranges()

    def take_ranges(self) -> None:
        """Bring the inputs and the text in line with the session's model."""
        session = self._state.session
        model = (session.tissue.dissection, session.planar.theory)
        if model == self._model:
            return
        self._model = model
        titles = self._offered()
        if titles != self._titles:
            self._titles = titles
            self._preset.options = tuple(titles)
        self._preset.value = self._title()
        self._form.show()
        low, high, step, value = self._threshold_scale()
        self._threshold.min, self._threshold.max, self._threshold.step = low, high, step
        self._threshold.value = value
        self._about.content = self._about_html()
        self._solve_thresholds()

    def _offered(self) -> dict[str, Preset]:
        """Return the presets to choose from, by title, with the user's last own one."""
        session = self._state.session
        presets, organ = session.presets_offered(), session.tissue.dissection.organ
        if not session.tissue.dissection.preset.ships:
            self._own = session.tissue.dissection.preset
        elif self._own is not None and fits(organ, self._own):
            presets.append(self._own)
        offered: dict[str, Preset] = {}
        for preset in presets:
            taken = preset.label in offered
            offered[f"{preset.label} (yours)" if taken else preset.label] = preset
        return offered

    def _title(self) -> str:
        now = self._state.session.tissue.dissection.preset
        titles = (title for title, preset in self._titles.items() if preset == now)
        return next(titles, now.label)

    def _set_threshold(self, threshold: float) -> None:
        if not self._state.in_exercise:
            self._state.session.set_threshold(threshold)

    def _choose_preset(self, title: object) -> None:
        state, preset = self._state, self._titles.get(str(title))
        now = state.session.tissue.dissection.preset
        if preset is None or preset == now or state.in_exercise:
            return
        state.attempt("Preparing the duct.", lambda: state.choose_preset(preset))
        self._preset.value = self._title()

    def _threshold_scale(self) -> tuple[float, float, float, float]:
        """Return the threshold slider's ends, step and value, kPa, in round numbers."""
        low, high = (KPA_PER_MPA * end for end in self._state.session.planar.threshold_range)
        step = slider_step(high)
        value = KPA_PER_MPA * self._state.session.tissue.threshold
        low, high, value = (round(step * round(end / step), 9) for end in (low, high, value))
        return low, high, step, value

    def _solve_thresholds(self) -> None:
        """Find every theory's threshold and break, in the background."""
        state, model = self._state, self._model

        def solve() -> None:
            rows: list[tuple[str, str, str]] = []
            for label, theory in OFFERED_THEORIES.items():
                try:
                    found = BeamModel.of(state.session.tissue.dissection, theory)
                except ValueError:
                    threshold, force = "–", "ends before"
                else:
                    threshold = figure(KPA_PER_MPA * found.threshold)
                    force = figure(found.break_force)
                rows.append((html.escape(label), threshold, force))
            lines = rows_html(
                rows, "padding-right:8px", "text-align:right;padding-right:8px", "text-align:right"
            )
            if model == self._model:
                self._thresholds.content = (
                    "<div data-testid='thresholds' style='padding:2px 12px 8px;font-size:12px'>"
                    "<table style='font-variant-numeric:tabular-nums'><tr style='opacity:.8'>"
                    "<td>Theory</td><td style='text-align:right'>T (kPa)</td>"
                    f"<td style='text-align:right'>breaks at (N)</td></tr>{lines}</table>"
                    "</div>"
                )

        state.workers.background.submit((id(self), "thresholds"), solve)

    def _about_html(self) -> str:
        session = self._state.session
        preset, beam = session.tissue.dissection.preset, session.tissue.dissection.beam
        geometry = (
            f"{session.tissue.dissection.section(session.planar.theory)}. "
            f"Area {beam.area:.1f} mm², "
            f"second moment {beam.second_moment:.0f} mm⁴, outer fibre at "
            f"{beam.fibre_distance:.2f} mm. Young's modulus {KPA_PER_MPA * beam.modulus:,.0f} kPa, "
            f"Poisson's ratio {beam.poisson_ratio:g}."
        )
        return paragraphs_html(
            (preset.label, preset.description),
            ("Beam", geometry),
            ("Strength as given", preset.strength),
            ("Source", preset.source),
            (f"Confidence: {preset.confidence}", preset.confidence_note),
        )
