"""What the panels of both modes share: how they look, the choice of the mode, and the keys."""

from collections.abc import Callable, Mapping, Sequence

import viser
from viser import theme

from app.trainer.client.client_state import ClientState, Mode
from app.trainer.panel.controls import Choice
from app.trainer.panel.help import Key
from app.trainer.viser_bridge.page import offer_home

__all__ = ["DISCLAIMER", "LEARN", "REPLAY", "add_disclaimer", "add_keys", "dress_panel"]

DISCLAIMER = "Not clinically validated, not a medical device."
LEARN, REPLAY = "Learn", "Replay"
WIDTH = 364
"""px."""
BRAND = (38, 166, 154)
SHOWN: dict[Mode, tuple[str, str]] = {
    "dissect": ("Dissect", "Free the duct from its bed, before it tears (M)"),
    "pull": ("Pull", "Pull a duct that no bed holds: compare theories, build your own (M)"),
}


def dress_panel(gui: viser.GuiApi, state: ClientState, mode: Mode) -> None:
    """Set the panel's theme and place, and begin it with the choice of the mode."""
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
    gui.set_panel_label("Controls")
    gui.main_panel.dock_right()
    gui.main_panel.set_width(WIDTH)

    choice = Choice(gui, "Mode", SHOWN, state.choose_mode, slow=True, hidden=True, large=True)
    choice.show(mode)
    other: Mode = "pull" if mode == "dissect" else "dissect"
    command = gui.add_command("Change the mode", description="Dissect or Pull", hotkey="M")
    command.on_trigger(lambda _: state.choose_mode(other))


def add_disclaimer(gui: viser.GuiApi) -> None:
    """Say what this is not."""
    gui.add_html(
        "<div data-testid='disclaimer' style='padding:0 14px 6px;"
        f"font-size:11px;opacity:.75'>{DISCLAIMER}</div>"
    )


def add_keys(
    state: ClientState,
    keys: Sequence[Key],
    actions: Mapping[str, Callable[[], object]],
    anytime: Mapping[str, Callable[[], object]],
) -> None:
    """Let keys act, by their names; while a replay is shown only those of `anytime` do."""
    for key in keys:
        command = state.client.gui.add_command(
            key.title, description=key.meaning, hotkey=key.hotkey, modifier=key.modifier
        )
        act = actions.get(key.name) or anytime[key.name]
        always = key.name in anytime

        @command.on_trigger
        async def _(_: object, act=act, always=always) -> None:  # pyright: ignore
            if always or state.playback is None:
                act()

        if key.name == "V":
            offer_home(state.client, command, f"{key.title} ({key.name})", key.meaning)


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
