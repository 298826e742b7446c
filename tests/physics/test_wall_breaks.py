"""A duct that is pulled on is torn: no law lets its distance to break rise while it is stretched.

Random ducts are pulled at 1 kHz by a hook from rest in random directions, a Newton step a tick.
"""

import math

import numpy as np
import pytest

from physics import Beam, Exact, Exponential, Law, Linear, NeoHooke
from physics.bed import BeamOnBed, SpaceBeam
from physics.exact.fibre_laws import fibre_pull

# Of the span: a hook's motion in a tick. Part of the threshold that may be lost on the way.
STEP = 1.0 / 400.0
LAWS: list[tuple[Law, float, float]] = [
    (Linear(shear=True), 0.3, 1e-6),
    (NeoHooke(), 0.3, 1e-3),
    (NeoHooke(), 0.68, 1e-2),
    (NeoHooke(), 0.8, 1e-2),
    (Exponential(0.0), 0.8, 1e-3),
    (Exponential(4.0), 1.0, 1e-3),
    (Exponential(12.0), 3.0, 1e-3),
]
"""Laws, strengths in E, and what the share of the threshold may lose."""


def stretch_at(law: Law, strength: float, nu: float) -> float:
    """Stretch of a straight pull at a strength, in E."""
    low, high = 1.0, 100.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if isinstance(law, Linear):
            stress = middle - 1.0
        elif isinstance(law, Exponential):
            b = law.stiffening
            stress = math.expm1(b * (middle - 1.0)) / b if b else middle - 1.0
        else:
            g = 0.5 / (1.0 + nu)
            stress = fibre_pull(middle, 0.0, g, (1.0 - 2.0 * nu) * g, -1.0)
        low, high = (low, middle) if stress >= strength else (middle, high)
    return high


def random_duct(rng: np.random.Generator) -> tuple[Beam, float, np.ndarray]:
    """A duct of unit diameter, a hook a diameter or more from the clamps, a direction."""
    span, wall = rng.uniform(2.5, 15.0), rng.uniform(0.03, 0.45)
    beam = Beam.round(
        span=span,
        diameter=1.0,
        modulus=1.0,
        poisson_ratio=rng.uniform(0.2, 0.49),
        wall=None if rng.random() < 0.3 else wall,
    )
    near = max(0.1 * span, 1.0)
    direction = rng.normal(size=3)
    if rng.random() < 0.25:
        direction = np.array([0.0, 0.0, 1.0])
    return beam, rng.uniform(near, span - near), direction / np.sqrt(direction @ direction)


def torn_in_space(
    rest: SpaceBeam, at: float, direction: np.ndarray, threshold: float, farthest: float
) -> tuple[float, float]:
    """Return the chord over the span where it is torn, and how much of its share it lost before."""
    # From where neither side of the hook is shorter than at rest: one that is squeezed may buckle.
    held = BeamOnBed(rest)
    node = held.take(at)
    start = held.places[node].copy()
    seen = lost = chord = 0.0
    for tick in range(1, 100_000):
        held.lead(node, start + direction * (tick * STEP * rest.span))
        held.tick(1e-3)
        if tick % 4:
            continue
        places = held.places
        sides = np.sqrt(((places[[0, -1]] - places[node]) ** 2).sum(axis=1))
        chord = float(sides.sum()) / rest.span
        assert chord < farthest, "never torn"
        fraction = held.worst_stress().total / threshold
        if fraction >= 1.0:
            break
        if sides[0] >= at and sides[1] >= rest.span - at:
            lost, seen = max(lost, seen - fraction), max(seen, fraction)
    return chord, lost


@pytest.mark.slow
@pytest.mark.parametrize("count", [30, pytest.param(300, marks=pytest.mark.long)])
@pytest.mark.parametrize(("law", "strength", "may_lose"), LAWS)
def test_a_pull_in_space_tears_every_duct_before_it_is_stretched_as_far_as_a_straight_one(
    law: Law, strength: float, may_lose: float, count: int
) -> None:
    rng = np.random.default_rng(int(1000 * strength))
    for _ in range(count):
        beam, at, direction = random_duct(rng)
        rest = SpaceBeam.of(beam, law=law, elements=40)
        most = stretch_at(law, strength, beam.poisson_ratio)
        _, lost = torn_in_space(rest, at, direction, strength, most)
        assert lost <= may_lose


@pytest.mark.slow
@pytest.mark.parametrize("count", [10, pytest.param(300, marks=pytest.mark.long)])
@pytest.mark.parametrize(("law", "strength", "may_lose"), LAWS)
def test_a_pull_in_the_plane_tears_every_duct_too(
    law: Law, strength: float, may_lose: float, count: int
) -> None:
    rng = np.random.default_rng(int(1000 * strength) + 1)
    for _ in range(count):
        beam, at, _ = random_duct(rng)
        most = stretch_at(law, strength, beam.poisson_ratio)
        solver = Exact(law).pull(beam, at)
        event = solver.first_break(strength)
        assert event is not None
        d = event.deflection
        chord = math.hypot(at, d) + math.hypot(beam.span - at, d)
        assert chord < most * beam.span
        seen = 0.0
        solver.rest()
        for piece in np.linspace(0.05, 1.0, 20):
            pulled = solver.to_deflection(piece * d).sample(np.linspace(0.0, beam.span, 81))
            fraction = float(pulled.total_stress.max()) / strength
            assert fraction >= min(seen, 1.0) - may_lose
            seen = max(seen, fraction)
