# matplotlib's types are partial, pyarrow has none.
# pyright: reportUnknownMemberType=false, reportArgumentType=false, reportMissingTypeStubs=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
"""What comes of a study: the probability of a tear, its bands, and what each input explains.

The probability of a tear at a load is the share of ducts that break at a lower one. Its band is
Wilson's 95 % interval for as many independent ducts; Sobol' sequences are nearer than that.
"""

import base64
import html
import json
import math
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from app.study.anatomies import FIRST_TORN
from app.study.distribution import Choices
from app.study.plan import Plan, read_plan
from app.study.results import ResultsFolder, unit_of
from app.study.sensitivity import Index, sobol_indices
from organ_geometry import write_atomic

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Row = NDArray[np.float64]

Z = 1.959964
"""Of the normal distribution, for 95 %."""
FRACTIONS = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
MOST_POINTS = 200
"""Points of a curve that is drawn."""
MOST_CELLS = 8
"""Cells of a grid that are drawn; the JSON has all."""
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#999999")
"""Okabe and Ito's, which colour-blind readers tell apart."""
LOADS = {"break_force_N": "force, N", "break_deflection_mm": "deflection, mm"}
UNITS = {"break_force_N": "N", "break_deflection_mm": "mm"}
NOTHING = "nothing"
"""In the place of a tube, where none tears."""
EXPLAINED = (*LOADS, "distance_to_break", "largest_force_N", "least_distance_to_break")
WORDS = {
    "break_force_N": "force at break",
    "break_deflection_mm": "deflection at break",
    "distance_to_break": "distance to break",
    "largest_force_N": "largest force",
    "least_distance_to_break": "least distance to break",
}


class TearCurve:
    """(M,) growing loads and the probability of a tear up to each, with its 95 % band.

    Breaks are the loads at break, nan for ducts that do not.
    `count` ducts were solved, those that do not break among them; `broke` of them do.
    """

    def __init__(self, breaks: Row) -> None:
        found = np.sort(breaks[np.isfinite(breaks)])
        self.count = breaks.size
        self.broke = found.size
        self._sorted = found
        at = np.unique(np.linspace(0, max(found.size - 1, 0), MOST_POINTS).astype(np.int64))
        self.loads: Row = found[at] if found.size else np.empty(0)
        torn = np.searchsorted(found, self.loads, side="right")
        self.probability: Row = torn / max(self.count, 1)
        self.low, self.high = wilson(torn, self.count)

    def load_at(self, fraction: float) -> tuple[float, float, float]:
        """Return the load at which this share of ducts is torn, and its 95 % band; nan: none."""
        from scipy.stats import binom

        # An end is nan, open, where so few ducts lie beyond it that they do not bound it. Order
        # statistics: fewer than i of the ducts are torn at the load that is sought, and the i-th
        # is above it, as often as the binomial distribution has it, whatever that of the breaks.
        low, high = (int(binom.ppf(tail, self.count, fraction)) for tail in (0.025, 0.975))
        found = self._sorted
        values = [
            float(found[at]) if 0 <= at < found.size else math.nan
            for at in (int(fraction * self.count), low - 1, high)
        ]
        return values[0], values[1], values[2]


def wilson(hits: NDArray[np.int64], count: int) -> tuple[Row, Row]:
    """Return the ends of Wilson's 95 % intervals of a probability."""
    fraction = hits / max(count, 1)
    over = 1.0 + Z**2 / max(count, 1)
    middle = (fraction + 0.5 * Z**2 / max(count, 1)) / over
    half = (
        Z
        / over
        * np.sqrt(fraction * (1.0 - fraction) / max(count, 1) + 0.25 * (Z / max(count, 1)) ** 2)
    )
    return np.clip(middle - half, 0.0, 1.0), np.clip(middle + half, 0.0, 1.0)


def write_report(folder: Path) -> dict[str, Any]:
    """Write report.html and report.json beside a study's results; return what the latter has."""
    results = ResultsFolder(folder)
    about = results.about()
    plan = read_plan(folder / "plan.toml", files=False)
    if plan.text != about["plan"]:
        raise ValueError(f"{folder / 'plan.toml'} is not the plan of {results.table}")
    columns = _columns(results, plan)
    independent = np.ones(columns["draw"].size, dtype=np.bool_)
    if plan.indices:  # A and B are independent draws, what is mixed of both is not
        independent = np.isin(columns["mix"], (0, plan.mixes - 1))
    cells = _cells(plan, columns)
    report: dict[str, Any] = {
        "title": plan.title,
        "ducts": int(columns["draw"].size),
        "independent": int(independent.sum()),
        "faults": int(columns["faulty"].sum()),
        "inputs": _inputs(plan),
        "cells": [],
        "versions": about["versions"],
        "seed": about["seed"],
    }
    curves: dict[str, list[tuple[str, TearCurve]]] = {name: [] for name in LOADS}
    indices: dict[str, dict[str, list[Index]]] = {}
    for label, which in cells:
        here = which & independent & ~columns["faulty"]
        cell: dict[str, Any] = {"cell": label, "ducts": int(here.sum())}
        for name in (each for each in LOADS if each in columns):
            curve = TearCurve(columns[name][here])
            curves[name].append((label, curve))
            cell[name] = _tear_figures(curve)
        for name in EXPLAINED[2:]:
            if name in columns:
                cell[name] = _quantiles(columns[name][here])
        if FIRST_TORN in columns:
            cell[FIRST_TORN] = _first_torn(columns[FIRST_TORN][here])
        if "distance_to_break" in columns:
            # Ducts that cannot bear the load at all have no distance: they are faults.
            values = columns["distance_to_break"][here]
            torn = int(np.sum(values < 0.0))
            low, high = wilson(np.array([torn]), values.size)
            cell["torn_under_load"] = {
                "probability": torn / max(values.size, 1),
                "band_95": [float(low[0]), float(high[0])],
            }
        if plan.indices:
            found = {
                name: sobol_indices(list(plan.drawn), columns[name][which], seed=plan.seed)
                for name in EXPLAINED
                if name in columns
            }
            indices[label] = found
            cell["indices"] = {
                name: {
                    each.name: {
                        "first": _finite(each.first),
                        "first_half_width_95": _finite(each.first_half),
                        "total": _finite(each.total),
                        "total_half_width_95": _finite(each.total_half),
                    }
                    for each in rows
                }
                for name, rows in found.items()
            }
        report["cells"].append(cell)
    report["summary"] = _summary(plan, report, indices)
    write_atomic(folder / "report.json", json.dumps(report, indent=1).encode())
    page = _page(plan, report, curves, indices)
    write_atomic(folder / "report.html", page.encode())
    return report


def _columns(results: ResultsFolder, plan: Plan) -> dict[str, Any]:
    import pyarrow.parquet as pq

    names = pq.read_schema(results.table).names
    of_all = ("draw", "mix", *plan.grid, *EXPLAINED, FIRST_TORN, "fault")
    wanted = [each for each in of_all if each in names]
    blocks: dict[str, list[Any]] = {name: [] for name in wanted}
    for batch in results.batches(wanted):
        for name in wanted:
            column = batch[name]
            if name == "fault":
                blocks[name].append(column.is_valid().to_numpy(zero_copy_only=False))
            else:
                blocks[name].append(np.asarray(column.to_numpy(zero_copy_only=False)))
    columns = {name: np.concatenate(rows) for name, rows in blocks.items()}
    columns["faulty"] = columns.pop("fault")
    return columns


def _cells(plan: Plan, columns: dict[str, Any]) -> list[tuple[str, NDArray[np.bool_]]]:
    """Return the name of each cell of the grid and its rows; one cell of all without a grid."""
    everywhere = np.ones(columns["draw"].size, dtype=np.bool_)
    cells = [("", everywhere)]
    for name, values in plan.grid.items():
        unit = unit_of(name)
        cells = [
            (
                ", ".join(
                    [
                        *([label] if label else []),
                        f"{_plain(name)} {_text(value)} {_unit(unit)}".strip(),
                    ]
                ),
                which & (columns[name] == value),
            )
            for label, which in cells
            for value in values
        ]
    return cells


def _plain(name: str) -> str:
    """Return the name of an input without its unit."""
    unit = unit_of(name).replace("/", "_")
    return (
        name.removesuffix(f"_{unit}").replace("_", " ")
        if unit not in ("", "1")
        else name.replace("_", " ")
    )


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _first_torn(tubes: NDArray[np.object_]) -> dict[str, Any]:
    """Return how often each tube tears first, the most frequent one first."""
    named = [NOTHING if each is None else str(each) for each in tubes]
    found: dict[str, Any] = {}
    for tube in sorted(set(named), key=lambda each: (-named.count(each), each)):
        count = named.count(tube)
        low, high = wilson(np.array([count]), len(named))
        found[tube] = {
            "count": count,
            "probability": count / len(named),
            "band_95": [float(low[0]), float(high[0])],
        }
    return found


def _tear_figures(curve: TearCurve) -> dict[str, Any]:
    return {
        "broke": curve.broke,
        "torn_at": {
            f"{fraction:g}": {
                "load": _finite(values[0]),
                "band_95": [_finite(values[1]), _finite(values[2])],
            }
            for fraction in FRACTIONS
            for values in [curve.load_at(fraction)]
        },
        "curve": {
            "load": curve.loads.tolist(),
            "probability": curve.probability.tolist(),
            "low_95": curve.low.tolist(),
            "high_95": curve.high.tolist(),
        },
    }


def _quantiles(values: Row) -> dict[str, Any]:
    found = values[np.isfinite(values)]
    if not found.size:
        return {}
    return {
        "mean": float(found.mean()),
        "sd": float(found.std(ddof=1)) if found.size > 1 else None,
        "quantiles": {
            f"{fraction:g}": float(np.quantile(found, fraction)) for fraction in FRACTIONS
        },
    }


def _inputs(plan: Plan) -> dict[str, str]:
    words: dict[str, str] = {}
    for name, kind in plan.drawn.items():
        if isinstance(kind, Choices):
            total = math.fsum(kind.weights)
            words[name] = ", ".join(
                f"{_text(value)} ({weight / total:.3g})"
                for value, weight in zip(kind.values, kind.weights, strict=True)
            )
        else:
            given = ", ".join(f"{key} {value:g}" for key, value in kind.parameters.items())
            words[name] = f"{kind.shape}, {given}"
    for each in plan.correlations:
        words[each.one] += f"; rank correlation {each.rank:g} with {_plain(each.other)}"
    for name, values in plan.grid.items():
        words[name] = "each of " + ", ".join(_text(value) for value in values)
    return words


def _summary(
    plan: Plan, report: dict[str, Any], indices: dict[str, dict[str, list[Index]]]
) -> list[str]:
    """Say what comes of it in a few plain sentences."""
    lines: list[str] = []
    one = "case" if plan.has_anatomy else "duct"
    for cell in report["cells"][:MOST_CELLS]:
        where = f"{cell['cell']}: " if cell["cell"] else ""
        for tube, found in cell.get(FIRST_TORN, {}).items():
            low, high = found["band_95"]
            lines.append(
                f"{where}{tube} tears{' first' * (tube != NOTHING)} in "
                f"{100 * found['probability']:.1f} % of cases ({100 * low:.1f} to "
                f"{100 * high:.1f} %)."
            )
        for name in (each for each in UNITS if each in cell):
            unit = UNITS[name]
            at = cell[name]["torn_at"]
            few, half = at["0.05"]["load"], at["0.5"]["load"]
            if half is None:
                fraction = cell[name]["broke"] / max(cell["ducts"], 1)
                limit = (
                    "before the pull ends" if plan.has_bed or plan.has_anatomy else "at any load"
                )
                line = f"{where}{100.0 * fraction:.1f} % of {one}s break {limit}."
                lines += [line] * (line not in lines)
                continue
            most = at["0.95"]["load"]
            up_to = f", 19 in 20 at {most:.4g} {unit}" if most is not None else ""
            lines.append(
                f"{where}1 {one} in 20 is torn at {few:.4g} {unit}, "
                f"half at {half:.4g} {unit}{up_to}."
            )
        if "torn_under_load" in cell:
            under = cell["torn_under_load"]
            low, high = under["band_95"]
            lines.append(
                f"{where}under the load given {100 * under['probability']:.1f} % are torn "
                f"({100 * low:.1f} to {100 * high:.1f} %)."
            )
    for label, found in indices.items():
        rows = [each for each in found.get("break_force_N", []) if math.isfinite(each.first)]
        if not rows:
            continue
        where = f"{label}: " if label else ""
        best = max(rows, key=lambda each: each.first)
        lines.append(
            f"{where}{_plain(best.name)} would repay being measured most: were it known, the "
            f"variance of the force at break would fall by {100 * best.first:.0f} % on average "
            f"(± {100 * best.first_half:.0f} %)."
        )
        idle = [_plain(each.name) for each in rows if each.total + each.total_half < 0.05]
        if idle:
            lines.append(
                f"{where}less than 5 % of it hangs on {', '.join(idle)}: measuring that better "
                "would change next to nothing."
            )
    if not plan.indices and plan.drawn and not plan.has_anatomy:
        lines.append(
            "The plan has no `indices = true`: what each input explains is not known from it."
        )
    if report["faults"]:
        lines.append(f"{report['faults']:,} of {report['ducts']:,} {one}s could not be solved.")
    return lines


def _page(
    plan: Plan,
    report: dict[str, Any],
    curves: dict[str, list[tuple[str, TearCurve]]],
    indices: dict[str, dict[str, list[Index]]],
) -> str:
    figures = [
        _figure(_draw_curves(name, found), f"Probability of a tear against the {LOADS[name]}")
        for name, found in curves.items()
        if any(curve.loads.size for _, curve in found)
    ]
    for label, found in list(indices.items())[:MOST_CELLS]:
        title = "What each input explains" + (f", {label}" if label else "")
        figures.append(_figure(_draw_indices(found), title))
    rows = "".join(
        f"<tr><td>{html.escape(name)}</td><td>{html.escape(words)}</td>"
        f"<td>{html.escape(_unit(unit_of(name)))}</td></tr>"
        for name, words in report["inputs"].items()
    )
    summary = "".join(f"<li>{html.escape(line)}</li>" for line in report["summary"])
    cells = "".join(_cell_table(cell) for cell in report["cells"][:MOST_CELLS])
    left = len(report["cells"]) - MOST_CELLS
    if left > 0:
        cells += f"<p>{left} more cells of the grid are in report.json.</p>"
    versions = ", ".join(f"{name} {each}" for name, each in report["versions"].items())
    page = files("app.study").joinpath("report.html").read_text(encoding="utf-8")
    return page.format(
        title=html.escape(plan.title),
        ducts=f"{report['ducts']:,} {'cases' if plan.has_anatomy else 'ducts'}",
        independent=f"{report['independent']:,}",
        summary=summary,
        figures="".join(figures),
        inputs=rows,
        cells=cells,
        seed=report["seed"],
        versions=html.escape(versions),
        plan=html.escape(plan.text),
    )


def _cell_table(cell: dict[str, Any]) -> str:
    head = "".join(f'<th class="n">{100 * fraction:g} %</th>' for fraction in FRACTIONS)
    rows = ""
    for name in (each for each in UNITS if each in cell):
        unit, at = UNITS[name], cell[name]["torn_at"]
        values = ""
        for fraction in FRACTIONS:
            load, (low, high) = at[f"{fraction:g}"]["load"], at[f"{fraction:g}"]["band_95"]
            ends = " to ".join("open" if end is None else _number(end) for end in (low, high))
            band = ends if load is not None else ""
            values += f'<td class="n" title="95 %: {band}">{_number(load)}</td>'
        rows += f"<tr><td>{WORDS[name]}, {unit}</td>{values}</tr>"
    title = f"<h3>{html.escape(cell['cell'])}</h3>" if cell["cell"] else ""
    if FIRST_TORN in cell:
        torn = "".join(
            f'<tr><td>{html.escape(tube)}</td><td class="n">{found["count"]}</td>'
            f'<td class="n">{100 * found["probability"]:.1f} %</td>'
            f'<td class="n">{100 * found["band_95"][0]:.1f} to {100 * found["band_95"][1]:.1f} %'
            "</td></tr>"
            for tube, found in cell[FIRST_TORN].items()
        )
        title += (
            '<table><tr><th>tears first</th><th class="n">cases</th><th class="n">share</th>'
            f'<th class="n">95 %</th></tr>{torn}</table>'
        )
    return f"{title}<table><tr><th>share torn</th>{head}</tr>{rows}</table>"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _new_figure(height: float) -> "Figure":
    from matplotlib.figure import Figure

    return Figure(figsize=(8.0, height), layout="constrained")


def _figure(figure: "Figure", words: str) -> str:
    drawn = BytesIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    data = base64.b64encode(drawn.getvalue()).decode()
    text = html.escape(words)
    return (
        f'<figure><img alt="{text}" src="data:image/svg+xml;base64,{data}">'
        f"<figcaption>{text}</figcaption></figure>\n"
    )


def _draw_curves(name: str, found: list[tuple[str, TearCurve]]) -> "Figure":
    figure = _new_figure(4.5)
    axes = figure.add_subplot()
    most = 0.0
    for k, (label, curve) in enumerate(found[:MOST_CELLS]):
        if not curve.loads.size:
            continue
        colour = COLOURS[k % len(COLOURS)]
        axes.fill_between(curve.loads, curve.low, curve.high, color=colour, alpha=0.25, linewidth=0)
        axes.plot(curve.loads, curve.probability, color=colour, label=label or "share torn")
        # A long tail would squeeze the rest into a corner.
        shown = curve.load_at(0.98)[0]
        most = max(most, shown if math.isfinite(shown) else float(curve.loads[-1]))
    axes.set_xlim(0.0, most)
    axes.set_ylim(0.0, 1.0)
    axes.set_xlabel(LOADS[name])
    axes.set_ylabel("probability of a tear")
    axes.grid(alpha=0.3)
    if len(found) > 1:
        axes.legend(frameon=False)
    return figure


def _draw_indices(found: dict[str, list[Index]]) -> "Figure":
    shown = {name: rows for name, rows in found.items() if math.isfinite(rows[0].first)}
    inputs = len(next(iter(found.values())))
    figure = _new_figure(1.2 + 0.45 * inputs)
    panels = figure.subplots(1, max(len(shown), 1), sharey=True, squeeze=False)[0]
    for axes, (name, rows) in zip(panels, shown.items(), strict=False):
        at = np.arange(len(rows))
        for shift, kind, colour in ((-0.2, "first", COLOURS[0]), (0.2, "total", COLOURS[1])):
            axes.barh(
                at + shift,
                [getattr(each, kind) for each in rows],
                0.38,
                xerr=[getattr(each, f"{kind}_half") for each in rows],
                color=colour,
                label=kind,
                error_kw={"linewidth": 1, "capsize": 2},
            )
        axes.set_title(WORDS[name], fontsize=10)
        axes.set_xlim(0.0, 1.05)
        axes.grid(axis="x", alpha=0.3)
        axes.set_yticks(at, [_plain(each.name) for each in rows])
    panels[0].invert_yaxis()
    panels[-1].legend(frameon=False, loc="lower right")
    figure.supxlabel("part of the variance", fontsize=10)
    return figure
