"""Number fields: what they show is what acts, whatever was typed into them."""

import viser
from viser import _messages  # pyright: ignore[reportPrivateUsage]

__all__ = ["keep_number_fields"]

# viser's fields clamp to their range when they are left, keep what is no number as an empty field,
# and take the caret's place from the last key. A new text that comes without a key, as from a
# clipboard, would be put where an Enter long ago has left the caret, and be refused.
_SCRIPT = """
if (!window.bluntdissectNumberFields) {
  window.bluntdissectNumberFields = true;
  let before = "";
  const listen = (kind, take) => document.addEventListener(kind, event => {
    const field = event.target;
    if (field instanceof HTMLInputElement && field.matches(".mantine-NumberInput-input"))
      take(field, event);
  }, true);
  listen("focusin", field => {
    before = field.value;
    const row = field.closest(".mantine-NumberInput-root").parentElement;
    if (row.querySelector(".mantine-Slider-root [data-disabled]")) field.blur();
  });
  listen("keydown", (field, event) => {
    if (event.key !== "Enter") return;
    event.stopPropagation();
    field.blur();
  });
  listen("focusout", field => {
    if (/\\d/.test(field.value)) return;
    const shown = before;
    setTimeout(() => {
      const next = document.activeElement;
      const value = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value");
      value.set.call(field, shown);
      field.dispatchEvent(new Event("input", {bubbles: true}));
      field.blur();  // it takes the focus with its new value
      if (next !== field) next.focus();
    });
  });
}
"""


def keep_number_fields(gui: viser.GuiApi) -> None:
    """Let Enter end the typing in a number field, and nothing but a number stay in it.

    Parameters
    ----------
    gui
        The client's own GUI.
    """
    gui._websock_interface.queue_message(  # pyright: ignore[reportPrivateUsage]
        _messages.RunJavascriptMessage(source=_SCRIPT)
    )
