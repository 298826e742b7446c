"""Bed: what holds the duct, which duct it is, and where their figures come from."""

import viser

from app.simulation import fits, presets
from app.simulation.bed import bed_presets
from app.trainer.client.dissect_state import DissectState
from app.trainer.panel.controls import (
    heading,
    number,
    on_input,
    on_work,
    paragraphs_html,
    set_if_changed,
)
from app.trainer.panel.model_tab import SIMPLE_PICTURE
from app.trainer.panel.spread_box import SpreadBox

__all__ = ["BedTab"]

MOST_SEED = 9999


class BedTab:
    """The tab of the bed and the duct in it."""

    def __init__(self, gui: viser.GuiApi, state: DissectState) -> None:
        self._state = state
        duct = state.session.duct
        organ, preset = duct.dissection.organ, duct.dissection.preset
        self._beds = {bed.title: bed for bed in bed_presets().values()}
        self._bed = gui.add_dropdown(
            "Bed",
            tuple(self._beds),
            initial_value=duct.bed.title,
            hint="The tissue that holds the duct, with its source below",
        )
        self._seed = gui.add_number(
            "Bed's number",
            duct.seed,
            min=1,
            max=MOST_SEED,
            step=1,
            hint="The scatter of the strands is drawn from it: the same number, the same bed",
        )
        offered = [each for each in presets().values() if fits(organ, each)]
        if preset not in offered:
            offered.append(preset)
        self._presets = {each.label: each for each in offered}
        self._preset = gui.add_dropdown(
            "Duct",
            tuple(self._presets),
            initial_value=preset.label,
            hint="Material, section and break, with their sources below",
        )
        self._plain = gui.add_checkbox(
            SIMPLE_PICTURE,
            initial_value=state.plain,
            hint="Two colours and no gloss, for a page that draws slowly",
        )
        self._spread = SpreadBox(gui, state, lambda: state.session.duct.dissection.preset)
        self._about = gui.add_html("")
        self._shown: object = None
        on_work(self._bed, lambda _: self._choose_bed())
        on_work(self._seed, lambda _: self._choose_bed())
        on_work(self._preset, self._choose_preset)
        on_input(self._plain, lambda value: state.show(plain=value is True))

    def show(self) -> None:
        """Bring the inputs and the text in line with the session's bed and duct."""
        state = self._state
        set_if_changed(self._plain, value=state.plain)
        self._spread.show()
        for handle in (self._bed, self._seed, self._preset):
            set_if_changed(handle, disabled=state.in_exercise or state.playback is not None)
        duct = state.session.duct
        shown = (duct.bed, duct.seed, duct.dissection.preset)
        if shown == self._shown:
            return
        self._shown = shown
        set_if_changed(self._bed, value=duct.bed.title)
        set_if_changed(self._seed, value=duct.seed)
        set_if_changed(self._preset, value=duct.dissection.preset.label)
        self._about.content = self._about_html()

    def _choose_bed(self) -> None:
        state, duct = self._state, self._state.session.duct
        bed = self._beds.get(self._bed.value)
        wanted = number(self._seed.value)
        seed = round(wanted) if 1 <= wanted <= MOST_SEED else duct.seed
        if bed is None or state.in_exercise or (bed, seed) == (duct.bed, duct.seed):
            return
        state.attempt("Preparing the bed.", lambda: state.choose_bed(bed.name, seed))

    def _choose_preset(self, label: object) -> None:
        state, preset = self._state, self._presets.get(str(label))
        if preset is None or state.in_exercise or preset == state.session.duct.dissection.preset:
            return
        state.attempt("Preparing the duct.", lambda: state.choose_preset(preset))

    def _about_html(self) -> str:
        duct = self._state.session.duct
        bed, preset = duct.bed, duct.dissection.preset
        return heading("Where these figures come from") + paragraphs_html(
            (bed.title, bed.description),
            (
                "Energy to part it",
                f"{bed.toughness_J_m2:g} J/m² of the duct's surface that it holds.",
            ),
            ("Source", bed.source),
            (f"Confidence: {bed.confidence}", bed.confidence_note),
            (preset.label, preset.description),
            ("Strength as given", preset.strength),
            ("Source", preset.source),
            (f"Confidence: {preset.confidence}", preset.confidence_note),
        )
