"""The read-out of a duct in its bed: distance to break in large, what is freed, and the cost."""

import html
import math

from app.simulation import Reading, Session, Spread
from app.trainer.panel.controls import figure, term
from app.trainer.panel.readout import (
    TORN,
    cell,
    cells_html,
    distance_html,
    distance_zone,
)

__all__ = ["HANDS", "bed_html", "bed_phase", "bed_readout_html", "bed_zone"]

HANDS = ("Left hand", "Right hand")
FREED = "Length of duct about which all strands but a few have parted"
PARTED = "Strands that have parted, of all that held the duct; they never heal"
PEAK = "The highest nominal stress so far by the threshold; the mark on the bar is there too"
FORCE = "What this hand feels: its pull on the duct, or its push on strands, newtons"
ENERGY = (
    "Part of the work of both hands that went into strands that parted; the rest has stretched the "
    "duct and the tissue"
)


def bed_zone(reading: Reading) -> str:
    """Return the word for the distance to break."""
    return distance_zone(reading.distance_to_break) if reading.torn_at is None else TORN


def bed_phase(reading: Reading) -> str:
    """Return whether the duct is intact or torn."""
    return "intact" if reading.torn_at is None else "torn"


def bed_readout_html(reading: Reading, state: str = "", spread: Spread | None = None) -> str:
    """Return the read-out as HTML."""
    torn = reading.torn_at is not None
    forces = [math.hypot(*force) for force in reading.forces]
    books, peak = reading.energy, min(reading.peak_stress_ratio, 1.0)
    # The first touch is all stretch: no share is told of less than a hundredth of a millijoule.
    economy = books.dissipated / books.work if books.work > 0.01 else None
    cells = "".join(
        (
            cell(term("Freed", FREED), figure(reading.freed), "mm"),
            cell(term("Strands parted", PARTED), f"{reading.broken}", f"of {reading.strands}"),
            cell(term("Peak", PEAK), f"{100.0 * peak:.0f}", "% of break"),
            *(
                cell(term(hand, FORCE), figure(force), "N")
                for hand, force in zip(HANDS, forces, strict=True)
            ),
            cell(
                term("Into strands", ENERGY),
                "–" if economy is None else f"{100.0 * min(max(economy, 0.0), 1.0):.0f}",
                f"% of {books.work:.1f} mJ",
            ),
        )
    )
    mark = (
        f"<div style='position:absolute;left:calc({100.0 * peak:.1f}% - 1px);top:0;width:2px;"
        "height:10px;background:rgba(255,255,255,.65)'></div>"
    )
    distance = None if torn else reading.distance_to_break
    where = reading.torn_at if reading.torn_at is not None else reading.check.station
    stressed = torn or reading.stress_ratio > 0.005
    place = (
        f"{'Tore' if torn else 'Highest stress'} {where:.1f} mm from the left clamp"
        if stressed
        else "The duct is at rest"
    )
    return (
        f"<div data-testid='readout' data-phase='{bed_phase(reading)}'"
        f" data-distance-to-break='{0.0 if torn else reading.distance_to_break:.6g}'"
        f" data-freed-mm='{reading.freed:.6g}' data-parted='{reading.broken}'"
        f" data-peak='{reading.peak_stress_ratio:.6g}' data-worst-mm='{where:.6g}'"
        f" data-force-left-n='{forces[0]:.6g}' data-force-right-n='{forces[1]:.6g}'"
        f" data-into-strands-mj='{books.dissipated:.6g}' data-work-mj='{books.work:.6g}'"
        f"{distance_html(distance, bed_zone(reading), state, spread, mark)}"
        f"<div data-testid='worst' style='font-size:12px;opacity:.85'>{place}.</div>"
        f"{cells_html(cells)}</div>"
    )


def bed_html(session: Session) -> str:
    """Return which duct lies in which bed, as HTML."""
    specimen = session.specimen
    name = session.tissue.dissection.organ.name or "Your organ"
    where = "free, held by its clamps alone"
    if specimen.bed is not None:
        where = f"in <b>{html.escape(specimen.bed.title)}</b>, bed {specimen.bed_seed}"
    return (
        "<div data-testid='duct' style='padding:0 14px 6px;font-size:11px;line-height:1.35'>"
        f"<b>{html.escape(name)}</b> {where}.</div>"
    )
