"""Exercises in a bed, done by scripted hands over 20 seeds: who passes, and the measures."""

import re
from collections import Counter
from typing import Any

import msgspec
import numpy as np
from rich.console import Console

from app.command_line.load import shipped_organ
from app.simulation import (
    MANNERS,
    Exercise,
    Metrics,
    Outcome,
    Session,
    bed_named,
    exercises_offered,
    not_offered,
    perform,
    specimen_in_bed,
)
from app.simulation.scripts.scripted_hands import Technique

BED, SEEDS = "firm", range(1, 21)
COLUMNS = {
    "share %": lambda found: 100.0 * found["peak_stress_ratio"],
    "time to break s": lambda found: found["shortest_time_to_break_s"] or 0.0,
    "hand N": lambda found: max(found["maximum_force_N"]),
    "rod N": lambda found: found["maximum_instrument_force_N"],
    "hidden": lambda found: found["strands_broken_out_of_sight"],
    "parted mJ": lambda found: found["strand_energy_mJ"],
    "work mJ": lambda found: sum(found["work_mJ"]),
    "duct mJ": lambda found: found["duct_energy_mJ"],
    "angle": lambda found: found["traction_angle_deg"] or 0.0,
    "s": lambda found: found["time_s"],
}
"""Measures of a table, by heading."""


def done(session: Session, exercise: Exercise, technique: Technique) -> tuple[Metrics, Outcome]:
    """Do an exercise with scripted hands."""
    session.start_exercise(exercise)
    perform(session, technique)
    outcome = session.run.outcome
    return session.metrics(), outcome or Outcome(False, "The hands were done before the goal.")


def measure_exercises(console: Console) -> dict[str, Any]:
    """Print and return who passes, and mean and standard deviation of the measures."""
    session = Session(specimen_in_bed(shipped_organ(), bed=bed_named(BED)), vertices=300)
    figures: dict[str, Any] = {}
    for name, why in not_offered(session).items():
        console.print(f"\nNot offered: {name}, {why}", highlight=False, soft_wrap=True)
    for offered in exercises_offered(session):
        opening = offered.opening
        assert opening is not None
        beds = [msgspec.structs.replace(opening, bed_seed=seed) for seed in SEEDS]
        console.print(
            f"\n{offered.title}, bed {opening.bed}: {offered.caution}",
            highlight=False,
            soft_wrap=True,
        )
        for label, technique in MANNERS[offered.name].items():
            with console.status(f"{offered.title}: {label} ..."):
                ends = [
                    done(session, msgspec.structs.replace(offered, opening=each), technique)
                    for each in beds
                ]
            passed = sum(outcome.passed for _, outcome in ends)
            rows = np.array([[read(found) for read in COLUMNS.values()] for found, _ in ends])
            cells = [
                f"{name} {mean:.3g} (sd {sd:.2g})"
                for name, mean, sd in zip(COLUMNS, rows.mean(axis=0), rows.std(axis=0), strict=True)
            ]
            line = f"  {label}: {passed} of {len(ends)} pass; {', '.join(cells)}"
            console.print(line, highlight=False, soft_wrap=True)
            counted = Counter(re.sub(r"[\d.]+ ", "... ", outcome.reason) for _, outcome in ends)
            why, often = counted.most_common(1)[0]
            console.print(f"    {often} of {len(ends)}: {why}", highlight=False, soft_wrap=True)
            figures[f"{offered.name} {label}"] = {
                "passed": passed,
                "reasons": dict(counted),
                "mean": dict(zip(COLUMNS, rows.mean(axis=0).tolist(), strict=True)),
                "sd": dict(zip(COLUMNS, rows.std(axis=0).tolist(), strict=True)),
            }
    return figures
