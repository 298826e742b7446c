"""Keys of the heat maps: stress from zero to the threshold, and what is freed of a duct."""

import html
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from app.trainer.stage.tone import color_table
from organ_geometry.mesh import COLOR_MAP

KPA_PER_MPA = 1000.0
_STOPS = 24
_BREAK = "#ff6b5e"


@lru_cache(maxsize=64)
def heat_legend_html(threshold: float) -> str:
    """Return the heat map's key: its colours, ticks in kPa and where the duct breaks."""
    if not (np.isfinite(threshold) and threshold > 0.0):
        raise ValueError(f"threshold must be above 0 MPa, got {threshold}")
    end = KPA_PER_MPA * threshold
    return _legend_html(
        "Tensile stress at the wall",
        "kPa",
        [_figure(fraction * end, end) for fraction in (0.0, 0.25, 0.5, 0.75, 1.0)],
        f"<span style='color:{_BREAK}'>&#9614;</span>breaks at {_figure(end, end)} kPa",
        data=f"data-testid='heat-legend' data-threshold-kpa='{end:.6g}'",
        end=f"border-right:3px solid {_BREAK};",
    )


@lru_cache(maxsize=1)
def freed_legend_html() -> str:
    """Return the key of the map of what is freed: the share of strands that have parted."""
    return _legend_html(
        "Freed: strands broken",
        "%",
        ["0", "25", "50", "75", "100"],
        "0 % is held, 100 % is free",
        data="data-testid='freed-legend'",
    )


def _legend_html(
    title: str, unit: str, ticks: Sequence[str], note: str, *, data: str, end: str = ""
) -> str:
    places = np.linspace(0, len(color_table()) - 1, _STOPS).round().astype(int)
    stops = ",".join(
        f"rgb({red},{green},{blue}) {100.0 * place / places[-1]:.2f}%"
        for place, (red, green, blue) in zip(places, color_table()[places].tolist(), strict=True)
    )
    marks = "".join(
        f"<span style='position:absolute;left:{fraction:g}%;transform:translateX({-fraction:g}%)'>"
        f"{tick}</span>"
        for fraction, tick in zip(np.linspace(0.0, 100.0, len(ticks)).tolist(), ticks, strict=True)
    )
    return (
        f"<div {data} style='padding:8px 14px;font-size:12px;line-height:1.35'>"
        "<div style='display:flex;justify-content:space-between'>"
        f"<b>{title}</b><span style='opacity:.75'>{unit}</span></div>"
        f"<div style='height:14px;margin-top:6px;border-radius:2px;{end}"
        f"background:linear-gradient(90deg,{stops})'></div>"
        f"<div style='position:relative;height:16px;margin-top:3px'>{marks}</div>"
        "<div style='display:flex;justify-content:space-between;margin-top:2px'>"
        f"<span>{note}</span>"
        f"<span style='opacity:.6'>{html.escape(COLOR_MAP)}</span></div></div>"
    )


def _figure(value: float, end: float) -> str:
    """Return a tick's figure with three digits of the scale's end."""
    digits = max(0, 2 - int(np.floor(np.log10(end))))
    return f"{value:.{digits}f}"
