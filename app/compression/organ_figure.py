# matplotlib's types are partial.
# pyright: reportUnknownMemberType=false, reportArgumentType=false
"""The thesis's figure 7.1 for any organ: all sections, key and driving points, kept sections."""

from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from organ_geometry import DrivingPoints, Organ, Wall, check_target, write_atomic

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FIGURE_SUFFIXES = (".png", ".svg", ".pdf")
# Key points drawn on each kept section.
KEY_POINTS = 12
# Distance of the driving points that are drawn, in mean radii.
DRIVING_RADII = 1.0
OUTLINE_CORNERS = 96
# Angle from which the sections are seen, rad.
LOOKING_DOWN = np.radians(22.0)
# With Okabe and Ito's colours, which colour-blind readers tell apart.
_WALL, _LUMEN, _OUTER, _KEY, _DRIVING = "#f3e3d3", "#cc79a7", "#4d4d4d", "#0072b2", "#d55e00"


def check_figure_target(path: Path) -> None:
    """Refuse a file that no figure can be written to, before any work is done."""
    if path.suffix.lower() not in FIGURE_SUFFIXES:
        raise ValueError(f"a figure must end in {', '.join(FIGURE_SUFFIXES)}, not {path}")
    check_target(path)
    if find_spec("matplotlib") is None:
        raise ValueError("figures need matplotlib: pip install 'bluntdissect[report]'")


def draw_organ_figure(
    organ: Organ, edges: list[NDArray[np.float64]], path: Path, *, title: str
) -> None:
    """Draw all sections, the key and driving points, and the kept sections, side by side."""
    check_figure_target(path)
    from matplotlib.figure import Figure

    turn = _turned(organ)
    driving = DrivingPoints.of(organ, spacing=DRIVING_RADII * organ.mean_radius)
    walls: tuple[Wall, ...] = ("outer", "lumen") if organ.hollow else ("outer",)
    rings = {wall: [ring @ turn for ring in _rings(organ, wall)] for wall in walls}
    edges = [edge @ turn for edge in edges]

    figure = Figure(figsize=(10.5, 8.0), dpi=130, layout="constrained")
    figure.suptitle(title)
    every, points, kept = figure.subplots(1, 3, sharex=True, sharey=True)
    for place in _far_order(edges):
        every.fill(*edges[place][:, :2].T, facecolor=_WALL, edgecolor=_OUTER, linewidth=0.5)
    every.set_title(f"All {len(edges)} sections", fontsize="medium")

    keys = organ.key_points(KEY_POINTS) @ turn
    points.plot(*(organ.axis @ turn)[:, :2].T, color=_DRIVING, linewidth=0.8)
    points.plot(*keys[:, :2].T, ".", markersize=3.5, color=_KEY, label="key points")
    centres = organ.axis_at(driving.stations) @ turn
    points.plot(*centres[:, :2].T, "o", markersize=4.5, color=_DRIVING, label="driving points")
    points.set_title(f"{len(keys)} key points and {len(centres)} driving points", fontsize="medium")
    points.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=2, frameon=False)

    for place in _far_order(rings["outer"]):
        for wall in walls:
            inside = wall == "lumen"
            kept.fill(
                *rings[wall][place][:, :2].T,
                facecolor="white" if inside else _WALL,
                edgecolor=_LUMEN if inside else _KEY,
                linewidth=0.9,
            )
    kept.set_title(f"{len(organ.keys)} sections kept", fontsize="medium")

    for axes in (every, points, kept):
        axes.set_aspect("equal")
        axes.set_axis_off()
    _add_scale_bar(every, np.vstack(edges))
    content = BytesIO()
    kind = path.suffix.lower()[1:]
    figure.savefig(content, format=kind, metadata={"Date": None} if kind == "svg" else None)
    write_atomic(path, content.getvalue())


def _rings(organ: Organ, wall: Wall) -> list[NDArray[np.float64]]:
    """Return a closed ring (C, 3) for each kept section."""
    angles = np.linspace(0.0, 2.0 * np.pi, OUTLINE_CORNERS)
    return [
        organ.surface(np.full(OUTLINE_CORNERS, station), angles, wall)
        for station in organ.key_stations
    ]


def _turned(organ: Organ) -> NDArray[np.float64]:
    """Return the (3, 3) turn, on the right of points, to the picture: right, up, to the viewer."""
    # The long side stands up, the first section on top; the widest side lies across.
    _, _, sides = np.linalg.svd(organ.axis - organ.axis.mean(axis=0), full_matrices=False)
    first_to_last = organ.axis[-1] - organ.axis[0]
    long: NDArray[np.float64] = sides[0] if sides[0] @ first_to_last < 0.0 else -sides[0]
    wide: NDArray[np.float64] = sides[1]
    up: NDArray[np.float64] = np.cos(LOOKING_DOWN) * long - np.sin(LOOKING_DOWN) * np.cross(
        wide, long
    )
    return np.array([wide, up, np.cross(wide, up)]).T


def _far_order(rings: list[NDArray[np.float64]]) -> list[int]:
    """Return the rings' places, from the farthest to the nearest."""
    return sorted(range(len(rings)), key=lambda place: float(rings[place][:, 2].mean()))


def _add_scale_bar(axes: "Axes", points: NDArray[np.float64]) -> None:
    """Draw a bar of 1, 2 or 5 times a power of ten millimetres, about a quarter of the height."""
    (left, bottom), height = points[:, :2].min(axis=0), float(np.ptp(points[:, 1]))
    unit = 10.0 ** np.floor(np.log10(0.25 * height))
    length = unit * max(factor for factor in (1.0, 2.0, 5.0) if factor * unit <= 0.25 * height)
    at = left - 0.03 * height
    axes.plot([at, at], [bottom, bottom + length], color="black", linewidth=2.0)
    axes.text(at, bottom + 0.5 * length, f"{length:g} mm  ", ha="right", va="center")
