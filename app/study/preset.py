# pyarrow has no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false
"""A preset of a study's ducts: the medians of their tissue and how far they differ."""

import math
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.simulation import THESIS_PRESET, Preset, preset_named, presets
from app.study.plan import read_plan
from app.study.results import ResultsFolder


def preset_of_results(folder: Path) -> Preset:
    """Return the plan's preset with the modulus and strength, and their factors, of the results."""
    results = ResultsFolder(folder)
    results.about()
    plan = read_plan(folder / "plan.toml", files=False)
    if plan.has_anatomy:
        raise ValueError(f"{folder}: a preset is made of a study of ducts, not of anatomies")
    names = [str(each) for each in plan.values_of("preset")] or [THESIS_PRESET]
    if len(names) > 1 or names[0] not in presets():
        raise ValueError(
            f"{folder}: a preset is made of a study of one shipped preset, not of "
            f"{', '.join(names)}; write modulus_factor and strength_factor into your own"
        )
    base = preset_named(names[0])
    wanted = ["threshold_MPa", "fault", "mix"]
    if "modulus_MPa" in plan.varied:
        wanted.append("modulus_MPa")
    table: dict[str, list[NDArray[np.float64]]] = {name: [] for name in wanted}
    for batch in results.batches(wanted):
        sound = ~batch["fault"].is_valid().to_numpy(zero_copy_only=False)
        if plan.indices:  # the first and the last row of a draw are independent
            mix = batch["mix"].to_numpy()
            sound &= (mix == 0) | (mix == plan.mixes - 1)
        for name, rows in table.items():
            rows.append(batch[name].to_numpy(zero_copy_only=False)[sound])
    strength, strengths = _spread(np.concatenate(table["threshold_MPa"]))
    modulus, moduli = float(plan.fixed.get("modulus_MPa", base.modulus_MPa)), None
    if "modulus_MPa" in table:
        modulus, moduli = _spread(np.concatenate(table["modulus_MPa"]))
    return msgspec.structs.replace(
        base,
        name=f"{base.name}-study",
        title=f"{base.label}, as studied",
        modulus_MPa=modulus,
        break_stress_MPa=strength,
        break_force_N=None,
        modulus_factor=moduli,
        strength_factor=strengths,
        source=f"bluntdissect study, {plan.title}: medians. The rest: {base.source}",
        confidence="low",
        confidence_note="As sure as the distributions that the plan assumes.",
    )


def _spread(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return the median and the geometric standard deviation."""
    logs = np.log(values[values > 0.0])
    if not logs.size:
        raise ValueError("no duct of the study could be solved")
    return float(np.exp(np.median(logs))), math.exp(float(logs.std()))
