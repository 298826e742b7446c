"""Cold solves of the exact beam over random beams, grasps and loads: none may fail.

Run from the root of the repository: ``python -m benchmarks.exact_sweep [count]``.
"""

import math
import sys
import time
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from physics import Beam, BeyondLaw, Exact, Linear, NeoHooke

THEORIES = {
    "linear": Exact(),
    "linear, shear": Exact(Linear(shear=True)),
    "neo-hooke, shear": Exact(NeoHooke()),
}
# Smallest deflection, as a part of the largest.
SMALLEST_LOAD = 1e-6
# Largest length of the beam, as two straight lines, over its span.
WHOLE_STRETCH = 2.5
# Largest deflection of a neo-Hookean beam that is grasped less than half a diameter from a clamp,
# in lengths of that part.
STUBBY_REACH = 1.1
ROUND_TRIP = 1e-9
"""Relative difference of a deflection and that found back from its force."""


@dataclass
class Sweep:
    """The results of one theory's solves."""

    # Number of cold solves by deflection that found an equilibrium with finite numbers.
    solved: int = 0
    returned: int = 0  # Number of those whose force leads back to their deflection, cold
    failures: list[str] = field(default_factory=list[str])  # What did not, with the reason
    slowest: float = 0.0  # Longest pair of solves, s
    total: float = 0.0  # Time of all of them, s


def random_case(generator: np.random.Generator, *, neo_hooke: bool) -> tuple[Beam, float, float]:
    """Return a beam, a grasp, mm, and a deflection, mm, in the range of the theory."""
    outer = 10.0 ** generator.uniform(-0.5, 1.5)
    span = 2.0 * outer * math.exp(generator.uniform(0.0, math.log(50.0)))
    inner = outer * generator.uniform(0.05, 0.95) if generator.random() < 0.5 else 0.0
    beam = Beam(
        span=span,
        area=0.25 * math.pi * (outer**2 - inner**2),
        second_moment=math.pi / 64.0 * (outer**4 - inner**4),
        fibre_distance=0.5 * outer,
        modulus=10.0 ** generator.uniform(-3.0, 3.0),
        poisson_ratio=generator.uniform(0.2 if neo_hooke else 0.0, 0.49),
    )
    fraction = 0.5 if generator.random() < 0.25 else generator.uniform(0.05, 0.95)
    largest = whole_reach(fraction) * span
    shorter = min(fraction, 1.0 - fraction) * span
    if neo_hooke and shorter < 0.5 * outer:
        largest = STUBBY_REACH * shorter
    near = generator.random() < 0.5
    scale = generator.uniform(0.9, 1.0) if near else SMALLEST_LOAD ** generator.random()
    sign = -1.0 if generator.random() < 0.5 else 1.0
    return beam, fraction * span, sign * scale * largest


def whole_reach(fraction: float) -> float:
    """Return the deflection, in spans, that draws two straight lines to `WHOLE_STRETCH` spans."""
    a, b = fraction, 1.0 - fraction
    low, high = 0.0, WHOLE_STRETCH
    for _ in range(60):
        middle = 0.5 * (low + high)
        short = math.hypot(a, middle) + math.hypot(b, middle) < WHOLE_STRETCH
        low, high = (middle, high) if short else (low, middle)
    return low


def sweep(theory: Exact, count: int, seed: int = 1) -> Sweep:
    """Return the results of random cold solves, by deflection and back by force."""
    generator = np.random.default_rng(seed)
    result = Sweep()
    for _ in range(count):
        beam, grasp, deflection = random_case(generator, neo_hooke=theory.law == NeoHooke())
        case = f"{beam}, grasp {grasp:.6g}, deflection {deflection:.6g}"
        start = time.perf_counter()
        try:
            force = theory.pull(beam, grasp).to_deflection(deflection).force
            back = theory.pull(beam, grasp).to_force(force).deflection
        except BeyondLaw as failure:
            result.failures.append(f"{failure.reason}: {case}")
            continue
        finally:
            took = time.perf_counter() - start
            result.slowest = max(result.slowest, took)
            result.total += took
        if not (math.isfinite(force) and force * deflection > 0.0):
            result.failures.append(f"force {force}: {case}")
            continue
        result.solved += 1
        if abs(back / deflection - 1.0) < ROUND_TRIP:
            result.returned += 1
        else:
            result.failures.append(f"came back to {back:.6g}: {case}")
    return result


def main() -> None:
    """Sweep every theory and print the results."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    for name, theory in THEORIES.items():
        sweep(theory, 3)
        result = sweep(theory, count)
        kinds = Counter(failure.split(":")[0].split()[0] for failure in result.failures)
        print(
            f"{name}: {result.solved} of {count} solved, {result.returned} returned, "
            f"{1e6 * result.total / count / 2:.0f} us a solve with its set-up, slowest pair "
            f"{1e3 * result.slowest:.1f} ms, {dict(kinds)}"
        )
        for failure in result.failures[:10]:
            print("   ", failure)


if __name__ == "__main__":
    main()
