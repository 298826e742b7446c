"""The read-out above the sliders: distance to break in large, the other figures below."""

import html
import math

from app.simulation import Phase, Reading, Session, Spread
from app.trainer.panel.controls import KPA_PER_MPA, figure, term

HANDS = ("Left hand", "Right hand")
CAREFUL_BELOW = 0.40
# Distances to break below which the word and the colour change.
STOP_BELOW = 0.15

SAFE, CAREFUL, STOP, TEARING, TORN = "Safe", "Careful", "Stop", "Tearing", "Torn"
BAND = (
    "Ducts of this shape, bent and stretched like this one, whose modulus and strength are within "
    "the factors chosen"
)
DISTANCE = (
    "1 minus highest nominal stress divided by threshold: 100 % is a slack duct, at 0 % it tears"
)
FORCE = "The whole force of the grasper across the duct, newtons"
DEFLECTION = "How far the duct is pulled out where the hook holds it"
BREAKS = "Force at which this duct tears when it is held here"
NORMAL = "Tension along the duct, the same over its whole section"
BENDING = "Tension at the outermost fibre from the bend"
LOOSENED = (
    "Length of duct that the broken strands held; it is free only where nearly all have broken"
)
PARTED = "Strands that have broken, of all that held the duct; they never heal"
PEAK = "The highest nominal stress so far, as a part of the threshold; the bar is marked there too"
NICKED = "How much of the section's height is torn: at three quarters it tears through"
HAND_FORCE = "What this hand feels: its pull on the duct, or its push on strands, newtons"
ENERGY = (
    "Energy into strands that broke, as a part of the work of both hands; the rest has stretched "
    "duct and tissue"
)
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
    torn = zone_while_hidden(reading.phase)
    left = reading.distance_to_break
    return torn or (STOP if left < STOP_BELOW else CAREFUL if left < CAREFUL_BELOW else SAFE)


def zone_while_hidden(phase: Phase) -> str:
    """Return the word for a tear while figures are hidden; empty while the duct is whole."""
    return {Phase.TEARING: TEARING, Phase.TORN: TORN}.get(phase, "")


def readout_html(reading: Reading, state: str = "", spread: Spread | None = None) -> str:
    """Return the read-out as HTML; `state` is said before the word for the distance."""
    torn, in_plane = reading.phase is Phase.TORN, len(reading.forces) == 1
    left = reading.distance_to_break
    if reading.phase is not Phase.INTACT:
        left = min(reading.check.distance_to_break, 0.0)
    peak = min(reading.peak_stress_ratio, 1.0)
    mark = (
        f"<div style='position:absolute;left:calc({100.0 * peak:.1f}% - 1px);top:0;width:2px;"
        "height:10px;background:rgba(255,255,255,.65)'></div>"
    )
    head = _distance_html(
        None if torn else left, zone(reading), state, spread, "" if in_plane else mark
    )
    figures = "".join(f" data-{name}='{value}'" for name, value in _figures(reading).items())
    broken = reading.phase is not Phase.INTACT
    place = "The duct is at rest"
    if broken or reading.stress_ratio > 0.005:
        what = "Tore" if broken else "Highest stress"
        place = f"{what} {reading.check.station:.1f} mm from the left clamp"
    if reading.nicks and not broken:
        place = max(reading.nicks, key=lambda each: each.depth).words("Wall")
    return (
        f"<div data-testid='readout' data-phase='{reading.phase.value}'{figures}{head}"
        f"<div data-testid='worst' style='font-size:12px;opacity:.85'>{place}.</div>"
        "<div style='display:grid;grid-template-columns:repeat(3,1fr);gap:6px 8px;margin:8px 0'>"
        f"{''.join(_cells(reading))}</div></div>"
    )


def _figures(reading: Reading) -> dict[str, str]:
    """Return the unrounded figures of a reading, for the attributes of its read-out."""
    check, event = reading.check, reading.breaks_at
    normal, bending = _stresses(reading)
    torn = reading.phase is Phase.TORN
    distance = (
        reading.distance_to_break if reading.phase is Phase.INTACT else check.distance_to_break
    )
    numbers = {
        "force-n": reading.force,
        "deflection-mm": reading.deflection,
        "normal-stress-kpa": normal,
        "bending-stress-kpa": bending,
        "threshold-kpa": check.threshold * KPA_PER_MPA,
        "distance-to-break": 0.0 if torn else distance,
        "worst-mm": check.station,
    }
    if len(reading.forces) > 1:
        sides = zip(("left", "right"), reading.forces, strict=True)
        numbers |= {
            "peak": reading.peak_stress_ratio,
            **{f"force-{side}-n": math.hypot(*force) for side, force in sides},
            "work-mj": reading.energy.work,
            "into-strands-mj": reading.energy.dissipated,
            "freed-mm": reading.freed,
            "parted": reading.broken,
        }
    found = {name: f"{value:.6g}" for name, value in numbers.items()}
    return found | {"breaks-at-n": "never" if event is None else f"{event.force:.6g}"}


def _stresses(reading: Reading) -> tuple[float, float]:
    """Return the normal and the bending stress, kPa, which pieces do not have."""
    kpa = 0.0 if reading.phase is Phase.TORN else KPA_PER_MPA
    return kpa * reading.check.normal_stress, kpa * reading.check.bending_stress


def _cells(reading: Reading) -> list[str]:
    """Return the figures below the distance, as HTML: six of what there is to read."""
    normal, bending = _stresses(reading)
    event, torn = reading.breaks_at, reading.phase is Phase.TORN
    stresses = [
        _cell(term("Normal stress", NORMAL), figure(normal), "kPa"),
        _cell(term("Bending stress", BENDING), figure(bending), "kPa"),
        _cell(term("Threshold T", THRESHOLD), figure(reading.check.threshold * KPA_PER_MPA), "kPa"),
    ]
    if len(reading.forces) == 1:
        broke = term("Broke at" if torn else "Breaks at", BREAKS)
        return [
            _cell(term("Force F", FORCE), figure(reading.force), "N"),
            _cell(term("Deflection", DEFLECTION), figure(reading.deflection), "mm"),
            _cell(broke, figure(event.force if event else None), "N"),
            *stresses,
        ]
    peak = 100.0 * min(reading.peak_stress_ratio, 1.0)
    hands = [
        _cell(term("Peak", PEAK), f"{peak:.0f}", "% of break"),
        *(
            _cell(term(hand, HAND_FORCE), figure(math.hypot(*force)), "N")
            for hand, force in zip(HANDS, reading.forces, strict=True)
        ),
    ]
    if reading.nicks:
        deepest = max(each.depth for each in reading.nicks)
        hands[0] = _cell(term("Torn", NICKED), f"{100.0 * deepest:.0f}", "% of the wall")
    if not reading.strands:
        return hands + stresses
    energy = reading.energy
    # The first touch is all stretch: nothing is said of less than a hundredth of a millijoule.
    percent = (
        100.0 * min(max(energy.dissipated / energy.work, 0.0), 1.0) if energy.work > 0.01 else None
    )
    return [
        _cell(term("Loosened", LOOSENED), figure(reading.freed), "mm"),
        _cell(term("Strands broken", PARTED), f"{reading.broken}", f"of {reading.strands}"),
        *hands,
        _cell(
            term("Economy of work", ENERGY),
            "–" if percent is None else f"{percent:.0f}",
            f"% of {energy.work:.1f} mJ",
        ),
    ]


def _distance_html(
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


def duct_html(session: Session, *, figures: bool) -> str:
    """Return which organ lies where, which section of a free one is solved, and its strength."""
    specimen, tissue = session.specimen, session.tissue
    dissection, organ, bed = tissue.dissection, tissue.dissection.organ, specimen.bed
    own = dissection.own_sections
    name = html.escape(organ.name or "Your organ")
    lines = list[str]()
    if bed is not None:
        title = html.escape(bed.title)
        lines.append(f"<div><b>{name}</b> in <b>{title}</b>, bed {specimen.bed_seed}.</div>")
    else:
        shape = (
            f"{'hollow' if organ.hollow else 'full'}, {organ.length:.4g} mm long, "
            f"{2.0 * organ.mean_radius:.3g} mm thick"
        )
        colour = "inherit" if own else COLOURS[CAREFUL]
        section = html.escape(specimen.section)
        lines.append(f"<div><b>{name}</b>: {shape}.</div>")
        lines.append(f"<div style='color:{colour}'>Solved as {section}.</div>")
    if figures:
        given = [] if bed else [f"Strength as given: {html.escape(dissection.preset.strength)}"]
        if tissue.threshold != tissue.own_threshold:
            given.append(f"T moved by you from {KPA_PER_MPA * tissue.own_threshold:.6g} kPa")
        lines.append(f"<div data-testid='strength'>{'; '.join(given)}.</div>" if given else "")
    return (
        f"<div data-testid='duct' data-own-sections='{int(own)}' style='padding:0 14px 6px;"
        f"font-size:11px;line-height:1.35'>{''.join(lines)}</div>"
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


def _cell(name: str, value: str, unit: str) -> str:
    """Return one figure of a read-out, as HTML."""
    return (
        f"<div><div style='font-size:11px;opacity:.75;white-space:nowrap'>{name}</div>"
        f"<div style='font-size:16px;font-weight:600;white-space:nowrap'>{value}"
        f"<span style='font-size:11px;font-weight:400;opacity:.75'> {unit}</span></div></div>"
    )
