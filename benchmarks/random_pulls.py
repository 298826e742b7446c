"""Random pulls of beams off random beds, by hooks and rods: none may be lost or not finite.

``python -m benchmarks.random_pulls 9000 1000`` plays so many in real time and so many through
equilibria, from seed 0 on, on all cores; a third number is the first seed. It says how far it is
every 20 s, each pull that is lost at once, and at the end the seeds with the worst energy balance.
"""

import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context

import numpy as np

from app.workers import cores
from benchmarks.duct import DUCT
from physics.bed import BeamOnBed, Bed, End, Hand, Rod, SpaceBeam, pull

Point = tuple[float, float, float]
ENDS: tuple[tuple[End, End], ...] = (
    ("clamped", "clamped"),
    ("clamped", "free"),
    ("pinned", "roller"),
    ("clamped", "sliding"),
)
TICKS = 300
ROUNDING = 1e-9
"""Energies below it, mJ, are rounding."""
OPEN = 1e-4
"""Part of the work that the energy balance may leave unexplained."""
# Seconds between two lines of progress.
EVERY = 20.0


def bed(random: np.random.Generator, strands: int) -> Bed:
    """Return a bed of any stiffness, toughness, scatter and direction of its strands."""
    bilateral = bool(random.random() < 0.2)
    return Bed(
        strands=int(random.integers(1, strands)),
        stiffness=float(10 ** random.uniform(-2.0, 0.5)),
        toughness=float(10 ** random.uniform(-2.0, 0.0)),
        softening=float(random.choice([1.0, 1.02, 1.5, 8.0 / 3.0, 5.0])),
        floor=float(random.choice([0.0, 0.3, 3.0])),
        around=float(random.uniform(0.0, 2.0)),
        fan=float(random.uniform(0.0, 0.8)),
        slack=0.0 if bilateral else float(random.uniform(0.0, 2.0)),
        scatter=float(random.uniform(0.0, 0.8)),
        jitter=float(random.uniform(0.0, 1.0)),
        bilateral=bilateral,
        seed=int(random.integers(1_000_000)),
    )


def points(random: np.random.Generator, count: int) -> tuple[Point, ...]:
    """Return places of a hook, mm: along, across, up and down."""
    low, high = (-10.0, -12.0, -5.0), (10.0, 12.0, 16.0)
    return tuple(tuple(map(float, random.uniform(low, high))) for _ in range(count))  # type: ignore[misc]


def sweep(random: np.random.Generator) -> tuple[Point, ...]:
    """Return places of a rod's tip, which comes in beside the duct and moves among its strands."""
    x, z = random.uniform(8.0, 42.0), random.uniform(-8.0, -5.0)
    return (
        (float(x), 14.0, float(z)),
        (float(x), float(random.uniform(-12.0, 0.0)), float(z)),
        (float(x + random.uniform(-12.0, 12.0)), float(random.uniform(-12.0, 0.0)), float(z)),
    )


def grasps(random: np.random.Generator, least: int) -> list[float]:
    """Return up to two places that are not on top of one another, mm."""
    at = sorted(float(s) for s in random.uniform(4.0, 46.0, size=int(random.integers(least, 3))))
    return at[:1] if len(at) == 2 and at[1] - at[0] < 6.0 else at


def pulled_through_equilibria(seed: int, *, rods: bool = True) -> float:
    """Play a pull; return the part of the work that its energy balance leaves unexplained."""
    random = np.random.default_rng(seed)
    ends = ENDS[int(random.choice(4, p=[0.7, 0.1, 0.1, 0.1]))]
    rod = rods and random.random() < 0.3
    at = grasps(random, 0 if rod else 1)
    hands = [
        Hand(
            at=each,
            path=points(random, 1 + int(random.integers(2))),
            steps=int(random.integers(2, 6)),
            from_step=int(random.integers(2)),
            until_step=int(random.integers(2, 8)) if random.random() < 0.3 else None,
        )
        for each in at
    ]
    swept = [
        Rod(
            path=sweep(random),
            shaft=(float(random.uniform(-0.4, 0.4)), 1.0, float(random.uniform(-0.3, 0.3))),
            radius=float(random.uniform(0.3, 2.0)),
            steps=int(random.integers(2, 8)),
        )
        for _ in range(int(rod))
    ]
    beam = SpaceBeam.of(DUCT, elements=int(random.integers(8, 24)), ends=ends, nodes_at=at)
    history = pull(beam, bed(random, 80), hands, rods=swept)
    if not (np.isfinite(history.shape).all() and np.isfinite(history.work).all()):
        raise ArithmeticError("a place or an energy is not finite")
    return history.residual_ratio


def pulled_in_real_time(seed: int) -> float:
    """Play `TICKS` of 1/1000 s, with a tear in every fifth pull; the part of work unexplained."""
    random = np.random.default_rng(seed)
    ends = ENDS[int(random.choice(4, p=[0.7, 0.1, 0.1, 0.1]))]
    beam = SpaceBeam.of(DUCT, elements=int(random.integers(8, 41)), ends=ends)
    layer = bed(random, 600)
    live = BeamOnBed(
        beam, layer.strands_under(beam), floor=layer.floor_under(beam), rods=1, retrace=True
    )
    hooks = {
        live.take(at, stiffness=float(random.choice([np.inf, 1.0, 5.0]))): points(random, 1)[0]
        for at in grasps(random, 0)
    }
    starts = {node: live.places[node].copy() for node in hooks}
    tips = np.array(sweep(random))
    live.set_rod(0, tips[0], (float(random.uniform(-0.4, 0.4)), 1.0, 0.0), 1.2)
    tear, let_go = int(random.integers(5 * TICKS)), int(random.integers(3 * TICKS))
    for step in range(1, TICKS + 1):
        piece = step / TICKS
        for node, displacement in hooks.items():
            live.lead(node, starts[node] + piece * np.array(displacement))
        a, b, along = (*tips[:2], 2.0 * piece) if piece < 0.5 else (*tips[1:], 2.0 * piece - 1.0)
        live.lead_rod(0, a + along * (b - a))
        if step == tear:
            live.tear(float(random.uniform(0.0, beam.span)))
        if step == let_go and hooks:
            live.let_go(hooks.popitem()[0])
        live.tick(1e-3)
    if not (np.isfinite(live.places).all() and np.isfinite(live.energy.stored)):
        raise ArithmeticError("a place or an energy is not finite")
    far = float(np.abs(live.places).max())
    if far > 10.0 * beam.span:
        raise ArithmeticError(f"a node is {far:g} mm away")
    energy = live.energy
    gross = abs(energy.work) + energy.stored + energy.dissipated + abs(energy.snap)
    gross += abs(energy.lag)
    return abs(energy.residual) / gross if gross > ROUNDING else 0.0


def played(work: tuple[str, int]) -> tuple[float, str]:
    """Play a pull of one kind by its seed; return its unexplained share and what it was lost by."""
    name, seed = work
    try:
        return PLAYS[name](seed), ""
    except (ArithmeticError, ValueError, RuntimeError) as error:
        return np.inf, str(error)


PLAYS = {"real time": pulled_in_real_time, "equilibria": pulled_through_equilibria}


def main() -> None:
    """Play as many as asked for on all cores; say how it goes, what was lost, the worst seeds."""
    words = [int(word) for word in sys.argv[1:]]
    ticked, balanced, first = words + [9000, 1000, 0][len(words) :]
    with ProcessPoolExecutor(cores(), get_context("spawn")) as pool:
        for name, count in zip(PLAYS, (ticked, balanced), strict=True):
            began = reported = time.monotonic()
            fractions: dict[int, float] = {}
            lost = 0
            seeds = range(first, first + count)
            # In the order in which they end: one slow pull holds up no line.
            plays = {pool.submit(played, (name, seed)): seed for seed in seeds}
            for play in as_completed(plays):
                seed = plays.pop(play)
                fractions[seed], why = play.result()
                if why:
                    lost += 1
                    print(f"{name}, seed {seed}: lost: {why}", flush=True)
                now = time.monotonic()
                if now - reported > EVERY or not plays:
                    reported = now
                    print(summary(name, fractions, lost, now - began), flush=True)
            worst = sorted(fractions, key=lambda seed: -fractions[seed])[:5]
            if worst:
                worst_seeds = ", ".join(f"{seed} ({fractions[seed]:.1e})" for seed in worst)
                print(f"{name}: the most unexplained energy in seeds {worst_seeds}", flush=True)


def summary(name: str, fractions: dict[int, float], lost: int, seconds: float) -> str:
    """Return a line about the pulls so far."""
    kept = np.array([fraction for fraction in fractions.values() if np.isfinite(fraction)])
    energy = ""
    if kept.size:
        energy = (
            f"; unexplained energy at the median {np.median(kept):.1e}, at 99 % "
            f"{np.percentile(kept, 99):.1e} of the work, above {OPEN:g} in {(kept > OPEN).sum()}"
        )
    rate = len(fractions) / seconds
    return f"{name}: {len(fractions):,} pulls, {lost} lost, {rate:.3g} a second{energy}"


if __name__ == "__main__":
    main()
