"""The choice of the band of *Distance to break*: how far ducts differ in modulus and strength."""

import viser

from app.simulation import LIMITS, Spread
from app.trainer.client.page_state import PageState
from app.trainer.panel.controls import number, on_input, set_if_changed

HINT = "Two thirds of ducts lie within this factor of the preset's figure; 1: all are alike"


class SpreadBox:
    """A checkbox and two factors."""

    def __init__(self, gui: viser.GuiApi, state: PageState) -> None:
        self._state, self._preset = state, state.session.specimen.preset
        spread = state.spread or Spread.of(self._preset)
        self._on = gui.add_checkbox(
            "90 % band",
            initial_value=state.spread is not None,
            hint="Beside Distance to break: where it would be for ducts of other tissue",
        )
        self._factors = tuple(
            gui.add_number(
                f"{name} factor",
                value,
                min=LIMITS[limit][0],
                max=LIMITS[limit][1],
                step=0.01,
                hint=HINT,
                visible=state.spread is not None,
            )
            for name, value, limit in (
                ("Modulus", spread.modulus_factor, "modulus_factor"),
                ("Strength", spread.strength_factor, "strength_factor"),
            )
        )
        for handle in (self._on, *self._factors):
            on_input(handle, lambda _: self._take())

    def show(self) -> None:
        """Take the factors of another preset."""
        preset = self._state.session.specimen.preset
        if preset == self._preset:
            return
        self._preset, spread = preset, Spread.of(preset)
        for field, value in zip(
            self._factors, (spread.modulus_factor, spread.strength_factor), strict=True
        ):
            set_if_changed(field, value=value)
        self._take()

    def _take(self) -> None:
        modulus, strength = (number(field.value) for field in self._factors)
        known = all(1.0 <= each <= LIMITS["modulus_factor"][1] for each in (modulus, strength))
        wanted = self._on.value is True and known
        self._state.show_spread(Spread(modulus, strength) if wanted else None)
        for field in self._factors:
            set_if_changed(field, visible=self._on.value is True)
