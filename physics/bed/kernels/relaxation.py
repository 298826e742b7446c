"""Relaxation of strands and walls: Maxwell branches beside a spring, as a Prony series.

With u the elongation of a strand, k its stiffness at once and e_i = u - v_i the elongation of the
spring in branch i, whose dashpot has gone v_i, the force is

    f = (1 - d) k eps,   eps = (1 - sum g_i) u + sum g_i e_i,   e_i' = u' - e_i / tau_i.

Over a time t in which u goes in a straight line, E = exp(-r), r = t/tau,

    e_i -> E e_i + b (u_1 - u_0),   b = (1 - E)/r

exactly, and stably for any t. So eps = K u - c with K = 1 + sum g_i (b_i - 1), the same for all,
and c = sum g_i (b_i u_0 - E_i e_i): within a step a strand is a spring, whose law and damage are
those of eps. A strand that would be pushed is slack, eps = 0, and then as long as its branches
have it, u = c/K. In that time they take

    sum (1 - d) k g_i (e_0 + e_1)/2 (u_1 - u_0 - e_1 + e_0)

more than they store, (1 - d) k g_i e_i^2 / 2 each: what is dissipated by viscosity.

Of an element's section the stress resultants relax alike, F = (1 - sum g_i) F_e + sum g_i h_i with
h_i' = F_e' - h_i/tau_i (quasi-linear viscoelasticity [Fung 1981]); F_e follows from the strains by
the wall's law, linear or not. A branch stores h_i^2 / (2 C), C the stiffness at small strains.

E and b are made of + - * / alone: the series of (1 - exp(-q))/q to q^9 for q = r/2^n below 1/8,
then n doublings b -> b (1 + E)/2, E -> E^2; their error is below 1e-14.
"""

from kernel_cache import kernel
from physics.bed.kernels.state import (
    BEAM,
    PACE,
    PENDING,
    PUSHED,
    SETTLED,
    STIFF,
    STRANDS,
    VISCOUS,
    WALL_PACE,
    State,
)
from physics.bed.kernels.vectors import Floats, inner, outer

# Columns of `branch`: fraction, time, s; E and b of the time that goes by, and that time, s.
FRACTION, TIME, KEPT, RATE, STEP = range(5)
# Rows of `memory`: c of this step, eps = K u - c; u at the last assembly, and when the step began;
# room for two energies; the springs of the branches.
LESS, NOW, BEFORE, UNIT, GONE, SPRING = range(6)
# Rows of `wall_memory`, six strains of an element after those of the one before: what is taken off
# the resultants in this step; strains and F_e at the last assembly, and when the step began; the
# energy of F_e for each mm, an element each; room for two energies; the branches' h.
WALL_LESS, STRAIN, FORCE, STRAIN_BEFORE, FORCE_BEFORE, ENERGY, WALL_UNIT, WALL_GONE, OVER = range(9)


@inner
def decay(r: float) -> tuple[float, float]:
    """Return exp(-r) and (1 - exp(-r))/r for r of 0 or more; to 1e-14 of 1."""
    if r > 700.0:
        return 0.0, 1.0 / r
    halved, doublings = r, 0
    while halved > 0.125:
        halved *= 0.5
        doublings += 1
    rate = 1.0
    for n in range(10, 1, -1):
        rate = 1.0 - halved / n * rate
    kept = 1.0 - halved * rate
    for _ in range(doublings):
        rate *= 0.5 * (1.0 + kept)
        kept *= kept
    return kept, rate


@inner
def unrelaxed(branch: Floats) -> float:
    """Return the part of the stiffness that does not relax."""
    rest = 1.0
    for m in range(branch.shape[0]):
        rest -= branch[m, FRACTION]
    return rest


@inner
def total(values: Floats) -> float:
    """Return the sum, by four sums at once: each addition waits for the one before."""
    a = b = c = d = 0.0
    fours = values.size - values.size % 4
    for i in range(0, fours, 4):
        a, b, c, d = a + values[i], b + values[i + 1], c + values[i + 2], d + values[i + 3]
    for i in range(fours, values.size):
        a += values[i]
    return (a + b) + (c + d)


@inner
def remember_strands(
    memory: Floats, branch: Floats, damage: Floats, stiff: Floats
) -> tuple[float, float]:
    """Return what strands store, and what viscosity has dissipated of them in the step."""
    # Loops without conditions, which the compiler takes several at once; then the sums.
    now, before, unit, gone = memory[NOW], memory[BEFORE], memory[UNIT], memory[GONE]
    rest = unrelaxed(branch)
    for i in range(now.size):
        unit[i], gone[i] = rest * now[i] * now[i], 0.0
    for m in range(branch.shape[0]):
        spring, fraction = memory[SPRING + m], branch[m, FRACTION]
        kept, rate = branch[m, KEPT], branch[m, RATE]
        for i in range(now.size):
            far, old = now[i] - before[i], spring[i]
            new = kept * old + rate * far
            unit[i] += fraction * new * new
            gone[i] += fraction * (old + new) * (far - new + old)
    for i in range(now.size):
        k = 0.5 * (1.0 - damage[i]) * stiff[i]
        unit[i] *= k
        gone[i] *= k
    return total(unit), total(gone)


@inner
def remember_walls(wall: Floats, branch: Floats, h: Floats, stiff: Floats) -> tuple[float, float]:
    """Return what walls store, and what viscosity has dissipated of them in the step."""
    unit, gone = wall[WALL_UNIT], wall[WALL_GONE]
    force, force_before = wall[FORCE], wall[FORCE_BEFORE]
    strain, strain_before = wall[STRAIN], wall[STRAIN_BEFORE]
    stiffness = stiff.reshape(-1)
    for i in range(unit.size):
        unit[i] = gone[i] = 0.0
    for m in range(branch.shape[0]):
        over, half = wall[OVER + m], 0.5 * branch[m, FRACTION]
        kept, rate = branch[m, KEPT], branch[m, RATE]
        for i in range(unit.size):
            old, soft = over[i], 1.0 / stiffness[i]
            new = kept * old + rate * (force[i] - force_before[i])
            unit[i] += half * new * new * soft
            gone[i] += half * (old + new) * (strain[i] - strain_before[i] - (new - old) * soft)
    rest, stored, dissipated = unrelaxed(branch), 0.0, 0.0
    for e in range(h.size):
        if stiff[e, 0] != 0.0:  # a torn element has neither
            kept, lost = rest * wall[ENERGY, e], 0.0
            for i in range(6 * e, 6 * e + 6):
                kept += unit[i]
                lost += gone[i]
            stored += h[e] * kept
            dissipated += h[e] * lost
    return stored, dissipated


@kernel(error_model="numpy", nogil=True, forceinline=True)
def remember(s: State) -> None:
    """Write what relaxing strands and walls store, and what viscosity has dissipated in the step.

    They take the place of the energies that the last assembly has written.
    """
    if s.memory.shape[1]:
        stored, gone = remember_strands(s.memory, s.branch[0], s.damage, s.strand[STIFF])
        s.sums[STRANDS] = stored + s.sums[PUSHED]
        s.sums[PENDING] += gone  # beside that of strands that have yielded now
    if s.wall_memory.shape[1]:
        s.sums[BEAM], gone = remember_walls(s.wall_memory, s.branch[1], s.h, s.stiff)
        s.sums[PENDING] += gone


@inner
def strand_branches(s: State, i: int, now: float) -> tuple[float, float]:
    """Return what strand i stores at an elongation, over k/2, and what its branches dissipate."""
    far = now - s.memory[BEFORE, i]
    unit, gone = now * now, 0.0
    for m in range(s.branch.shape[1]):
        old = s.memory[SPRING + m, i]
        new = s.branch[0, m, KEPT] * old + s.branch[0, m, RATE] * far
        unit += s.branch[0, m, FRACTION] * (new * new - now * now)
        gone += s.branch[0, m, FRACTION] * (old + new) * (far - new + old)
    return unit, gone


@inner
def next_step(
    memory: Floats, branch: Floats, seconds: float, rows: tuple[int, int, int], ends: bool
) -> float:
    """End a step in the rows of a memory, if one `ends`, and begin one of `seconds`; return K."""
    # `rows`: now, the step's beginning, the first branch.
    pace, first = 1.0, 0.0
    less, at, before = memory[0], memory[rows[0]], memory[rows[1]]
    for i in range(less.size):
        less[i] = 0.0
    for m in range(branch.shape[0]):
        row = memory[rows[2] + m]
        kept, rate = branch[m, KEPT], branch[m, RATE]
        if not ends:
            kept, rate = 1.0, 0.0
        if branch[m, STEP] != seconds:
            branch[m, KEPT], branch[m, RATE] = decay(seconds / branch[m, TIME])
            branch[m, STEP] = seconds
        pace += branch[m, FRACTION] * (branch[m, RATE] - 1.0)
        first += branch[m, FRACTION] * branch[m, RATE]
        fading = branch[m, FRACTION] * branch[m, KEPT]
        for i in range(less.size):
            row[i] = kept * row[i] + rate * (at[i] - before[i])
            less[i] -= fading * row[i]
    if ends:
        for i in range(less.size):
            before[i] = at[i]
    for i in range(less.size):
        less[i] += first * before[i]
    return pace


@inner
def begin_step(
    memory: Floats, wall: Floats, branch: Floats, sums: Floats, seconds: float, ends: bool
) -> None:
    """Begin a step of so many seconds, after ending the one before if it `ends`."""
    rows = (int(NOW), int(BEFORE), int(SPRING))
    sums[PACE] = next_step(memory, branch[0], seconds, rows, ends)
    rows = (int(FORCE), int(FORCE_BEFORE), int(OVER))
    sums[WALL_PACE] = next_step(wall, branch[1], seconds, rows, ends)
    if ends:
        for i in range(wall.shape[1]):
            wall[STRAIN_BEFORE, i] = wall[STRAIN, i]
        sums[SETTLED], sums[PENDING] = sums[VISCOUS], 0.0


@kernel(error_model="numpy", nogil=True, forceinline=True)
def settle(s: State, seconds: float) -> None:
    """End a step of time where all is, after its assembly, and begin one of so many seconds."""
    # Of 0 s: the strands and walls that there are at once.
    begin_step(s.memory, s.wall_memory, s.branch, s.sums, seconds, True)


@outer
def begin(s: State, seconds: float) -> None:
    """Begin a step of so many seconds where the last one ended; or begin it anew."""
    begin_step(s.memory, s.wall_memory, s.branch, s.sums, seconds, False)
