"""Opening a tab of the panel for a client: viser has no way to, but the page's own tabs have."""

import json

import viser
from viser import _messages  # pyright: ignore[reportPrivateUsage]

__all__ = ["open_tab"]

# The tab may not be drawn yet when this comes: it is looked for until it is, for a few seconds. In
# the panel at the side it opens by a key, in the one of a phone by a click.
_SCRIPT = """
(() => {
  const until = performance.now() + 5000;
  const open = () => {
    const tab = [...document.querySelectorAll("[role=tab]")]
      .find(each => each.textContent.trim() === LABEL);
    if (tab?.ariaSelected === "true") return;
    tab?.click();
    tab?.dispatchEvent(new KeyboardEvent("keydown", {key: "Enter", bubbles: true}));
    if (performance.now() < until) requestAnimationFrame(open);
  };
  open();
})();
"""


def open_tab(gui: viser.GuiApi, label: str) -> None:
    """Open a tab of the client's panel.

    Parameters
    ----------
    gui
        The client's own GUI.
    label
        The tab's.
    """
    gui._websock_interface.queue_message(  # pyright: ignore[reportPrivateUsage]
        _messages.RunJavascriptMessage(source=_SCRIPT.replace("LABEL", json.dumps(label)))
    )
