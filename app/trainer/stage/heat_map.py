"""The key of the heat map: stress as colours, from zero to the threshold."""

import html

import numpy as np

from app.trainer.stage.tone import color_table
from organ_geometry.mesh import COLOR_MAP

__all__ = ["heat_legend_html"]

KPA_PER_MPA = 1000.0
_STOPS = 24


def heat_legend_html(threshold: float) -> str:
    """Return the heat map's key: its colours, ticks in kPa and where the duct breaks."""
    if not (np.isfinite(threshold) and threshold > 0.0):
        raise ValueError(f"threshold must be above 0 MPa, got {threshold}")
    places = np.linspace(0, len(color_table()) - 1, _STOPS).round().astype(int)
    stops = ",".join(
        f"rgb({red},{green},{blue}) {100.0 * place / places[-1]:.2f}%"
        for place, (red, green, blue) in zip(places, color_table()[places].tolist(), strict=True)
    )
    end = KPA_PER_MPA * threshold
    ticks = "".join(
        f"<span style='position:absolute;left:{100.0 * part:g}%;"
        f"transform:translateX({-100.0 * part:g}%)'>{_figure(part * end, end)}</span>"
        for part in (0.0, 0.25, 0.5, 0.75, 1.0)
    )
    return (
        f"<div data-testid='heat-legend' data-threshold-kpa='{end:.6g}' "
        "style='padding:8px 14px;font-size:12px;line-height:1.35'>"
        "<div style='display:flex;justify-content:space-between'>"
        "<b>Tensile stress at the wall</b><span style='opacity:.75'>kPa</span></div>"
        f"<div style='height:14px;margin-top:6px;border-radius:2px;border-right:3px solid #ff6b5e;"
        f"background:linear-gradient(90deg,{stops})'></div>"
        f"<div style='position:relative;height:16px;margin-top:3px'>{ticks}</div>"
        "<div style='display:flex;justify-content:space-between;margin-top:2px'>"
        "<span><span style='color:#ff6b5e'>&#9614;</span>"
        f"breaks at {_figure(end, end)} kPa</span>"
        f"<span style='opacity:.6'>{html.escape(COLOR_MAP)}</span></div></div>"
    )


def _figure(value: float, end: float) -> str:
    """Return a tick's figure with three digits of the scale's end."""
    digits = max(0, 2 - int(np.floor(np.log10(end))))
    return f"{value:.{digits}f}"
