"""Bed: what holds the duct, which duct it is, and where their figures come from."""

import viser

from app.simulation import BedPreset, bed_presets, fits, presets
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
NO_BED = "None: a free duct"


class BedTab:
    """The tab of the bed and the duct in it."""

    def __init__(self, gui: viser.GuiApi, state: DissectState) -> None:
        self._state = state
        duct = state.session.specimen
        organ, preset = duct.dissection.organ, duct.preset
        self._beds: dict[str, BedPreset | None] = {bed.title: bed for bed in bed_presets().values()}
        self._beds[NO_BED] = None
        self._bed = gui.add_dropdown(
            "Bed",
            tuple(self._beds),
            initial_value=_title(duct.bed),
            hint="The tissue that holds the duct, with its source below",
        )
        self._seed = gui.add_number(
            "Bed's number",
            duct.bed_seed,
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
        self._spread = SpreadBox(gui, state, lambda: state.session.tissue.dissection.preset)
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
        duct = state.session.specimen
        shown = (duct.bed, duct.bed_seed, duct.preset)
        if shown == self._shown:
            return
        self._shown = shown
        set_if_changed(self._bed, value=_title(duct.bed))
        set_if_changed(self._seed, value=duct.bed_seed)
        set_if_changed(self._preset, value=duct.preset.label)
        self._about.content = self._about_html()

    def _choose_bed(self) -> None:
        state, duct = self._state, self._state.session.specimen
        bed = self._beds.get(self._bed.value, duct.bed)
        wanted = number(self._seed.value)
        seed = round(wanted) if 1 <= wanted <= MOST_SEED else duct.bed_seed
        if state.in_exercise or (bed, seed) == (duct.bed, duct.bed_seed):
            return
        state.attempt("Preparing the bed.", lambda: state.choose_bed(bed, seed))

    def _choose_preset(self, label: object) -> None:
        state, preset = self._state, self._presets.get(str(label))
        if preset is None or state.in_exercise or preset == state.session.tissue.dissection.preset:
            return
        state.attempt("Preparing the duct.", lambda: state.choose_preset(preset))

    def _about_html(self) -> str:
        duct = self._state.session.specimen
        bed, preset = duct.bed, duct.preset
        held = (
            ()
            if bed is None
            else (
                (bed.title, bed.description),
                (
                    "Energy to part it",
                    f"{bed.toughness_J_m2:g} J/m² of the duct's surface that it holds.",
                ),
                ("Source", bed.source),
                (f"Confidence: {bed.confidence}", bed.confidence_note),
            )
        )
        return heading("Where these figures come from") + paragraphs_html(
            *held,
            (preset.label, preset.description),
            ("Strength as given", preset.strength),
            ("Source", preset.source),
            (f"Confidence: {preset.confidence}", preset.confidence_note),
        )


def _title(bed: BedPreset | None) -> str:
    return NO_BED if bed is None else bed.title
