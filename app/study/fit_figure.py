# matplotlib's types are partial.
# pyright: reportUnknownMemberType=false, reportArgumentType=false
"""Measured curves with what was fitted to them, and the residuals."""

from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.study.curves import Curve
from app.study.report import COLOURS
from organ_geometry import write_atomic


def draw_fit(
    curves: list[Curve], residuals: list[NDArray[np.float64]], title: str, path: Path
) -> None:
    """Draw measured points, the fitted curve and the residuals below as PNG, SVG or PDF."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 6.0), dpi=130, layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
    for k, (curve, residual) in enumerate(zip(curves, residuals, strict=True)):
        colour = COLOURS[k % len(COLOURS)]
        order = np.argsort(curve.deflections)
        places = curve.deflections[order]
        above.plot(curve.deflections, curve.forces, ".", color=colour, label=curve.name)
        above.plot(places, (curve.forces - residual)[order], "-", color=colour, linewidth=1.0)
        below.plot(places, residual[order], ".-", color=colour, linewidth=0.5)
        if curve.broke:
            above.plot(curve.deflections[-1], curve.forces[-1], "x", color=colour, markersize=10)
    above.set_title(f"{title} (points measured, line fitted, x break)", fontsize=10)
    above.set_ylabel("force, N")
    above.legend(frameon=False)
    below.axhline(0.0, color="black", linewidth=0.5)
    below.set_ylabel("residual, N")
    below.set_xlabel("deflection, mm")
    for axes in (above, below):
        axes.grid(alpha=0.3)
    drawn = BytesIO()
    figure.savefig(drawn, format=path.suffix[1:].lower())
    write_atomic(path, drawn.getvalue())
