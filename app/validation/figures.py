# matplotlib's types are partial.
# pyright: reportUnknownMemberType=false, reportArgumentType=false
"""The thesis's figures 6.1, 6.7 and 6.8, drawn again with our theories beside ANSYS."""

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from app.validation.comparison import COMPARED, Comparison
from app.validation.thesis_tables import INCH, LBF, TABLE_6_3, Table
from organ_geometry import write_atomic
from physics import NoEquilibrium

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIGURES = {
    "figure-6-1": "Load and deflection, rubber (table 6.1)",
    "figure-6-7": "Load and deflection, bile duct (table 6.3)",
    "figure-6-8": "Normal force and deflection, bile duct",
}
"""Names of the files and what they show."""

DRAWN = {
    "cubic": {"color": "#0072b2"},
    "cubic, fitted q": {"color": "#56b4e9", "linestyle": "--"},
    "exact": {"color": "#d55e00"},
    "exact, shear": {"color": "#e69f00", "linestyle": "--"},
    "exact, shear, neo-hooke": {"color": "#009e73", "linestyle": "-."},
}
"""Theories that are drawn, in Okabe and Ito's colours, which colour-blind readers tell apart."""


def draw_figures(comparisons: dict[str, Comparison], folder: Path) -> None:
    """Draw the figures as PNG and SVG."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ValueError("figures need matplotlib: pip install 'bluntdissect[report]'") from error
    folder.mkdir(exist_ok=True)
    for name, title in FIGURES.items():
        figure = Figure(figsize=(7.0, 4.6), dpi=120, layout="constrained")
        axes = figure.add_subplot()
        if name == "figure-6-8":
            _normal_forces(axes, TABLE_6_3)
        else:
            _deflections(axes, comparisons["6.1" if name == "figure-6-1" else "6.3"])
        axes.set_title(title)
        axes.grid(alpha=0.3)
        axes.legend(frameon=False)
        save_figure(figure, folder / name)


def _deflections(axes: "Axes", comparison: Comparison) -> None:
    table = comparison.table
    loads = [0.0, *(row[0] for row in table.rows)]
    for column in comparison.columns:
        if column.name in DRAWN:
            axes.plot(loads, [0.0, *column.deflections], label=column.name, **DRAWN[column.name])
    ansys = [0.0, *(row[2] for row in table.rows)]
    axes.plot(loads, ansys, "k.", label="ANSYS (thesis)")
    axes.set_xlabel("P on one half, lbf")
    axes.set_ylabel("deflection, inch")


def _normal_forces(axes: "Axes", table: Table) -> None:
    """Draw the tension at the clamp over the deflection."""
    beam = table.beam
    deflections = np.linspace(0.0, table.rows[-1][2], 60) * INCH
    for name in (*DRAWN, "fem"):
        theory = COMPARED[name]
        tensions: list[float] = []
        for deflection in deflections:
            try:
                pulled = (
                    theory.pull(beam, 0.5 * beam.span)
                    .to_deflection(float(deflection))
                    .sample(np.zeros(1))
                )
                tensions.append(float(pulled.normal_force[0]) / LBF)
            except NoEquilibrium:
                tensions.append(float("nan"))
        style = DRAWN.get(name, {"color": "black", "linestyle": ":"})
        axes.plot(deflections / INCH, tensions, label=name, **style)
    axes.set_xlabel("deflection, inch")
    axes.set_ylabel("normal force at the clamp, lbf")


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure as PNG and SVG."""
    import matplotlib as mpl

    png, svg = BytesIO(), BytesIO()
    # Without a date and with a fixed salt the same figure is the same file.
    with mpl.rc_context({"svg.hashsalt": path.name, "svg.fonttype": "none"}):
        figure.savefig(png, format="png")
        figure.savefig(svg, format="svg", metadata={"Date": None})
    write_atomic(path.with_suffix(".png"), png.getvalue())
    write_atomic(path.with_suffix(".svg"), svg.getvalue())
