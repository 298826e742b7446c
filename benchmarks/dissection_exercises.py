"""Exercises in a bed, done by scripted hands over 20 seeds: who passes, and the measures."""

from collections import Counter
from typing import Any

import msgspec
import numpy as np
from rich.console import Console
from rich.table import Table

from app.command_line.load import shipped_organ
from app.simulation.bed import (
    MANNERS,
    BedExercise,
    BedManner,
    BedSession,
    DissectionMeasures,
    bed_named,
    script,
)
from app.simulation.exercise import Outcome

__all__ = ["measure_exercises"]

BED, SEEDS = "firm", range(1, 21)
COLUMNS = {
    "share %": lambda found: 100.0 * found.peak_stress_share,
    "rate %/s": lambda found: 100.0 * found.maximum_stress_rate_per_s,
    "hand N": lambda found: max(found.maximum_force_N),
    "rod N": lambda found: found.maximum_instrument_force_N,
    "hidden": lambda found: found.strands_parted_out_of_sight,
    "parted mJ": lambda found: found.parted_energy_mJ,
    "work mJ": lambda found: sum(found.work_mJ),
    "duct mJ": lambda found: found.duct_energy_mJ,
    "angle": lambda found: found.traction_angle_deg or 0.0,
    "s": lambda found: found.time_s,
}
"""Measures of a table, by heading."""


def done(
    session: BedSession, exercise: BedExercise, manner: BedManner
) -> tuple[DissectionMeasures, Outcome]:
    """Do an exercise with scripted hands."""
    session.start_exercise(exercise)
    for _ in script(session, session.duct, exercise, manner):
        session.advance()
        if session.run.over:
            break
    outcome = session.run.outcome
    return session.measures(), outcome or Outcome(False, "The hands were done before the goal.")


def measure_exercises(console: Console) -> dict[str, Any]:
    """Print and return who passes, and mean and standard deviation of the measures."""
    session = BedSession(shipped_organ(), bed=bed_named(BED), vertices=300)
    figures: dict[str, Any] = {}
    for offered in session.exercises_offered():
        table = Table(
            title=f"{offered.title}, bed {offered.bed}: {offered.limit}",
            title_justify="left",
            title_style="",
            box=None,
            pad_edge=False,
        )
        table.add_column("mean (sd)")
        for heading in ("passed", *COLUMNS):
            table.add_column(heading, justify="right", no_wrap=True)
        reasons: list[str] = []
        for label, manner in MANNERS[offered.name].items():
            with console.status(f"{offered.title}: {label} ..."):
                ends = [
                    done(session, msgspec.structs.replace(offered, bed_seed=seed), manner)
                    for seed in SEEDS
                ]
            passed = sum(outcome.passed for _, outcome in ends)
            rows = np.array([[read(found) for read in COLUMNS.values()] for found, _ in ends])
            cells = [
                f"{mean:.3g} ({sd:.2g})"
                for mean, sd in zip(rows.mean(axis=0), rows.std(axis=0), strict=True)
            ]
            table.add_row(label, f"{passed} / {len(ends)}", *cells)
            counted = Counter(outcome.reason.split(": ")[-1] for _, outcome in ends)
            why, often = counted.most_common(1)[0]
            reasons.append(f"  {label}, {often} of {len(ends)}: {why}")
            figures[f"{offered.name} {label}"] = {
                "passed": passed,
                "reasons": dict(counted),
                "mean": dict(zip(COLUMNS, rows.mean(axis=0).tolist(), strict=True)),
                "sd": dict(zip(COLUMNS, rows.std(axis=0).tolist(), strict=True)),
            }
        console.print(table, soft_wrap=True)
        for line in reasons:
            console.print(line, highlight=False, soft_wrap=True)
    return figures
