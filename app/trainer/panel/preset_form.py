"""A preset of one's own: modulus, strength, wall and clamps, typed or from a preset file."""

import html
from collections.abc import Callable
from typing import Any

import msgspec
import viser

from app.simulation import (
    LIMITS,
    BeamModel,
    Dissection,
    OrganBeam,
    Preset,
    preset_toml,
    read_preset,
)
from app.trainer.client.page_state import PageState
from app.trainer.panel.controls import (
    KPA_PER_MPA,
    figure,
    note,
    number,
    on_click,
    on_input,
    rows_html,
    set_if_changed,
)

STRESS, FORCE = "Stress", "Force at mid-span"
# Decimals of a typed number: a tenth of a micrometre, a ten-thousandth of a kPa.
DIGITS = 4
YOURS, REST = "Yours: ", ". The rest: "
"""Start of an edited preset's source, and what precedes the source that it was edited from."""


class PresetForm:
    """Number fields of the preset in use, and what other numbers in them would change.

    The session is not changed before the user applies them: a half-typed number is not a duct.
    """

    def __init__(self, gui: viser.GuiApi, state: PageState) -> None:
        self._state = state
        self._dissection: Dissection | None = None
        self._shown: dict[str, float] = {}
        # In a folder: viser shows an upload button whether it is visible or not.
        self._folder = gui.add_folder("Figures of your own")
        with self._folder:
            self._fields = {
                "modulus": _field(gui, "Modulus E (kPa)", "modulus_MPa", "Young's modulus", 1e3),
                "nu": _field(gui, "Poisson's ratio", "poisson_ratio", "Of the material", 1.0),
            }
            self._kind = gui.add_dropdown(
                "Strength as", (STRESS, FORCE), hint="What is known of the break"
            )
            self._fields |= {
                "stress": _field(
                    gui, "Strength (kPa)", "break_stress_MPa", "Stress at which it tears", 1e3
                ),
                "force": _field(
                    gui, "Break force (N)", "break_force_N", "Force at which it tears", 1.0
                ),
                "wall": _field(
                    gui, "Wall (mm)", "wall_mm", "0: as in the images; of a bar, full", 1.0, 0.0
                ),
                "first": _field(gui, "First clamp (mm)", "span_mm", "From its start", 1.0, 0.0),
                "second": _field(gui, "Second clamp (mm)", "span_mm", "From its start", 1.0, 0.0),
            }
            self._note = gui.add_html("")
            self._use = gui.add_button("Use these figures", icon=viser.Icon.PLAYER_PLAY)
            self._save = gui.add_button(
                "Save preset", icon=viser.Icon.DOWNLOAD, color="gray",
                hint="A file for here, and for --preset on the command line",
            )  # fmt: skip
            self._open = gui.add_upload_button(
                "Open preset", icon=viser.Icon.UPLOAD, color="gray", mime_type=".toml",
                hint="A preset file, TOML",
            )  # fmt: skip
        for field in (*self._fields.values(), self._kind):
            on_input(field, lambda _: self._typed())
        on_click(self._use, self._take)
        on_click(self._save, self._send)

        @self._open.on_upload
        def _(_: object) -> None:
            sent = self._open.value
            self._start(lambda: read_preset(sent.content, sent.name))

        self.show()

    def see(self, visible: bool) -> None:
        """Show or hide the fields: no change in an exercise, in a replay or of a torn duct."""
        set_if_changed(self._folder, visible=visible)

    def show(self) -> None:
        """Put the numbers of the preset in use into the fields, if it has changed."""
        dissection = self._state.session.tissue.dissection
        if dissection is self._dissection:
            return
        self._dissection, preset = dissection, dissection.preset
        first, second = dissection.clamps
        model = BeamModel.of(dissection, self._state.session.specimen.solved_by)
        stress, force = preset.break_stress_MPa, preset.break_force_N
        figures = {
            "modulus": KPA_PER_MPA * preset.modulus_MPa,
            "nu": preset.poisson_ratio,
            "stress": KPA_PER_MPA * (model.threshold if stress is None else stress),
            "force": model.break_force if force is None else force,
            "wall": preset.beam.wall_mm or 0.0,
            "first": first,
            "second": second,
        }
        self._shown = {name: round(value, DIGITS) for name, value in figures.items()}
        for name, value in self._shown.items():
            self._fields[name].value = value
        self._kind.value = STRESS if force is None else FORCE
        self._typed()

    def _typed(self) -> None:
        """Find in the background what the typed numbers would change, and update the fields."""
        by_force = self._kind.value == FORCE
        for name, visible in (("force", by_force), ("stress", not by_force)):
            set_if_changed(self._fields[name], visible=visible)
        state = self._state
        state.when_free(state.workers.awaited, (id(self), "figures"), self._preview)

    def _preview(self) -> None:
        dissection, theory = self._dissection, self._state.session.specimen.solved_by
        if dissection is None:
            return
        try:
            preset, own = self._edited(dissection)
            after = BeamModel.of(Dissection.of(dissection.organ, preset), theory)
            content = _change_html(BeamModel.of(dissection, theory), after, own)
            fits = bool(own)
        except ValueError as error:
            content, fits = note(html.escape(str(error)), "figures-wrong"), False
        if dissection is self._dissection:
            self._note.content = content
            self._use.disabled = not fits

    def _edited(self, dissection: Dissection) -> tuple[Preset, list[str]]:
        """Return the preset with the typed numbers, and the names of those that differ."""
        preset, beam = dissection.preset, dissection.preset.beam
        typed = {name: number(field.value) for name, field in self._fields.items()}
        changed = {name for name, value in typed.items() if value != self._shown[name]}
        by_force = self._kind.value == FORCE
        changes: dict[str, Any] = {}
        own: list[str] = []
        if "modulus" in changed:
            changes["modulus_MPa"] = typed["modulus"] / KPA_PER_MPA
            own.append("modulus")
        if "nu" in changed:
            changes["poisson_ratio"] = typed["nu"]
            own.append("Poisson's ratio")
        if by_force != (preset.break_force_N is not None) or changed & (
            {"force"} if by_force else {"stress"}
        ):
            changes["break_force_N"] = typed["force"] if by_force else None
            changes["break_stress_MPa"] = None if by_force else typed["stress"] / KPA_PER_MPA
            own.append("strength")
        places: dict[str, Any] = {}
        if "wall" in changed:
            places["wall_mm"] = typed["wall"] or None
            own.append("wall")
        if changed & {"first", "second"}:
            first, second = (
                typed[name] if name in changed else clamp
                for name, clamp in zip(("first", "second"), dissection.clamps, strict=True)
            )
            if isinstance(beam, OrganBeam):
                places["clamps_mm"] = (first, second)
            else:
                places |= {"span_mm": second - first, "first_clamp_mm": first}
            own.append("clamps")
        if not own:
            return preset, own
        edited = {name: getattr(preset, name) for name in preset.__struct_fields__}
        edited |= changes
        edited["beam"] = msgspec.convert(
            {"section": "organ" if isinstance(beam, OrganBeam) else "round"}
            | {name: getattr(beam, name) for name in beam.__struct_fields__}
            | places,
            type(beam),
        )
        edited |= _note(preset, own)
        return Preset(**edited), own

    def _take(self) -> None:
        dissection = self._dissection
        if dissection is not None:
            self._start(lambda: self._edited(dissection)[0])

    def _start(self, read: Callable[[], Preset]) -> None:
        state = self._state
        state.attempt("Preparing the duct.", lambda: state.choose_preset(read()))

    def _send(self) -> None:
        state, dissection = self._state, self._dissection

        def write(dissection: Dissection) -> None:
            preset = self._edited(dissection)[0]
            state.send_file(f"{preset.name}.toml", preset_toml(preset))

        if dissection is not None:
            state.attempt("Writing the file.", lambda: write(dissection))


def _field(
    gui: viser.GuiApi, label: str, name: str, hint: str, unit: float, low: float | None = None
) -> viser.GuiNumberHandle[float]:
    """Add a number field with the limits of a preset's number, in the unit shown."""
    least, most, _ = LIMITS[name]
    least, most = unit * least if low is None else low, unit * most
    return gui.add_number(
        label,
        initial_value=max(least, 1.0) if most > 1.0 else least,
        min=least,
        max=most,
        step=10.0**-DIGITS,
        hint=f"{hint}; from {least:g} to {most:,g}",
    )


def _note(preset: Preset, own: list[str]) -> dict[str, str]:
    """Return the name and the source of an edited preset."""
    source = preset.source
    if source.startswith(YOURS) and REST in source:
        before, source = source.removeprefix(YOURS).split(REST, 1)
        own = [*before.split(", "), *(each for each in own if each not in before)]
    ships = preset.ships
    return {
        "name": f"{preset.name}-own" if ships else preset.name,
        "title": f"{preset.label}, own figures" if ships else preset.label,
        "source": f"{YOURS}{', '.join(own)}{REST}{source}",
        "confidence": "low",
        "confidence_note": f"Some figures are yours. {preset.confidence_note}"
        if ships
        else preset.confidence_note,
    }


def _change_html(now: BeamModel, after: BeamModel, own: list[str]) -> str:
    texts = [
        (name, figure(before), f"<b>{figure(value)}</b>", f"&nbsp;{unit}")
        for (name, before, unit), (_, value, _) in zip(_results(now), _results(after), strict=True)
    ]
    right = "text-align:right;padding-right:8px", "text-align:right"
    rows = rows_html(texts, "padding:1px 8px 1px 0;opacity:.8", *right, "")
    message = (
        f"Yours: {', '.join(own)}." if own else "All as the preset has it; its source is below."
    )
    return (
        f"<div data-testid='figures' data-breaks-at-n='{after.break_force:.6g}'"
        f" data-own='{len(own)}' style='padding:2px 12px 8px;font-size:13px'>"
        "<table style='font-variant-numeric:tabular-nums'><tr style='opacity:.8'><td></td>"
        "<td style='text-align:right;padding-right:8px'>now</td>"
        f"<td style='text-align:right'>typed</td><td></td></tr>{rows}</table>"
        f"<div style='padding-top:4px'>{html.escape(message)}</div></div>"
    )


def _results(model: BeamModel) -> tuple[tuple[str, float, str], ...]:
    beam = model.dissection.beam
    # The stiffness of a pull too small to stretch the beam.
    small = 1e-4 * beam.fibre_distance
    pulled = model.theory.pull(beam, 0.5 * beam.span).to_deflection(small)
    return (
        ("Breaks at, mid-span", model.break_force, "N"),
        ("Threshold T", KPA_PER_MPA * model.threshold, "kPa"),
        ("Stiffness at rest", pulled.force / small, "N/mm"),
        ("Between the clamps", beam.span, "mm"),
        ("Area", beam.area, "mm²"),
        ("Second moment", beam.second_moment, "mm⁴"),
    )
