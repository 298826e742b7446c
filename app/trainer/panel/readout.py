"""The read-out above the sliders: distance to break in large, the other figures below."""

import html

from app.simulation import Phase, Reading, Session, Spread
from app.trainer.panel.controls import KPA_PER_MPA, figure, term

__all__ = [
    "TORN",
    "cell",
    "cells_html",
    "distance_html",
    "distance_zone",
    "duct_html",
    "hidden_html",
    "readout_html",
    "zone",
    "zone_told",
]

CAREFUL_BELOW = 0.40
# Distances to break below which the word and the colour change.
STOP_BELOW = 0.15

SAFE, CAREFUL, STOP, TEARING, TORN = "Safe", "Careful", "Stop", "Tearing", "Torn"
BAND = (
    "Ducts of this shape, bent and stretched like this one, whose modulus and strength are within "
    "the factors chosen"
)
DISTANCE = "1 less the highest nominal stress by the threshold: 100 % is a slack duct, 0 % tears"
FORCE = "The whole force of the grasper across the duct, newtons"
DEFLECTION = "How far the duct is pulled out where the hook holds it"
BREAKS = "Force at which this duct tears when it is held here"
NORMAL = "Tension along the duct, the same over its whole section"
BENDING = "Tension at the outermost fibre from the bend"
THRESHOLD = "The duct tears where normal and bending stress together exceed this"
COLOURS = {
    SAFE: "#35c28f",
    CAREFUL: "#f2b134",
    STOP: "#ff6b5e",
    TEARING: "#ff6b5e",
    TORN: "#ff6b5e",
}


def zone(reading: Reading) -> str:
    """Return the word for the distance to break."""
    if reading.phase is Phase.TORN:
        return TORN
    if reading.phase is Phase.TEARING:
        return TEARING
    return distance_zone(reading.check.distance_to_break)


def distance_zone(distance: float) -> str:
    """Return the word for the distance to break of a whole duct."""
    return STOP if distance < STOP_BELOW else CAREFUL if distance < CAREFUL_BELOW else SAFE


def zone_told(phase: Phase) -> str:
    """Return the word for a tear while figures are hidden; empty while the duct is whole."""
    return {Phase.TEARING: TEARING, Phase.TORN: TORN}.get(phase, "")


def readout_html(reading: Reading, state: str = "", spread: Spread | None = None) -> str:
    """Return the read-out as HTML."""
    check, phase = reading.check, reading.phase
    torn = phase is Phase.TORN
    stressed = 0.0 if torn else 1.0
    normal = stressed * check.normal_stress * KPA_PER_MPA
    bending = stressed * check.bending_stress * KPA_PER_MPA
    event = reading.breaks_at
    breaks_at = "never" if event is None else f"{event.force:.6g}"
    rows = "".join(
        (
            cell(term("Force F", FORCE), figure(reading.force), "N"),
            cell(term("Deflection", DEFLECTION), figure(reading.deflection), "mm"),
            cell(
                term("Broke at" if torn else "Breaks at", BREAKS),
                figure(event.force if event else None),
                "N",
            ),
            cell(term("Normal stress", NORMAL), figure(normal), "kPa"),
            cell(term("Bending stress", BENDING), figure(bending), "kPa"),
            cell(
                term("Threshold T", THRESHOLD),
                figure(check.threshold * KPA_PER_MPA),
                "kPa",
            ),
        )
    )
    return (
        f"<div data-testid='readout' data-phase='{phase.value}' data-force-n='{reading.force:.6g}'"
        f" data-deflection-mm='{reading.deflection:.6g}' data-normal-stress-kpa='{normal:.6g}'"
        f" data-bending-stress-kpa='{bending:.6g}'"
        f" data-threshold-kpa='{check.threshold * KPA_PER_MPA:.6g}'"
        f" data-distance-to-break='{0.0 if torn else check.distance_to_break:.6g}'"
        f" data-breaks-at-n='{breaks_at}'"
        f"{distance_html(None if torn else check.distance_to_break, zone(reading), state, spread)}"
        f"{cells_html(rows)}</div>"
    )


def distance_html(
    distance: float | None,
    word: str,
    state: str = "",
    spread: Spread | None = None,
    mark: str = "",
) -> str:
    """Return a read-out's head, from within its first `<div`; a torn duct has no distance."""
    colour = COLOURS[word]
    word = f"{state}: {word.lower()}" if state else word
    left = 0.0 if distance is None else max(0.0, distance)
    figure = f"{100.0 * left:.0f}"
    big = (
        "torn"
        if distance is None
        else f"{figure}<span style='font-size:18px;font-weight:500'> %</span>"
    )
    label = "none, the duct is torn" if distance is None else f"{figure} %"
    band = "" if distance is None or spread is None else _band(spread, left)
    return (
        f" role='group' aria-label='Distance to break {label}'"
        " style='padding:8px 14px 2px;font-variant-numeric:tabular-nums'>"
        "<div style='display:flex;align-items:flex-end;justify-content:space-between'><div>"
        "<div style='font-size:11px;opacity:.75'>"
        f"{term('Distance to break', DISTANCE)}</div>"
        "<div style='font-size:38px;line-height:1.05;font-weight:700;"
        f"color:{colour}'>{big}</div></div>"
        f"<div style='border:1px solid {colour};color:{colour};border-radius:99px;"
        f"padding:2px 12px;font-weight:600;font-size:13px;margin-bottom:6px'>{word}</div></div>"
        f"{band}{_bar(100.0 * min(1.0, 1.0 - left), mark)}"
    )


def _band(spread: Spread, distance: float) -> str:
    """Return where the distance would be for nine of ten ducts, and how many were torn, as HTML."""
    low, high = spread.band(distance)
    torn = 100.0 * spread.torn(distance)
    rest = f"; {torn:.0f} % would be torn" if torn >= 0.5 else ""
    return (
        f"<div data-testid='band' data-low='{low:.6g}' data-high='{high:.6g}'"
        " style='font-size:12px;opacity:.85'>"
        f"{term(f'{100.0 * low:.0f} to {100.0 * high:.0f} %, 90 % of ducts', BAND)}{rest}</div>"
    )


def cells_html(cells: str) -> str:
    """Return the figures of a read-out in three columns, as HTML."""
    return (
        "<div style='display:grid;grid-template-columns:repeat(3,1fr);gap:6px 8px;margin:8px 0'>"
        f"{cells}</div>"
    )


def duct_html(session: Session, *, figures: bool) -> str:
    """Return which organ and section are solved, and the strength, as HTML."""
    dissection, organ = session.tissue.dissection, session.tissue.dissection.organ
    own = dissection.own_sections
    name = html.escape(organ.name or "Your organ")
    shape = (
        f"{'hollow' if organ.hollow else 'full'}, {organ.length:.4g} mm long, "
        f"{2.0 * organ.mean_radius:.3g} mm thick"
    )
    colour = "inherit" if own else COLOURS[CAREFUL]
    strength = ""
    if figures:
        given = dissection.preset.strength
        own_threshold = session.planar.model.threshold
        if session.tissue.threshold != own_threshold:
            given = f"{given}; T moved by you from {KPA_PER_MPA * own_threshold:.6g} kPa"
        strength = f"<div data-testid='strength'>Strength as given: {html.escape(given)}.</div>"
    return (
        f"<div data-testid='duct' data-own-sections='{int(own)}' style='padding:0 14px 6px;"
        f"font-size:11px;line-height:1.35'><div><b>{name}</b>: {shape}.</div>"
        f"<div style='color:{colour}'>Solved as "
        f"{html.escape(dissection.section(session.planar.theory))}.</div>{strength}</div>"
    )


def hidden_html(phase: str) -> str:
    """Return the HTML in a read-out's place while its figures are hidden."""
    return (
        f"<div data-testid='readout' data-phase='{phase}' data-hidden='1'"
        " style='padding:8px 14px 2px'><div style='font-size:11px;opacity:.75'>"
        f"{term('Distance to break', DISTANCE)}</div>"
        "<div style='font-size:38px;line-height:1.05;font-weight:700;opacity:.35'>–</div>"
        "<div style='font-size:13px;opacity:.8;margin:10px 0 12px'>Figures are hidden in this "
        "exercise: feel your way. The result shows them all.</div></div>"
    )


def _bar(used: float, mark: str) -> str:
    """Return the three-zone bar with its pointer at the used part, %, and a further mark."""
    careful, stop = 100.0 * (1.0 - CAREFUL_BELOW), 100.0 * (1.0 - STOP_BELOW)
    return (
        "<div style='position:relative;height:10px;border-radius:5px;margin:8px 0 4px;"
        f"background:linear-gradient(90deg,#1f6f55 0 {careful:.0f}%,#8a6318 {careful:.0f}%"
        f" {stop:.0f}%,#8c2c26 {stop:.0f}%)'>{mark}<div style='position:absolute;"
        f"left:calc({used:.1f}% - 2px);top:-4px;width:4px;height:18px;border-radius:2px;"
        "background:#fff;box-shadow:0 0 0 1px #000'></div></div>"
        "<div style='display:flex;font-size:10px;opacity:.7;justify-content:space-between'>"
        "<span>slack</span><span>break</span></div>"
    )


def cell(name: str, value: str, unit: str) -> str:
    """Return one figure of a read-out, as HTML."""
    return (
        f"<div><div style='font-size:11px;opacity:.75;white-space:nowrap'>{name}</div>"
        f"<div style='font-size:16px;font-weight:600;white-space:nowrap'>{value}"
        f"<span style='font-size:11px;font-weight:400;opacity:.75'> {unit}</span></div></div>"
    )
