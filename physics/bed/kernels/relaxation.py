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

from kernel_cache import njit
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
from physics.bed.kernels.vectors import Floats, inner

# Columns of `branch`: fraction, time, s; E and b of the time that goes by.
FRACTION, TIME, KEPT, RATE = range(4)
# Rows of `memory`: c of this step, eps = K u - c; u at the last assembly, and when the step began;
# room for two energies; the springs of the branches.
LESS, NOW, BEFORE, UNIT, GONE, SPRING = range(6)
# Rows of `wall_memory`, six strains of an element after those of the one before: what is taken off
# the resultants in this step; strains and F_e at the last assembly, and when the step began; the
# energy of F_e for each mm, an element each; the branches' h.
WALL_LESS, STRAIN, FORCE, STRAIN_BEFORE, FORCE_BEFORE, ENERGY, OVER = range(7)


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
def remember(s: State) -> None:
    """Write what relaxing strands and walls store, and what viscosity has dissipated in the step.

    They take the place of the energies that the last assembly has written.
    """
    pending = s.sums[PENDING]  # of strands that have yielded now
    if s.memory.shape[1]:
        # Loops without branches, which the compiler takes several at once; then the sums.
        branch, now, before = s.branch[0], s.memory[NOW], s.memory[BEFORE]
        unit, gone, rest = s.memory[UNIT], s.memory[GONE], unrelaxed(branch)
        for i in range(now.size):
            unit[i], gone[i] = rest * now[i] * now[i], 0.0
        for m in range(branch.shape[0]):
            spring, fraction = s.memory[SPRING + m], branch[m, FRACTION]
            kept, rate = branch[m, KEPT], branch[m, RATE]
            for i in range(now.size):
                far, old = now[i] - before[i], spring[i]
                new = kept * old + rate * far
                unit[i] += fraction * new * new
                gone[i] += fraction * (old + new) * (far - new + old)
        stored = 0.0
        for i in range(now.size):
            k = 0.5 * (1.0 - s.damage[i]) * s.strand[STIFF, i]
            stored += k * unit[i]
            pending += k * gone[i]
        s.sums[STRANDS] = stored + s.sums[PUSHED]
    if s.wall_memory.shape[1]:
        branch, wall = s.branch[1], s.wall_memory
        rest, stored = unrelaxed(branch), 0.0
        for e in range(s.h.size):
            if s.stiff[e, 0] == 0.0:
                continue
            unit, gone = rest * wall[ENERGY, e], 0.0
            for r in range(6):
                i, soft = 6 * e + r, 1.0 / s.stiff[e, r]
                force, far = wall[FORCE, i] - wall[FORCE_BEFORE, i], wall[STRAIN, i]
                far -= wall[STRAIN_BEFORE, i]
                for m in range(branch.shape[0]):
                    old = wall[OVER + m, i]
                    new = branch[m, KEPT] * old + branch[m, RATE] * force
                    unit += 0.5 * branch[m, FRACTION] * new * new * soft
                    gone += 0.5 * branch[m, FRACTION] * (old + new) * (far - (new - old) * soft)
            stored += s.h[e] * unit
            pending += s.h[e] * gone
        s.sums[BEAM] = stored
    s.sums[PENDING] = pending


@njit(cache=True, error_model="numpy", nogil=True)
def recall(s: State) -> None:
    """Do what `remember` does, for callers that are not compiled."""
    remember(s)


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
def follow(memory: Floats, branch: Floats, now: int, before: int, spring: int) -> None:
    """End a step of time in the rows of a memory."""
    for m in range(branch.shape[0]):
        kept, rate = branch[m, KEPT], branch[m, RATE]
        for i in range(memory.shape[1]):
            new = kept * memory[spring + m, i] + rate * (memory[now, i] - memory[before, i])
            memory[spring + m, i] = new
    for i in range(memory.shape[1]):
        memory[before, i] = memory[now, i]


@inner
def prepare(memory: Floats, branch: Floats, seconds: float, before: int, spring: int) -> float:
    """Begin a step in the rows of a memory, where the first is what is taken off; return K."""
    pace, first = 1.0, 0.0
    for m in range(branch.shape[0]):
        branch[m, KEPT], branch[m, RATE] = decay(seconds / branch[m, TIME])
        pace += branch[m, FRACTION] * (branch[m, RATE] - 1.0)
        first += branch[m, FRACTION] * branch[m, RATE]
    for i in range(memory.shape[1]):
        memory[0, i] = first * memory[before, i]
    for m in range(branch.shape[0]):
        fading = branch[m, FRACTION] * branch[m, KEPT]
        for i in range(memory.shape[1]):
            memory[0, i] -= fading * memory[spring + m, i]
    return pace


@njit(cache=True, error_model="numpy", nogil=True)
def settle(s: State, seconds: float) -> None:
    """End a step of time where all is, after its assembly, and begin one of so many seconds."""
    # Of 0 s: the strands and walls that there are at once.
    follow(s.memory, s.branch[0], int(NOW), int(BEFORE), int(SPRING))
    follow(s.wall_memory, s.branch[1], int(FORCE), int(FORCE_BEFORE), int(OVER))
    for i in range(s.wall_memory.shape[1]):
        s.wall_memory[STRAIN_BEFORE, i] = s.wall_memory[STRAIN, i]
    s.sums[SETTLED], s.sums[PENDING] = s.sums[VISCOUS], 0.0
    begin(s, seconds)


@njit(cache=True, error_model="numpy", nogil=True)
def begin(s: State, seconds: float) -> None:
    """Begin a step of so many seconds where the last one ended; or begin it anew."""
    s.sums[PACE] = prepare(s.memory, s.branch[0], seconds, int(BEFORE), int(SPRING))
    s.sums[WALL_PACE] = prepare(s.wall_memory, s.branch[1], seconds, int(FORCE_BEFORE), int(OVER))
