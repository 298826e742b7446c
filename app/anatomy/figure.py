# matplotlib's types are partial.
# pyright: reportUnknownMemberType=false
"""A picture of an anatomy from the front and from the right."""

from io import BytesIO
from pathlib import Path

import numpy as np

from app.anatomy.anatomy_geometry import TubeLine
from app.anatomy.tables import Anatomy

_COLOURS = {"duct": "#3c7a3c", "organ": "#8a8a2e", "artery": "#c03030", "vein": "#3050a0"}
_MARGIN_MM = 2.0
_NARROW = 6.0  # inches
_VIEWS = ((0, 1, "x, mm", "y, mm"), (0, 2, "x, mm", "z, mm"))


def anatomy_figure(
    anatomy: Anatomy,
    lines: dict[str, TubeLine],
    kind: str,
    *,
    inches: tuple[float, float] = (8.0, 7.0),
    marked: str | None = None,
) -> bytes:
    """Return a picture as a file's bytes, of a kind that matplotlib writes (png, svg, pdf)."""
    # A tube that is `marked` has a thick axis, and 0 and 1 at its ends. In a narrow picture the
    # names stand below.
    try:
        from matplotlib.collections import PatchCollection
        from matplotlib.figure import Figure
        from matplotlib.patches import Circle
    except ImportError as error:
        raise ValueError(
            "a figure is drawn with matplotlib, which is missing: "
            "pip install 'bluntdissect[report]'"
        ) from error
    figure = Figure(figsize=inches, dpi=120, layout="constrained")
    # Both views have one scale.
    low = np.min([(line.places.T - line.radius).min(axis=1) for line in lines.values()], axis=0)
    high = np.max([(line.places.T + line.radius).max(axis=1) for line in lines.values()], axis=0)
    low, high = low - _MARGIN_MM, high + _MARGIN_MM
    heights = [high[up] - low[up] for _, up, _, _ in _VIEWS]
    axes = figure.subplots(2, 1, sharex=True, height_ratios=heights)
    joined = [lines[join.tube].places[-join.end] for join in anatomy.join]
    for (x, y, across, up), picture in zip(_VIEWS, axes, strict=True):
        for tube in anatomy.tube:
            line, colour = lines[tube.name], _COLOURS[tube.kind]
            discs = [
                Circle((place[x], place[y]), radius)
                for place, radius in zip(line.places, line.radius, strict=True)
            ]
            picture.add_collection(PatchCollection(discs, color=colour, alpha=0.12, linewidths=0))
            wide = 4.0 if tube.name == marked else 1.5
            picture.plot(
                line.places[:, x], line.places[:, y], color=colour, label=tube.name, linewidth=wide
            )
            if tube.name == marked:
                for end in (0, 1):
                    place = line.places[-end]
                    picture.annotate(
                        str(end), (place[x], place[y]), xytext=(4, 4), textcoords="offset points",
                        fontweight="bold",
                    )  # fmt: skip
        for place in joined:
            picture.plot(place[x], place[y], "ko", markersize=3)
        picture.set_xlabel(across)
        picture.set_ylabel(up)
        picture.set_aspect("equal")
        picture.set_xlim(low[x], high[x])
        picture.set_ylim(low[y], high[y])
    if inches[0] < _NARROW:
        figure.legend(
            *axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=2,
            fontsize="small", frameon=False,
        )  # fmt: skip
    else:
        axes[0].legend(
            loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small", frameon=False
        )
    axes[0].set_title(anatomy.title or anatomy.name)
    content = BytesIO()
    figure.savefig(content, format=kind, metadata={"Date": None} if kind == "svg" else None)
    return content.getvalue()


def figure_kind(path: Path) -> str:
    """Return the kind of picture that a file's name asks for."""
    kind = path.suffix.lower().removeprefix(".")
    if kind not in {"png", "svg", "pdf"}:
        raise ValueError(f"a figure's name must end in .png, .svg or .pdf, not {path.name!r}")
    return kind
