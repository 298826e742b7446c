"""Compare: the theory in use, a ghost by another, and the mass-spring chain."""

from collections.abc import Callable

import viser

from app.simulation import GhostReading, Phase, Reading
from app.trainer.client.page_state import PageState
from app.trainer.panel.controls import figure, heading, note, on_work, rows_html, set_if_changed
from physics import Cubic, Exact, Fem, NeoHooke, TautString, Theory

OFFERED_THEORIES: dict[str, Theory] = {
    "Cubic beam (Rayleigh)": Cubic(),
    "String (very large deflection)": TautString(),
    "Exact beam": Exact(),
    "Exact beam, shear, neo-Hookean": Exact(NeoHooke()),
    "Finite elements (the thesis's reference)": Fem(),
}
"""Theories that are fast enough to be stepped for a room of trainees, by their labels."""
IN_SPACE = "In space, two hands (exact beam)"
ANY_THEORY: dict[str, Theory | None] = {**OFFERED_THEORIES, IN_SPACE: None}
NO_GHOST = "None"
_FIRST_TIME = "The first time after an installation takes up to a minute."
_SPACE = (
    "<b>In space</b> the duct is the exact beam with shear under two hands, each with an "
    "instrument of its own, as in a bed. In the plane of the pull any theory solves it, with a "
    "force that can be set, a ghost and a chain."
)
_IN_BED = (
    "A duct in its bed is solved by one theory only, the exact beam with shear. <b>A free duct</b> "
    "(above) can be compared: by six theories, with a ghost and a chain of masses and springs."
)
_TELLING = (
    "The <b>ghost</b> is the same duct by another theory under the same load, in blue over yours. "
    "By hand both have one deflection and differ in force; by the slider it is the other way round."
)
_CHAIN = (
    "The <b>chain</b> is what games and many simulators use: masses and springs, which "
    "overshoot and swing before they settle. It hangs before the duct, slowed so that its swing "
    "can be seen."
)


class CompareTab:
    """The tab of theories."""

    def __init__(self, gui: viser.GuiApi, state: PageState) -> None:
        self._state = state
        self._choosing = 0
        session = state.session
        self._theory = gui.add_dropdown(
            "Theory",
            tuple(ANY_THEORY),
            initial_value=_label(session.specimen.theory),
            hint="How the beam is solved; each theory has its own threshold",
        )
        self._ghost = gui.add_dropdown(
            "Ghost",
            (NO_GHOST, *OFFERED_THEORIES),
            initial_value=self._ghost_label(),
            hint="Another theory under the same load, laid over the duct",
            visible=state.in_plane,
        )
        self._numbers = gui.add_html("")
        self._chain = gui.add_checkbox(
            "Chain",
            initial_value=session.chain is not None,
            hint="A chain of masses and springs beside the duct, under the same load",
            visible=state.in_plane,
        )
        self._chain_numbers = gui.add_html("")
        # What a duct has, a bed or not, comes with a panel of its own.
        in_plane = note(_TELLING) + note(_CHAIN) if state.in_plane else ""
        in_bed = session.specimen.bed is not None
        gui.add_html(note(_IN_BED) if in_bed else note(_SPACE) + in_plane)
        on_work(self._theory, self._choose_theory)
        on_work(self._ghost, self._choose_ghost)
        on_work(self._chain, lambda value: session.show_chain(value is True))

    def show(self, reading: Reading) -> None:
        """Show a reading beside the ghost's and the chain's."""
        state, session = self._state, self._state.session
        visible, live = state.figures_visible, state.playback is None
        free = session.specimen.bed is None
        settled = free and reading.phase is Phase.INTACT and not state.in_exercise and live
        set_if_changed(self._theory, visible=settled)
        for handle, value in (
            (self._theory, _label(session.specimen.theory)),
            (self._ghost, self._ghost_label()),
        ):
            if not self._choosing:
                set_if_changed(handle, value=value)
        shown = visible and live
        ghost = session.ghost_reading() if shown else None
        if ghost is not None:
            content = _ghost_html(reading, ghost, self._ghost_label())
        elif shown and session.ghost is not None:
            content = note("The ghost's theory ends before this load.")
        else:
            content = ""
        set_if_changed(self._numbers, content=content)
        chain = session.chain if shown else None
        content = (
            ""
            if chain is None
            else note(
                f"Chain: <b>{figure(chain.force)}</b> N at <b>{figure(chain.deflection)}</b> mm; "
                f"swings {figure(chain.slowed)} times slower than flesh would.",
                "chain",
            )
        )
        set_if_changed(self._chain_numbers, content=content)

    def _choose_theory(self, label: object) -> None:
        state = self._state
        if label not in ANY_THEORY or state.in_exercise:
            return
        theory = ANY_THEORY[str(label)]
        self._choose(f"Preparing: {label}.", lambda: state.choose_theory(theory))

    def _choose_ghost(self, label: object) -> None:
        theory = OFFERED_THEORIES.get(str(label))
        session = self._state.session
        self._choose(f"Preparing: {label}.", lambda: session.choose_ghost(theory))

    def _choose(self, what: str, action: Callable[[], object]) -> None:
        self._choosing += 1
        try:
            self._state.attempt(f"{what} {_FIRST_TIME}", action)
        finally:
            self._choosing -= 1
        self._theory.value = _label(self._state.session.specimen.theory)
        self._ghost.value = self._ghost_label()

    def _ghost_label(self) -> str:
        ghost = self._state.session.ghost_theory
        return NO_GHOST if ghost is None else _label(ghost)


def _ghost_html(reading: Reading, ghost: GhostReading, label: str) -> str:
    left, others_left = (max(each.check.distance_to_break, 0.0) for each in (reading, ghost))
    rows = (
        ("Force F", reading.force, ghost.force, ghost.force_difference, "N"),
        ("Deflection", reading.deflection, ghost.deflection, ghost.deflection_difference, "mm"),
        ("Distance to break", 100.0 * left, 100.0 * others_left, 100.0 * (others_left - left), "%"),
    )
    texts = [
        (
            name,
            figure(own),
            figure(other),
            f"<b>{'+' if difference >= 0.0 else '−'}{figure(abs(difference))}</b>"
            f"{_percent(own, difference) if unit != '%' else ''}",
            f"<span style='opacity:.7'>{unit}</span>",
        )
        for name, own, other, difference, unit in rows
    ]
    lines = rows_html(texts, "padding:2px 0", *["text-align:right;padding:2px 0 2px 6px"] * 4)
    return (
        f"<div data-testid='ghost' data-force-difference-n='{ghost.force_difference:.6g}'"
        f" data-deflection-difference-mm='{ghost.deflection_difference:.6g}'>"
        f"{heading(label)}<table style='width:calc(100% - 24px);margin:0 12px 8px;"
        "border-collapse:collapse;font-size:12px;font-variant-numeric:tabular-nums'>"
        "<tr style='opacity:.7'><td></td><td style='text-align:right'>yours</td>"
        "<td style='text-align:right'>ghost</td><td style='text-align:right'>difference</td>"
        f"<td></td></tr>{lines}</table></div>"
    )


def _percent(own: float, difference: float) -> str:
    if abs(own) < 1e-9:
        return ""
    return f" <span class='bd-wide' style='opacity:.7'>({100.0 * difference / own:+.0f} %)</span>"


def _label(theory: Theory | None) -> str:
    return next(label for label, offered in ANY_THEORY.items() if offered == theory)
