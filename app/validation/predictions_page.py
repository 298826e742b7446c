# matplotlib's types are partial.
# pyright: reportUnknownMemberType=false
"""The page of predictions: a table, a picture, and what each is made from."""

import re
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

import msgspec

from app.validation.figures import save_figure
from app.validation.page import markdown_table
from app.validation.predictions import DRAWS, SEED, Experiment, Prediction

HIT = 2.0
"""|z| up to which a prediction counts as met."""


def predictions_page(found: Sequence[Prediction]) -> str:
    """Return the page in Markdown."""
    words = files("app.validation").joinpath("predictions.md").read_text(encoding="utf-8")
    first: dict[str, str] = {}
    page = words.format(
        draws=DRAWS,
        seed=SEED,
        hits=sum(abs(each.z) <= HIT for each in found),
        count=len(found),
        table=predictions_table(found).rstrip(),
        sections="\n\n".join(_section(each, first) for each in found),
    )
    # Units are plain ASCII in the experiments' files.
    return re.sub(r"\b([cm]?m)2\b", "\\1²", page)


def predictions_table(found: Sequence[Prediction]) -> str:
    """Return measured and predicted figures in Markdown."""
    head = ["experiment", "measured, mean (sd), n", "predicted, mean (sd)", "5 to 95 %", "z"]
    rows = [
        [
            each.experiment.title,
            f"{_measured(each.experiment)}, {each.experiment.n}",
            f"{each.mean:.3g} ({each.sd:.2g}) {each.experiment.unit}",
            f"{each.low:.3g} to {each.high:.3g}",
            f"{each.z:+.1f}",
        ]
        for each in found
    ]
    return markdown_table(head, rows)


def prediction_lines(found: Prediction) -> list[tuple[str, str]]:
    """Return a prediction in words."""
    of = found.experiment
    return [
        ("experiment", of.title),
        ("measured", f"{_measured(of)}, n = {of.n}"),
        ("predicted", f"{found.mean:.4g} ({found.sd:.3g}) {of.unit}, 5 to 95 % {found.low:.4g} "
         f"to {found.high:.4g} {of.unit}"),
        ("z", f"{found.z:+.2f}"),
        *([("without", f"{100.0 * found.lost:.1f} % of draws bear no such load")]
          if found.lost else []),
    ]  # fmt: skip


def draw_predictions(found: Sequence[Prediction], folder: Path) -> None:
    """Draw measured means and predictions, each over its measured mean, as PNG and SVG."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ValueError("figures need matplotlib: pip install 'bluntdissect[report]'") from error
    folder.mkdir(exist_ok=True)
    figure = Figure(figsize=(8.5, 0.5 * len(found) + 1.4), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    for row, each in enumerate(found):
        mean, sd = each.experiment.mean, each.experiment.sd
        if sd is not None:
            low = max(mean - sd, 0.02 * mean) / mean
            axes.plot([low, 1.0 + sd / mean], [row + 0.15] * 2, color="#000000", linewidth=2.0)
        axes.plot([1.0], [row + 0.15], "o", color="#000000", label="" if row else "measured, 1 sd")
        line = [each.low / mean, each.high / mean]
        axes.plot(line, [row - 0.15] * 2, color="#0072b2", linewidth=2.0)
        axes.plot([each.median / mean], [row - 0.15], "s", color="#0072b2",
                  label="" if row else "predicted, median and 5 to 95 %")  # fmt: skip
    axes.set_xscale("log")
    axes.set_yticks(range(len(found)), [each.experiment.title for each in found], fontsize=7)
    axes.invert_yaxis()
    axes.set_xlabel("over the measured mean")
    axes.grid(alpha=0.3, axis="x")
    axes.legend(frameon=False, fontsize=7)
    save_figure(figure, folder / "predictions")


def _measured(of: Experiment) -> str:
    spread = "sd not given" if of.sd is None else f"{of.sd:.3g}"
    return f"{of.mean:.4g} ({spread}) {of.unit}"


def _section(found: Prediction, first: dict[str, str]) -> str:
    """Return a prediction's sources and its sentence; `first` has the title where each is given."""
    of = found.experiment
    lost = (
        f" {100.0 * found.lost:.1f} % of the draws bear no such load and are left out."
        if found.lost
        else ""
    )
    stands = first.setdefault(of.source, of.title)
    source = of.source if stands == of.title else f"that of *{stands}*"
    inputs: list[str] = []
    same: dict[str, list[str]] = {}
    for name, each in of.inputs.items():
        label = name.replace("_", " ")
        line = f"- {label}: {_given(each)} {each.unit}. {each.source}"
        title = first.setdefault(line, of.title)
        if title == of.title:
            inputs.append(line)
        else:
            same.setdefault(title, []).append(label)
    inputs += [f"- {', '.join(names)}: as in *{title}*." for title, names in same.items()]
    lines = [
        f"## {of.title}",
        f"{of.protocol} Source: {source}. {of.figures}",
        f"**z = {found.z:+.1f}.** {of.why}{lost}",
        "\n".join(inputs),
    ]
    return "\n\n".join(lines)


def _given(each: object) -> str:
    values = {
        name: value
        for name, value in msgspec.to_builtins(each).items()
        if name not in ("unit", "source") and value is not None
    }
    if "value" in values:
        return f"{values['value']:g}"
    shape = values.pop("distribution")
    numbers = ", ".join(f"{name} {value:g}" for name, value in values.items())
    return f"{shape}, {numbers}"
