"""The row at the top of every panel in which a page's scene is chosen, and its key."""

from collections.abc import Callable

import viser

from app.trainer.client.practice import SCENES, SceneName
from app.trainer.panel.controls import Choice


def add_scenes(
    gui: viser.GuiApi, scene: SceneName, choose_scene: Callable[[SceneName], None]
) -> None:
    """Add the choice of a scene, of which one is shown."""
    names = list(SCENES)
    words: dict[SceneName, tuple[str, str]] = {
        name: (start.label, start.hint) for name, start in SCENES.items()
    }
    choice = Choice(gui, "Scene", words, choose_scene, slow=True, hidden=True, large=True)
    choice.show(scene)
    following = names[(names.index(scene) + 1) % len(names)]
    command = gui.add_command("Next scene", description="what is in hand", hotkey="M")
    command.on_trigger(lambda _: choose_scene(following))
