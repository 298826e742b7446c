"""What the hands in space have, and how far the jaws are open."""

from functools import partial

import viser

from app.simulation import MOST_OPENING, Instrument, Reading
from app.trainer.client.page_state import PageState
from app.trainer.panel.controls import Choice, note, number, on_click, on_input, set_if_changed
from app.trainer.panel.readout import HANDS

OFFERED: dict[Instrument, tuple[str, str]] = {
    "hook": ("Hook", "Takes the duct where you press, and lets go with the mouse"),
    "grasper": ("Grasper", "Takes the duct where you press, and stays where it is left"),
    "dissector": ("Dissector", "Two jaws behind the duct that part strands by opening"),
    "swab": ("Swab", "A soft tip that parts strands by sweeping"),
}
HOW: dict[Instrument, str] = {
    "hook": "Press the duct to take it, drag to pull. It lets go with the mouse.",
    "grasper": "Press the duct to take it, drag to pull. It stays until you let go (G).",
    "dissector": "With Shift or the right button drag it into the picture, behind the duct. Then "
    "open its jaws by the slider or with O.",
    "swab": "Drag it down beside the duct, then along it.",
}
BY_DEVICE = "The hand on the device has it. Its button a takes the duct and lets go; so does G."


class HandsBox:
    """The boxes of both hands; `add_lower` adds those that stand below what all ducts have."""

    def __init__(self, gui: viser.GuiApi, state: PageState) -> None:
        self._state = state
        self._hands = [
            Choice(gui, name, OFFERED, partial(state.choose_instrument, hand))
            for hand, name in enumerate(HANDS)
        ]
        self._how = gui.add_html("")
        self._jaws = gui.add_slider(
            "Jaws (mm)",
            min=0.0,
            max=MOST_OPENING,
            step=0.5,
            initial_value=0.0,
            visible=False,
            hint="Between the dissector's jaws (O opens, C closes)",
        )
        on_input(self._jaws, lambda value: state.open_jaws(number(value)))

    def add_lower(self, gui: viser.GuiApi) -> None:
        """Add what lets hands go, and leads drags into the picture."""
        state = self._state
        # Above the buttons that come and go: it does not move from under a pointer.
        self._depth = gui.add_checkbox(
            "Into the picture",
            initial_value=state.into_picture,
            hint="For fingers: as with Shift or the right button, up is away from you",
        )
        on_input(self._depth, lambda value: state.show(into_picture=value is True))
        self._release = [
            gui.add_button(
                f"{name}: let go",
                icon=viser.Icon.HAND_GRAB,
                color="gray",
                visible=False,
                hint="Let go of the duct (G)",
            )
            for name in HANDS
        ]
        for hand, button in enumerate(self._release):
            on_click(button, partial(state.let_go, hand))

    def show(self, reading: Reading) -> None:
        """Show a reading."""
        state = self._state
        hands = state.shown.tissue.hands
        for number_, (choice, hand) in enumerate(zip(self._hands, hands, strict=True)):
            choice.show(hand.instrument, active=number_ == state.hand)
        holder = hands[state.hand]
        how = BY_DEVICE if state.hand < state.device_hands else HOW[holder.instrument]
        set_if_changed(self._how, content=note(f"<b>{HANDS[state.hand]}.</b> {how}", "how"))
        set_if_changed(self._jaws, visible=holder.instrument == "dissector")
        if self._jaws.value != holder.target_opening:
            self._jaws.value = holder.target_opening
        live = state.playback is None
        for button, held in zip(self._release, reading.holding, strict=True):
            set_if_changed(button, visible=held and live)
