"""The page's own style: what viser's leaves too narrow on a phone, in the way, or unsaid."""

__all__ = ["page_style_html"]

_PANEL = ":has([data-testid=readout])"
_FIELD = ".mantine-NumberInput-root"
# Notifications go below the pages that are asked for, so that they do not cover these. A number
# field beside a disabled slider is disabled too. What scrolls leaves room for the scroll bar.
_STYLE = f"""
.mantine-Notifications-root{{z-index:150!important}}
:has(>.mantine-Slider-root [data-disabled]) {_FIELD}{{pointer-events:none;opacity:.5}}
.mantine-ScrollArea-content{_PANEL}{{padding-right:8px}}
@media (max-width:576px){{
.bd-wide{{display:none}}
.mantine-Paper-root{_PANEL},.mantine-Paper-root [style*='width: 20em']{_PANEL}
{{width:100%!important}}
.mantine-Paper-root{_PANEL} .mantine-Tabs-tab
{{padding-left:9px!important;padding-right:9px!important}}
.mantine-Paper-root [data-testid=heat-legend]{{position:fixed;top:48px;left:6px;width:170px;
padding:5px 8px!important;border-radius:6px;background:rgba(26,27,30,.8);font-size:11px!important}}
.mantine-Notifications-root{{top:4px!important;left:6px!important;width:calc(100% - 12px)!important;
max-width:none!important}}
}}
"""


def page_style_html() -> str:
    """Return the page's style.

    Returns
    -------
    str
        One `style` element. On a phone the panel is as wide as the screen, and the heat map's
        colour scale and what must be told stand over the picture's upper edge, away from the duct.
    """
    return f"<style>{_STYLE}</style>"
