"""`bluntdissect peel`: a scene of a beam on a bed, without an organ."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.command_line.answer import AsJson, answer

if TYPE_CHECKING:
    from physics.bed import History


def peel(
    scene: Annotated[
        Path, typer.Argument(help="The scene, a TOML file; docs/peel.md has its fields.")
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write the history as CSV here.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Pull a beam off a bed of strands as a scene says, and account for the energy of each step.

    Example: bluntdissect peel scene.toml --json -o history.csv
    """
    from app.peel import read_scene
    from organ_geometry import check_target

    if output is not None:
        check_target(output)
    found = read_scene(scene)
    try:
        history = found.run()
    except ValueError as error:
        raise ValueError(f"{scene}: {error}") from None
    limit = None if found.beam is None else found.beam.break_stress_MPa
    law = None if found.beam is None or limit is None else found.beam.law or "linear"
    report_history(
        history, None if limit is None else float(limit), output, law=law, as_json=as_json
    )


def report_history(
    history: "History",
    threshold: float | None,
    output: Path | None,
    *,
    law: str | None,
    as_json: bool,
) -> None:
    """Write a history as CSV where asked for, and print it; `law` is its wall's."""
    import numpy as np

    from organ_geometry import write_atomic

    if output is not None:
        write_atomic(output, history.csv(threshold).encode())
    rows = history.rows(threshold)
    last = rows[-1]
    result: dict[str, object] = {"steps": rows, "residual_ratio": history.residual_ratio}
    if history.notes:
        result["notes"] = history.notes
    worst = 0  # step of the highest stress
    if threshold is not None:
        stress = history.stress
        assert stress is not None  # noqa: S101
        result["law"], result["threshold_MPa"] = law, threshold
        result["distance_to_break_percent"] = last["distance_to_break_percent"]
        worst = int(stress.argmax())
        result["least_distance_to_break_percent"] = 100.0 * (1.0 - float(stress[worst]) / threshold)
    broken = f"{history.broken[-1]} of {history.damage.size}"
    lines: list[tuple[str, str]] = [("steps", str(history.steps))]
    if history.hands.shape[1]:
        size = np.sqrt((history.forces[:, 0] ** 2).sum(axis=1))
        at, force = last["hand_mm"], last["force_N"]
        lines += [
            ("hand", "let go" if at is None else f"{_words(history.hands[-1, 0])} mm"),
            ("force", "none" if force is None else f"{_words(history.forces[-1, 0])} N"),
            ("largest force", f"{np.nanmax(size):.6g} N, in step {int(np.nanargmax(size)) + 1}"),
        ]
    lines += [
        ("freed", f"{history.freed[-1]:.6g} mm, {broken} strands broken"),
        ("work", f"{history.work[-1]:.6g} mJ"),
        ("stored", f"{history.stored[-1]:.6g} mJ"),
        ("dissipated", f"{history.dissipated[-1]:.6g} mJ"),
        ("snap", f"{history.snap[-1]:.6g} mJ"),
    ]
    if history.viscous is not None:
        lines.append(("viscous", f"{history.viscous[-1]:.6g} mJ"))
    lines += [
        ("not explained", f"{history.residual_ratio:.1e} of the work"),
    ]
    if threshold is not None:
        lines += [
            ("distance to break", f"{result['distance_to_break_percent']:.2f} %"),
            ("threshold", f"{1e3 * threshold:.6g} kPa, {law} law; stresses are nominal"),
            ("least on the way", f"{result['least_distance_to_break_percent']:.2f} %"),
            ("highest stress", _highest(history, -1, threshold)),
            ("highest on the way", f"{_highest(history, worst, threshold)}, in step {worst + 1}"),
        ]
    for tube in history.tubes:
        torn = ", ".join(f"torn at {at:.4g} mm in step {step + 1}" for step, at in tube.torn)
        words = torn or f"{tube.freed[-1]:.6g} mm freed"
        if tube.strength < math.inf and not torn:
            left = tube.row(-1)
            words += f"; distance to break {left['distance_to_break_percent']:.2f} %, "
            words += f"at {left['highest_at_mm']:.6g} mm"
        if tube.lost is not None:
            now = tube.row(-1)
            words += f"; lost {now['lost_ml']:.6g} ml, {now['flow_ml_per_s']:.6g} ml/s"
        lines.append((f"tube {tube.name}", words))
    lines += [("note", each) for each in history.notes]
    answer(result, lines, as_json=as_json)


def _highest(found: "History", step: int, threshold: float) -> str:
    """Return where the highest stress is after a step, and its part of the threshold."""
    assert found.stress is not None  # noqa: S101 (of a wall)
    assert found.highest_at is not None  # noqa: S101
    percent = 100.0 * float(found.stress[step]) / threshold
    return f"{percent:.2f} % of the threshold, at {float(found.highest_at[step]):.6g} mm"


def _words(row: object) -> str:
    import numpy as np

    return ", ".join(f"{float(v):.6g}" for v in np.asarray(row))
