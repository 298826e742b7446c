"""The legend of the colours: over the picture where there is room, else in the panel."""

import viser

from app.trainer.panel.controls import set_if_changed

# Below this width by height of the picture a floating legend would cover the duct.
NARROW = 0.8
WIDTH, HEIGHT, GAP = 290, 154, 16
"""px."""


class Legend:
    """One client's legend, hidden at first; in `gui` where it does not float."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._gui = gui
        self._inside = gui.add_html("", visible=False)
        self._floating: tuple[viser.PanelHandle, viser.GuiHtmlHandle] | None = None

    def show(self, content: str, aspect: float) -> None:
        """Show this HTML, or hide the legend for none, in a picture of this width by height."""
        inside, beside = bool(content) and aspect < NARROW, bool(content) and aspect >= NARROW
        if inside:
            set_if_changed(self._inside, content=content)
        set_if_changed(self._inside, visible=inside)
        if beside and self._floating is None:
            panel = self._gui.add_panel(visible=False)
            with panel.add_tab("Colour scale"):
                self._floating = panel, self._gui.add_html("")
            panel.float(x=GAP, y=-GAP, width=WIDTH, height=HEIGHT)
        if self._floating is not None:
            panel, html = self._floating
            if beside:
                set_if_changed(html, content=content)
            set_if_changed(panel, visible=beside)
