"""A page that plays a recorded run, with no server behind it."""

import numpy as np

from app.export.recorded_run import RecordedRun
from app.simulation.reading import Phase, Reading
from app.trainer.pages.html_player import DRAWN_NOT_COMPUTED, Scenes, caption, player_page

__all__ = ["PAGE_FRAMES", "run_page"]

PAGE_FRAMES = 300
"""Keys of a run in a page where nobody asks for others: each writes every vertex."""


def run_page(run: RecordedRun, *, edge_length: float) -> str:
    """Return a page that plays a recorded run."""
    dissection, readings = run.dissection, run.readings
    ended = "."
    if run.torn:
        tore = max(reading.force for reading in readings if reading.phase is Phase.TEARING)
        ended = f"; it tore at {tore:.3g} N."
    whole = float(run.motion.times[run.motion.whole][-1])
    scenes = Scenes(
        run.motion,
        [_caption(reading) for reading in readings],
        np.array([reading.hook for reading in readings]),
        np.array([1.0 - reading.check.distance_to_break for reading in readings]),
        dissection.preset.label,
        [
            f"A recorded run of {whole:.1f} s on {dissection.beam.span:.1f} mm between the "
            f"clamps{ended}",
            "Forces in N, lengths in mm." + (f" {DRAWN_NOT_COMPUTED}" if run.torn else ""),
        ],
    )
    return player_page(
        dissection, scenes, edge_length=edge_length, pieces=run.pieces(edge_length=edge_length)
    )


def _caption(reading: Reading) -> str:
    if reading.phase is Phase.TEARING:
        return f"F {reading.force:.3g} N   it tears"
    if reading.phase is Phase.TORN:
        return "F 0 N   torn in two"
    left = max(0.0, reading.check.distance_to_break)
    return caption(reading.force, reading.deflection, left)
