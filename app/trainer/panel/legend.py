"""The legend of the colours: over the picture where there is room, else in the panel."""

import viser

from app.trainer.panel.controls import set_if_changed

__all__ = ["Legend"]

# Below this width by height of the picture a floating legend would cover the duct.
NARROW = 0.8
WIDTH, HEIGHT, GAP = 290, 154, 16
"""px."""


class Legend:
    """One client's legend, hidden at first; in `gui` where it does not float."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._gui = gui
        self._inside = gui.add_html("", visible=False)
        self._panel: viser.PanelHandle | None = None
        self._beside: viser.GuiHtmlHandle | None = None
        self._content = ""

    def show(self, content: str, aspect: float) -> None:
        """Show this HTML, or hide the legend for none, in a picture of this width by height."""
        wanted, narrow = bool(content), aspect < NARROW
        if wanted:
            if not narrow and self._panel is None:
                self._panel = self._gui.add_panel(visible=False)
                with self._panel.add_tab("Colour scale"):
                    self._beside = self._gui.add_html("")
                self._panel.float(x=GAP, y=-GAP, width=WIDTH, height=HEIGHT)
            if content != self._content or (self._beside and not self._beside.content):
                self._content = content
                for place, there in ((self._inside, narrow), (self._beside, not narrow)):
                    if place is not None:
                        place.content = content if there else ""
        inside, beside = wanted and narrow, wanted and not narrow
        if inside and not self._inside.content:
            self._inside.content = self._content
        set_if_changed(self._inside, visible=inside)
        if self._panel is not None:
            set_if_changed(self._panel, visible=beside)
