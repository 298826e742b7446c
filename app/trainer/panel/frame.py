"""How the panel looks, and what stands in it always."""

import viser
from viser import theme

DISCLAIMER = "Not clinically validated, not a medical device."
LEARN, REPLAY, BUILD = "Learn", "Replay", "Build"
START_TRY = "Start the next try"
"""Of a course, on the class's card and on a result."""
WIDTH = 364
"""px."""
BRAND = (38, 166, 154)


def style_panel(gui: viser.GuiApi) -> None:
    """Set the panel's theme and place."""
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


def add_disclaimer(gui: viser.GuiApi) -> None:
    """Say what this is not."""
    gui.add_html(
        "<div data-testid='disclaimer' style='padding:0 14px 6px;"
        f"font-size:11px;opacity:.75'>{DISCLAIMER}</div>"
    )


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
