"""Steps through equilibria, and the energy balance that accepts them or asks for shorter ones.

A step towards the hands' targets is divided into substeps whose energy is accounted for:

    W = sum (f_0 + f_1)/2 . dx      trapezoidal rule, over all hands on the beam and on rods
    W - (U_1 - U_0) - D             missing: U stored energy, D dissipated by the strands' law
    sum |f_1 - f_0| |dx| / 2        what W is unsure by, if a force jumped in between

A substep is accepted if what is missing is within `OPEN` of its work, or if a jump of the force
could change no more than `OPEN` / 100 of all work so far: what is missing was then released in a
jump (`snap`). Otherwise it is repeated at `SHORTER` of its length, and at half where no equilibrium
was found, down to `SHORTEST` of the step.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from physics.bed import kernels
from physics.equilibrium import NoEquilibrium

Floats = NDArray[np.float64]

# How often strands may slip off rods in one substep, each time with another equilibrium.
MOST_SLIPS = 50
# Largest force out of balance over the largest in the beam; part of the work that may stay
# unexplained.
TOLERANCE, OPEN = 1e-9, 1e-5
# Factors of a substep whose energy does not balance, and of one after an eighth of that error.
SHORTER, LONGER = 0.2, 3.0
SHORTEST = 0.5**24
# Longest substep over the shortest time in which something relaxes, or over the time gone by.
LONGEST_STEP = 0.125
# Rounding over E I / span^2, a force that bends the beam, from which on searches may fail.
TOO_STIFF = 1e-4


class _Forces(NamedTuple):
    """Forces of hands on what they hold, push and sweep, where these are, and stored energy."""

    holds: Floats
    loads: Floats
    pulls: Floats
    goals: Floats
    places: Floats
    tips: Floats
    stored: float
    viscous: float

    @classmethod
    def of(cls, s: kernels.State) -> "_Forces":
        """Return those of the present state, with damage fixed."""
        kernels.assemble(s, kernels.FROZEN, 0.0)
        kernels.remember(s)
        stored = s.sums[kernels.BEAM] + s.sums[kernels.STRANDS] + s.sums[kernels.CONTACT]
        bits = (s.held[:, None] >> np.arange(3)) & 1
        holds = np.where(bits, s.g[:, :3], s.spring * (s.goal - s.x))
        return cls(
            holds,
            s.load.copy(),
            s.pull.copy(),
            s.goal.copy(),
            s.x.copy(),
            s.rods[:, :3].copy(),
            float(stored),
            float(s.sums[kernels.SETTLED] + s.sums[kernels.PENDING]),
        )


class _Spent(NamedTuple):
    """What a substep's strands did, mJ: dissipated, taken from rods' tips, released by slipping."""

    lost: float
    entered: float
    slipped: float


class EnergyAudit:
    """The energy of substeps, one after the other, and the verdict on each.

    Parameters
    ----------
    s
        The state, at an equilibrium.
    gross
        Sizes of all works so far, mJ.
    noise
        Error of forces, N: they are known only to the tolerance of the equilibrium.
    """

    def __init__(self, s: kernels.State, gross: float, noise: float) -> None:
        self._s, self.gross, self._noise = s, gross, noise
        # Of energies of fibres, which are differences of numbers near 1 E A: their rounding, mJ.
        self._grain = 4e-16 * float((s.wall[:, kernels.STRENGTH] * s.h[: len(s.wall)]).sum())
        self._before = _Forces.of(s)

    def judge(self, spent: _Spent, *, shortest: bool) -> float:
        """Account for a substep; return the next one's factor, below 1 where this is refused."""
        before, after = self._before, _Forces.of(self._s)
        # The trapezoidal rule and its uncertainty, if the forces jumped in between.
        moved = (
            after.goals - before.goals,
            after.places - before.places,
            after.tips - before.tips,
        )
        sides = (
            (before.holds, after.holds, moved[0]),
            (before.loads, after.loads, moved[1]),
            (before.pulls, after.pulls, moved[2]),
        )
        each = [0.5 * (a + b) * w for a, b, w in sides]
        work = sum(float(term.sum()) for term in each) + spent.entered
        gross = spent.entered + sum(float(np.abs(term).sum()) for term in each)
        unsure = sum(0.5 * float(np.abs((b - a) * w).sum()) for a, b, w in sides)
        missing = work - (after.stored - before.stored) - spent.lost - spent.slipped
        missing -= after.viscous - before.viscous
        total = self.gross + gross
        # Noise of forces works where hands lead: free nodes stay where they balance.
        led = (moved[0], moved[1][after.loads != 0.0], moved[2])
        far_each = sum(float(np.abs(w).sum()) for w in led)
        least = 0.01 * OPEN * OPEN * total + self._noise * far_each + 1e-14 * after.stored
        least += self._grain
        close = abs(missing) <= OPEN * gross + least
        # A jump releases energy. Where some came from nowhere, another equilibrium than the one
        # that the beam would have moved to was found.
        sure = unsure <= 0.01 * OPEN * total + self._noise * far_each
        jump = sure and missing > -OPEN * total
        if not (close or jump or shortest):
            return SHORTER
        self._before, self.gross = after, total
        sums = self._s.sums
        sums[kernels.WORK] += work
        sums[kernels.ROD_WORK] += float(each[2].sum()) + spent.entered
        sums[kernels.STORED], sums[kernels.VISCOUS] = after.stored, after.viscous
        sums[kernels.DISSIPATED] += spent.lost
        sums[kernels.SNAP] += spent.slipped + (missing if not close and missing > 0.0 else 0.0)
        self._s.react[:] = after.holds
        return LONGER if abs(missing) <= 0.125 * OPEN * gross + least else 1.0


def advance(
    s: kernels.State, *, gross: float, span: float, far: float, rounding: float, seconds: float
) -> float:
    """Advance to the hands' targets through equilibria.

    Parameters
    ----------
    s
        The state, accounted for up to now.
    gross
        Sizes of all works so far, mJ.
    span
        The beam's length, mm.
    far
        Distance from the origin, mm, beyond which nothing holds the beam any more.
    rounding
        Error of forces from places rounded to their last digit, N.
    seconds
        Time that the step takes, of all substeps alike.

    Returns
    -------
    float
        `gross` with this step's work.

    Raises
    ------
    NoEquilibrium
        If there is none near the last one.
    """
    s.goal_from[:], s.load_from[:], s.rods_from[:] = s.goal, s.load, s.rods
    relaxes = s.branch.shape[1] > 0
    quickest = float(s.branch[..., kernels.TIME].min(initial=np.inf))
    if relaxes:
        kernels.settle(s, 0.0)
    audit = EnergyAudit(s, gross, 2.0 * rounding)
    done, size, largest = 0.0, 1.0, 1.0
    # A rod goes no farther at once than half its radius, lest it should jump over a strand.
    farthest = 0.0
    for a, b in zip(s.rods_from, s.rods_to, strict=True):
        if b[kernels.IN_USE]:
            distance = float(np.sqrt(((b[:3] - a[:3]) ** 2).sum()))
            farthest = max(farthest, distance)
            if distance > 0.0:
                largest = min(largest, 0.5 * b[kernels.RADIUS] / distance)
    while done < 1.0:
        size = min(size, largest, 1.0 - done)
        if size * farthest > s.sums[kernels.CLEAR]:  # nor past the beam
            _set_goals(s, done)
            s.rods_step[:] = s.rods_to[:, :3] - s.rods[:, :3]
            clear = kernels.rods_clear_of(s, size / (1.0 - done)) * (1.0 - done)
            if clear < SHORTEST:
                raise NoEquilibrium("a rod would have to pass through the beam to go on")
            size = min(size, clear)
        if relaxes:
            brief = LONGEST_STEP * max(quickest, done * seconds)
            if size * seconds > brief:
                size = brief / seconds
            kernels.begin(s, size * seconds)
        back = tuple(each.copy() for each in (s.x, s.q, s.damage, s.side, s.sums))
        _set_goals(s, done + size)
        spent = _settle(s, rounding)
        if spent is None:
            s.x[:], s.q[:], s.damage[:], s.side[:], s.sums[:] = back
            if size > SHORTEST:
                size *= 0.5
                continue
            _set_goals(s, done)
            if relaxes:
                kernels.begin(s, 0.0)
            kernels.assemble(s, kernels.FROZEN, 0.0)
            raise NoEquilibrium(
                "no equilibrium was found near the last one, however small the "
                f"step{_doubt(s, span, rounding)}"
            )
        factor = audit.judge(spent, shortest=size <= SHORTEST)
        if factor < 1.0:
            s.x[:], s.q[:], s.damage[:], s.side[:], s.sums[:] = back
        else:
            done += size
            if relaxes:
                kernels.settle(s, 0.0)
            if np.abs(s.x).max() > far:
                raise NoEquilibrium("the forces carry the beam away: nothing holds it any more")
        size *= factor
    s.moved[:] = 0.0
    s.goal_from[:], s.rods_from[:], s.pull_before[:] = s.goal, s.rods, s.pull
    return audit.gross


def _doubt(s: kernels.State, span: float, rounding: float) -> str:
    """Return why there may be no equilibrium, in words."""
    lost = rounding / (float(s.stiff[:, 4:].max()) / span**2)
    if lost > TOO_STIFF:
        enough = float(s.stiff[:, :3].max()) * TOO_STIFF / lost
        return (
            f": the beam is so stiff that forces below {rounding:.1g} N are "
            f"rounding; {enough:.1g} N along it and in shear are as good as rigid"
        )
    return ": does anything hold the beam against its force?" if s.load_to.any() else ""


def _set_goals(s: kernels.State, fraction: float) -> None:
    """Interpolate goals, dead forces and rods towards their targets."""
    s.goal[:] = s.goal_from + fraction * (s.goal_to - s.goal_from)
    s.load[:] = s.load_from + fraction * (s.load_to - s.load_from)
    s.rods[:, :3] = s.rods_from[:, :3] + fraction * (s.rods_to[:, :3] - s.rods_from[:, :3])


def _settle(s: kernels.State, rounding: float) -> _Spent | None:
    """Find equilibrium and damage at the goals, None if lost."""
    lost = 0.0
    entered, slipped = _meet(s, first=True)
    for _ in range(MOST_SLIPS):
        more = _balanced(s, rounding)
        if more is None:
            return None
        lost += more
        put, released = _meet(s, first=False)
        if put == released == 0.0:
            return _Spent(lost, entered, slipped)
        entered, slipped = entered + put, slipped + released
    return None


def _meet(s: kernels.State, *, first: bool) -> tuple[float, float]:
    """Let strands meet rods or slip off; return the energies put in and released, mJ."""
    if not s.rods[:, kernels.IN_USE].any():
        return 0.0, 0.0
    before = kernels.assemble(s, kernels.INCREMENTAL, 0.0)
    if kernels.update_rod_contacts(s, first) == 0:
        return 0.0, 0.0
    change = kernels.assemble(s, kernels.INCREMENTAL, 0.0) - before
    return max(change, 0.0), max(-change, 0.0)


def _balanced(s: kernels.State, rounding: float) -> float | None:
    """Find equilibrium and damage with strands on rods as they are; the energy dissipated."""
    # The tangent of strands that end near a rod is not exact: the last digits come slowly.
    floor = rounding + (1e-9 if s.rods[:, kernels.IN_USE].any() else 0.0)
    if kernels.equilibrium(s, kernels.INCREMENTAL, TOLERANCE, floor, 2000) >= 0:
        return kernels.yielded(s)
    # Slower and more robust: equilibrium under fixed damage, then damage by its law, in turn.
    lost = 0.0
    for _ in range(4000):
        if kernels.equilibrium(s, kernels.FROZEN, TOLERANCE, floor, 2000) < 0:
            return None
        more = kernels.yielded(s)
        lost += more
        if more <= 1e-12 * lost:
            return lost
    return None
