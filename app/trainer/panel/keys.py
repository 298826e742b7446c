"""The keys of a panel."""

from collections.abc import Callable, Container, Iterable, Mapping

from app.trainer.client.page_state import PageState
from app.trainer.panel.help import Key
from app.trainer.viser_bridge.page import offer_home


def add_keys(
    state: PageState,
    keys: Iterable[Key],
    actions: Mapping[str, Callable[[], object]],
    anytime: Container[str],
) -> None:
    """Let keys act, by their names; while a replay is shown only those of `anytime` do."""
    for key in keys:
        command = state.client.gui.add_command(
            key.title, description=key.meaning, hotkey=key.hotkey, modifier=key.modifier
        )

        @command.on_trigger
        async def _(_: object, act=actions[key.name], always=key.name in anytime) -> None:  # pyright: ignore
            if always or state.playback is None:
                act()

        if key.name == "V":
            offer_home(state.client, command, f"{key.title} ({key.name})", key.meaning)
