"""What a study of validity can show with so many people: simulated ones whose truth is known."""

import math
from typing import Any

import numpy as np
from rich.console import Console
from scipy.stats import norm

from app.classroom.evidence import area_under_curve, intraclass_correlation

RUNS = 2000
APART = 1.5
"""Standard deviations between the means of novices and experts."""
GROUPS = ((10, 10), (20, 10), (20, 20), (40, 40))
AGAIN, PEOPLE = 0.7, (10, 20, 30, 60)
"""A true ICC, and people who come twice."""


def measure_evidence(console: Console) -> dict[str, Any]:
    """Print and return how wide intervals are, and how often they hold the truth."""
    rng = np.random.default_rng(1)
    figures: dict[str, Any] = {}
    truth = float(norm.cdf(APART / math.sqrt(2.0)))
    for novices, experts in GROUPS:
        found = [
            area_under_curve(rng.normal(APART, 1.0, novices), rng.normal(0.0, 1.0, experts))
            for _ in range(RUNS)
        ]
        wide = float(np.median([each.high - each.low for each in found]))
        holds = float(np.mean([each.low <= truth <= each.high for each in found]))
        figures[f"area_{novices}_{experts}"] = {"width": wide, "holds": holds}
        console.print(
            f"area {truth:.2f}, {novices} novices and {experts} experts: interval {wide:.2f} wide, "
            f"holds the truth in {100.0 * holds:.1f} %",
            highlight=False,
        )
    for people in PEOPLE:
        own = rng.normal(0.0, math.sqrt(AGAIN), (RUNS, people, 1))
        scores = own + rng.normal(0.0, math.sqrt(1.0 - AGAIN), (RUNS, people, 2))
        found = [intraclass_correlation(each) for each in scores]
        low, high = (float(np.median([getattr(e, end) for e in found])) for end in ("low", "high"))
        holds = float(np.mean([each.low <= AGAIN <= each.high for each in found]))
        figures[f"icc_{people}"] = {"low": low, "high": high, "holds": holds}
        console.print(
            f"ICC {AGAIN}, {people} people twice: interval {low:.2f} to {high:.2f}, holds the "
            f"truth in {100.0 * holds:.1f} %",
            highlight=False,
        )
    return figures
