"""Model: which duct it is, when it tears, what is computed, and where its figures come from."""

import html

import viser

from app.simulation.preset import OrganBeam
from app.simulation.reading import Phase, Reading
from app.trainer.panel.controls import KPA_PER_MPA, note, number, on_input, on_work
from app.trainer.panel.train_tab import slider_step
from app.trainer.workplace import Workplace

__all__ = ["ModelTab"]

_POINTS = (
    "<span style='color:#40e0f0'>&#9679;</span> <b>Key points</b> on the sections kept from the "
    "images give the surface; the beam moves the <span style='color:#ffb220'>&#9679;</span> "
    "<b>driving points</b>, and the surface between them follows."
)


class ModelTab:
    """The tab of the model.

    Parameters
    ----------
    gui
        The client's own GUI, inside the tab.
    workplace
        The client's workplace.
    """

    def __init__(self, gui: viser.GuiApi, workplace: Workplace) -> None:
        self._workplace = workplace
        session = workplace.session
        self._titles = self._offered()
        self._preset = gui.add_dropdown(
            "Duct",
            tuple(self._titles),
            initial_value=session.dissection.preset.title,
            hint="Material, section and break, with their sources below",
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
        self._points = gui.add_checkbox(
            "Points",
            initial_value=workplace.overlay,
            hint="Show the key points, the sections kept and the driving points",
        )
        gui.add_html(note(_POINTS))
        self._about = gui.add_html(self._about_html())
        self._model: object = (session.dissection, session.theory)
        on_work(self._preset, self._choose_preset)
        on_input(
            self._threshold, lambda kpa: self._set_threshold(number(kpa) / KPA_PER_MPA)
        )  # fmt: skip
        on_input(self._points, lambda value: workplace.show(overlay=value is True))

    def show(self, reading: Reading) -> None:
        """Offer what can be chosen now.

        Parameters
        ----------
        reading
            Of the session that is shown.
        """
        workplace = self._workplace
        free = (
            reading.phase is Phase.INTACT and workplace.player is None and not workplace.in_exercise
        )
        for handle in (self._preset, self._threshold):
            if handle.visible != free:
                handle.visible = free
        self.take_ranges()

    def take_ranges(self) -> None:
        """Bring the inputs and the text in line with the session's model."""
        session = self._workplace.session
        model = (session.dissection, session.theory)
        if model == self._model:
            return
        self._model = model
        titles = self._offered()
        if titles != self._titles:
            self._titles = titles
            self._preset.options = tuple(titles)
        self._preset.value = session.dissection.preset.title
        low, high, step, value = self._threshold_scale()
        self._threshold.min, self._threshold.max, self._threshold.step = low, high, step
        self._threshold.value = value
        self._about.content = self._about_html()

    def _offered(self) -> dict[str, str]:
        presets = self._workplace.session.presets_offered()
        return {preset.title: preset.name for preset in presets}

    def _set_threshold(self, threshold: float) -> None:
        if not self._workplace.in_exercise:
            self._workplace.session.set_threshold(threshold)

    def _choose_preset(self, title: object) -> None:
        workplace, name = self._workplace, self._titles.get(str(title))
        session = workplace.session
        if name is None or name == session.dissection.preset.name or workplace.in_exercise:
            return
        workplace.keep_run()
        workplace.attempt("Preparing the duct.", lambda: session.choose_preset(name))
        workplace.pulls += 1
        self._preset.value = session.dissection.preset.title

    def _threshold_scale(self) -> tuple[float, float, float, float]:
        """Return the threshold slider's ends, step and value, kPa, in round numbers."""
        low, high = (KPA_PER_MPA * end for end in self._workplace.session.threshold_range)
        step = slider_step(high)
        value = KPA_PER_MPA * self._workplace.session.threshold
        low, high, value = (round(step * round(end / step), 9) for end in (low, high, value))
        return low, high, step, value

    def _about_html(self) -> str:
        session = self._workplace.session
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
            f"<div style='padding:6px 12px;font-size:13px'><b>{html.escape(heading)}</b>"
            f"<div style='opacity:.85;margin-top:2px'>{html.escape(text)}</div></div>"
            for heading, text in paragraphs
        )
