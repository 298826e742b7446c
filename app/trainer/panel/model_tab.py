"""Model: which duct it is, what holds it, when it tears, and where the figures come from."""

import html

import viser

from app.simulation import BeamModel, BedPreset, Phase, Preset, Reading, bed_presets, fits
from app.trainer.client.page_state import PageState
from app.trainer.panel.compare_tab import OFFERED_THEORIES
from app.trainer.panel.controls import (
    KPA_PER_MPA,
    figure,
    heading,
    note,
    number,
    on_input,
    on_work,
    paragraphs_html,
    rows_html,
    set_if_changed,
    slider_step,
)
from app.trainer.panel.preset_form import PresetForm
from app.trainer.panel.spread_box import SpreadBox

SIMPLE_PICTURE = "Simple picture"
MOST_SEED = 9999
NO_BED = "None: a free duct"

_POINTS = (
    "<span style='color:#40e0f0'>&#9679;</span> <b>Key points</b> on the sections kept from the "
    "images give the surface; the beam moves the <span style='color:#ffb220'>&#9679;</span> "
    "<b>driving points</b>, and the surface between them follows."
)


class ModelTab:
    """The tab of the model."""

    def __init__(self, gui: viser.GuiApi, state: PageState) -> None:
        self._state = state
        specimen = state.session.specimen
        self._own: Preset | None = None
        self._titles = self._offered()
        self._preset = gui.add_dropdown(
            "Duct",
            tuple(self._titles),
            initial_value=self._title(),
            hint="Material, section and break, with their sources below",
        )
        self._beds: dict[str, BedPreset | None] = {bed.title: bed for bed in bed_presets().values()}
        self._beds[NO_BED] = None
        self._bed = gui.add_dropdown(
            "Bed",
            tuple(self._beds),
            initial_value=_bed_title(specimen.bed),
            hint="The tissue that holds the duct, with its source below; it needs both hands",
        )
        self._seed = gui.add_number(
            "Bed's number",
            specimen.bed_seed,
            min=1,
            max=MOST_SEED,
            step=1,
            visible=specimen.bed is not None,
            hint="The scatter of the strands is drawn from it: the same number, the same bed",
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
        self._spread = SpreadBox(gui, state)
        self._thresholds = gui.add_html("")
        self._about = gui.add_html(self._about_html())
        self._shown = specimen
        self._solve_thresholds()
        on_work(self._preset, self._choose_preset)
        on_work(self._bed, lambda _: self._choose_bed())
        on_work(self._seed, lambda _: self._choose_bed())
        on_input(self._threshold, lambda kpa: self._set_threshold(number(kpa) / KPA_PER_MPA))
        on_input(self._plain, lambda value: state.show(plain=value is True))
        on_input(self._points, lambda value: state.show(overlay=value is True))

    def show(self, reading: Reading) -> None:
        """Enable what can be chosen now."""
        state = self._state
        set_if_changed(self._plain, value=state.plain)
        self._spread.show()
        free = state.playback is None and not state.in_exercise
        whole = reading.phase is Phase.INTACT
        # A torn duct in a plane lies in two until it is reset.
        chooses = free and (whole or not state.in_plane)
        for handle in (self._preset, self._bed):
            set_if_changed(handle, visible=chooses)
        set_if_changed(self._threshold, visible=free and whole)
        set_if_changed(self._seed, visible=chooses and state.session.specimen.bed is not None)
        self._form.see(chooses)
        self.take_ranges()

    def take_ranges(self) -> None:
        """Bring the inputs and the text in line with what is in hand."""
        specimen = self._state.session.specimen
        if specimen == self._shown:
            return
        self._shown = specimen
        titles = self._offered()
        if titles != self._titles:
            self._titles = titles
            self._preset.options = tuple(titles)
        self._preset.value = self._title()
        set_if_changed(self._bed, value=_bed_title(specimen.bed))
        set_if_changed(self._seed, value=specimen.bed_seed)
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
        now = session.tissue.dissection.preset
        if not now.ships:
            self._own = now
        elif self._own is not None and fits(organ, self._own):
            presets.append(self._own)
        if now not in presets:
            presets.append(now)
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

    def _choose_bed(self) -> None:
        state, specimen = self._state, self._state.session.specimen
        bed = self._beds.get(self._bed.value, specimen.bed)
        wanted = number(self._seed.value)
        seed = round(wanted) if 1 <= wanted <= MOST_SEED else specimen.bed_seed
        if state.in_exercise or (bed, seed) == (specimen.bed, specimen.bed_seed):
            return
        state.attempt("Preparing the bed.", lambda: state.choose_bed(bed, seed))

    def _threshold_scale(self) -> tuple[float, float, float, float]:
        """Return the threshold slider's ends, step and value, kPa, in round numbers."""
        tissue = self._state.session.tissue
        low, high = (KPA_PER_MPA * end for end in tissue.threshold_range)
        step = slider_step(high)
        value = KPA_PER_MPA * tissue.threshold
        low, high, value = (round(step * round(end / step), 9) for end in (low, high, value))
        return low, high, step, value

    def _solve_thresholds(self) -> None:
        """Find every theory's threshold and break of the duct without a bed, in the background."""
        state, shown = self._state, self._shown

        def solve() -> None:
            rows: list[tuple[str, str, str]] = []
            for label, theory in OFFERED_THEORIES.items():
                try:
                    found = BeamModel.of(shown.dissection, theory)
                except ValueError:
                    threshold, force = "–", "ends before"
                else:
                    threshold = figure(KPA_PER_MPA * found.threshold)
                    force = figure(found.break_force)
                rows.append((html.escape(label), threshold, force))
            lines = rows_html(
                rows, "padding-right:8px", "text-align:right;padding-right:8px", "text-align:right"
            )
            if shown is self._shown:
                self._thresholds.content = (
                    "<div data-testid='thresholds' style='padding:2px 12px 8px;font-size:12px'>"
                    "<table style='font-variant-numeric:tabular-nums'><tr style='opacity:.8'>"
                    "<td>Theory, of the free duct</td><td style='text-align:right'>T (kPa)</td>"
                    f"<td style='text-align:right'>breaks at (N)</td></tr>{lines}</table>"
                    "</div>"
                )

        state.when_free(state.workers.background, (id(self), "thresholds"), solve)

    def _about_html(self) -> str:
        specimen = self._state.session.specimen
        preset, bed, beam = specimen.preset, specimen.bed, specimen.beam
        geometry = (
            f"{specimen.section}. "
            f"Area {beam.area:.1f} mm², "
            f"second moment {beam.second_moment:.0f} mm⁴, outer fibre at "
            f"{beam.fibre_distance:.2f} mm. Young's modulus {KPA_PER_MPA * beam.modulus:,.0f} kPa, "
            f"Poisson's ratio {beam.poisson_ratio:g}."
        )
        held = (
            ()
            if bed is None
            else (
                (bed.title, bed.description),
                (
                    "Energy to part it",
                    f"{bed.toughness_J_per_m2:g} J/m² of the duct's surface that it holds.",
                ),
                ("Source", bed.source),
                (f"Confidence: {bed.confidence}", bed.confidence_note),
            )
        )
        return heading("Where these figures come from") + paragraphs_html(
            *held,
            (preset.label, preset.description),
            ("Beam", geometry),
            ("Strength as given", preset.strength),
            ("Source", preset.source),
            (f"Confidence: {preset.confidence}", preset.confidence_note),
        )


def _bed_title(bed: BedPreset | None) -> str:
    return NO_BED if bed is None else bed.title
