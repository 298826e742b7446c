"""Exact beams by the thousand: where each breaks, and what it bears.

Each is solved in compiled code, from rest, so that no result depends on the one before. Those of
constant section are set up there, too; one whose sections vary is set up by `ExactPull`, for as
many thresholds and loads as there are. The search for a break works on s(d), the highest stress at
a deflection d, and closes in by regula falsi in the Illinois form. By the linear law without shear
s grows with d, and the search starts where the cubic beam would break. Laws with shear soften: the
stress at a clamp may fall again while that elsewhere grows. There the beam is pulled up in steps,
and where s falls its top between them is looked for by golden sections, so that what is found is
the first deflection at which the threshold is reached. All is without units, as `symbols` has it.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from physics.exact import newton, sampling
from physics.exact.fibre_laws import FibreLaw, fibre_pull, shrinkage
from physics.exact.linear_law import Linear
from physics.exact.mesh import LAYER, steepness
from physics.exact.points import fill_points
from physics.exact.state import KERNEL, Array, State, new_state
from physics.exact.symbols import *
from physics.section import Ring

# Rows of the ducts, a column each: I/(A S^2), c/S, grasp/S; threshold over E (nan: none); load,
# F/(E A) or d/S (nan: none); 1/(G A_s) in 1/(E A), or nu, a of `lateral_constant`, y/S and
# weight of the outer fibres, and the deficit in shear.
MOMENT_2, REACH_OUT, GRASP, LIMIT, LOAD, SHEAR_FLEX, NU, LATERAL, FIBRE, FIBRE_WEIGHT, LACK = range(
    11
)
DUCT_ROWS = 11
# Rows of the solved: at the break and under the load F/(E A), d/S, station/S, normal and total
# stress over E; nan where there is none.
BREAK, LOADED, SOLVED_ROWS = 0, 5, 10

# Rows of the sections at stations: mean area over area, c/S, I/(A S^2), centroid's offset over S.
OVER_AREA, OUTER, SECOND_MOMENT, OFF_AXIS, SECTION_ROWS = range(5)

# Stations where the stress is highest at first, and those looked at besides; the sections at both;
# room for nodes' places and both samples.
Room = tuple[Array, Array, Array, Array, Array, Array, Array]

# Stress, in E, from which on it may be highest between the clamps and the grasp (with shear).
ELSEWHERE = 0.4
# Part of it that sections inside must bear for this to be looked into.
NEARLY = 0.98
# Ratio of the deflections that are looked at on the way up to the break of a law that softens.
PACE = 1.25
# Part of an interval that golden sections cut off; width at which a top is found, relative.
GOLDEN, NARROW = 0.381966011250105, 1e-4
MOST_TRIES = 200
CLOSE = 1e-12
"""Width, relative to the deflection, at which a break is found."""
# The same of the deflection from which on there is no equilibrium any more.
LOST_CLOSE = 1e-6


@njit(**KERNEL)
def _graded(
    bounds: Array, first: int, count: int, start: float, end: float, gyration: float
) -> None:
    """Write the bounds of a part, graded as `mesh` says."""
    length = end - start
    b = steepness(min(LAYER * gyration / length, 1.0))
    over = 0.0 if b == 0.0 else 1.0 / math.tanh(b)
    for k in range(count + 1):
        even = 2.0 * k / count - 1.0
        place = math.tanh(b * even) * over if b > 0.0 else even
        bounds[first + k] = start + 0.5 * length * (1.0 + place)
    bounds[first], bounds[first + count] = start, end


@njit(**KERNEL)
def _set_up(
    state: State,
    fibres: Array | None,
    grasp: int | None,
    bounds: Array,
    room: Room,
    ducts: Array,
    i: int,
) -> None:
    """Write a duct's mesh, section and material into the state."""
    for stations, sections in ((room[0], room[2]), (room[1], room[3])):
        stations[stations.size - 1] = ducts[GRASP, i]
        for k in range(stations.size):
            sections[OVER_AREA, k], sections[OFF_AXIS, k] = 1.0, 0.0
            sections[OUTER, k] = ducts[REACH_OUT, i]
            sections[SECOND_MOMENT, k] = ducts[MOMENT_2, i]
    _, elements, points, line, _, _ = state
    count = elements.shape[1]
    second_moment, at = ducts[MOMENT_2, i], ducts[GRASP, i]
    gyration = math.sqrt(second_moment)
    if grasp is None:
        _graded(bounds, int(0), count, 0.0, 0.5, gyration)
        line[SHORTER_PIECE] = 0.5
    else:
        _graded(bounds, int(0), grasp, 0.0, at, gyration)
        _graded(bounds, grasp, count - grasp, at, 1.0, gyration)
        line[SHORTER_PIECE] = min(at, 1.0 - at)
    for e in range(count):
        elements[LENGTH, e] = bounds[e + 1] - bounds[e]
    line[SECOND], line[ECCENTRIC], line[COMPLIANCE] = count, 0.0, 0.0
    if fibres is None:
        for k in range(points.shape[1]):
            points[OFFSET, k] = 0.0
            points[BENDING, k] = points[KK, k] = second_moment
            points[STRETCHING, k] = 1.0
            points[SHEARING, k] = ducts[SHEAR_FLEX, i]
    else:
        nu = ducts[NU, i]
        line[SHEAR_MODULUS] = 0.5 / (1.0 + nu)
        line[RATIO] = (1.0 - 2.0 * nu) * line[SHEAR_MODULUS]
        line[SHRINK], line[POISSON] = ducts[LATERAL, i], nu
        for k in range(points.shape[1]):
            points[OFFSET, k] = 0.0
            points[AREA, k] = 1.0
            points[REACH, k], points[WEIGHT, k] = ducts[FIBRE, i], ducts[FIBRE_WEIGHT, i]
            points[DEFICIT, k] = ducts[LACK, i]


@njit(**KERNEL)
def _higher_inside(state: State, reach: float, highest: float) -> bool:
    """Return whether the highest stress may lie between the clamps and the grasp (neo-Hooke)."""
    _, _, points, line, _, _ = state
    for k in range(points.shape[1]):
        lam, gam = points[LAM, k], points[GAM, k]
        lateral = shrinkage(lam, line[SHRINK], line[POISSON])[0]
        stretch = lam + abs(points[KAPPA, k]) * reach * lateral
        pull = fibre_pull(stretch, gam, line[SHEAR_MODULUS], line[RATIO], line[STIFFENING])
        if pull > NEARLY * highest:
            return True
    return False


@njit(**KERNEL)
def _read_stress(
    state: State,
    fibres: Array | None,
    grasp_node: int,
    bounds: Array,
    room: Room,
    solved: Array,
    row: int,
    i: int,
) -> float:
    """Write force, deflection and highest stress; return that, nan where a section gives way."""
    line = state[3]
    ends = room[4]
    fill_points(state, fibres, grasp_node, int(4))
    highest = -math.inf
    for stations, sections, samples in ((room[0], room[2], room[5]), (room[1], room[3], room[6])):
        if not sampling.sample(state, fibres, grasp_node, bounds, stations, ends, samples):
            return math.nan
        for k in range(stations.size):
            tension, reach = samples[sampling.TENSION, k], sections[OUTER, k]
            normal = tension * sections[OVER_AREA, k]
            if fibres is None:
                bent = abs(samples[sampling.BENT, k] + sections[OFF_AXIS, k] * tension)
                total = normal + bent * reach / sections[SECOND_MOMENT, k]
            else:
                lam = samples[sampling.SAMPLE_LAM, k]
                lateral = shrinkage(lam, line[SHRINK], line[POISSON])[0]
                stretch = lam + abs(samples[sampling.SAMPLE_KAPPA, k]) * reach * lateral
                gam = samples[sampling.SAMPLE_GAM, k]
                outer = fibre_pull(stretch, gam, line[SHEAR_MODULUS], line[RATIO], line[STIFFENING])
                total = max(outer, normal)
            # Of equal ones the grasp's, which is the last station.
            if total >= highest - 1e-9 * abs(highest):
                highest = max(total, highest)
                solved[row + 2, i], solved[row + 3, i] = stations[k], normal
        if highest < ELSEWHERE or room[1].size == 0:
            break
        if fibres is None:
            if state[2][SHEARING, 0] == 0.0:
                break
        elif not _higher_inside(state, room[2][OUTER, 0], highest):
            break
    solved[row, i], solved[row + 1, i] = line[FORCE], line[DEFLECTION]
    solved[row + 4, i] = highest
    return highest


@njit(**KERNEL)
def _stress_at(
    state: State,
    fibres: Array | None,
    grasp: int | None,
    bounds: Array,
    room: Room,
    solved: Array,
    i: int,
    there: float,
) -> float:
    """Return the highest stress at a deflection, nan where there is no equilibrium."""
    # It is written into the rows of the load, which are free as yet.
    if newton.solve(state, fibres, grasp, int(BY_DEFLECTION), there) != FOUND:
        return math.nan
    grasp_node = state[1].shape[1] if grasp is None else grasp
    return _read_stress(state, fibres, grasp_node, bounds, room, solved, int(LOADED), i)


@njit(**KERNEL)
def _pull_up(
    state: State,
    fibres: Array | None,
    grasp: int | None,
    bounds: Array,
    room: Room,
    limit: float,
    solved: Array,
    i: int,
) -> tuple[float, float, float]:
    """Return a deflection before the first break, its stress, and one at the break or beyond."""
    d0, s0, d1, s1 = 0.0, 0.0, 0.0, 0.0
    d2 = FIRST_STEP * state[3][SHORTER_PIECE]
    while d1 <= FARTHEST:
        s2 = _stress_at(state, fibres, grasp, bounds, room, solved, i, d2)
        if not s2 < limit:
            return d1, s1, d2
        # A parabola through three stresses rises by an eighth of the larger fall at most.
        left, s_left, middle, top, right, s_right = d0, s0, d1, s1, d2, s2
        while (
            top > s_right
            and top + 0.5 * (top - min(s_left, s_right)) >= limit
            and right - left > NARROW * middle
        ):
            beyond = right - middle > middle - left
            there = middle + GOLDEN * (right - middle if beyond else left - middle)
            stress = _stress_at(state, fibres, grasp, bounds, room, solved, i, there)
            if not stress < limit:
                return (middle, top, there) if beyond else (left, s_left, there)
            if stress > top:
                if beyond:
                    left, s_left = middle, top
                else:
                    right, s_right = middle, top
                middle, top = there, stress
            elif beyond:
                right, s_right = there, stress
            else:
                left, s_left = there, stress
        d0, s0, d1, s1, d2 = d1, s1, d2, s2, PACE * d2
    return d1, s1, math.inf


@njit(**KERNEL)
def _find_break(
    state: State,
    fibres: Array | None,
    grasp: int | None,
    bounds: Array,
    room: Room,
    ducts: Array,
    solved: Array,
    i: int,
) -> None:
    """Write where a duct breaks; nan where it bears all that its law can follow."""
    a = ducts[GRASP, i]
    b = 1.0 - a
    reach, limit = ducts[REACH_OUT, i], ducts[LIMIT, i]
    # The cubic beam's strain, 3 d^2 / (20 a^2 b^2) + c k d with its largest curvature k d.
    square = 0.15 / (a * a * b * b)
    bent = 0.5 * reach * max(max(3.0 / (a * a * b), 3.0 / (a * b * b)), 6.0 / (a * b))
    there = limit / (bent + math.sqrt(bent * bent + square * limit))
    low, f_low, high, f_high = 0.0, -limit, math.inf, 0.0
    sound, side = False, 0
    if fibres is not None or state[2][SHEARING, 0] != 0.0:
        low, f_low, there = _pull_up(state, fibres, grasp, bounds, room, limit, solved, i)
        f_low -= limit
    for _ in range(MOST_TRIES):
        if there == math.inf:
            break
        stress = _stress_at(state, fibres, grasp, bounds, room, solved, i, there)
        over = stress - limit
        if over < 0.0:
            low, f_low = there, over
            if side < 0:
                f_high *= 0.5
            side = -1
        else:
            high, sound = there, over == over
            if sound:
                for row in range(LOADED):
                    solved[BREAK + row, i] = solved[LOADED + row, i]
                f_high = over
                if side > 0:
                    f_low *= 0.5
                side = 1
        if high == math.inf:
            if low > FARTHEST:
                break
            there = low * min(max(1.02 * limit / stress, 1.02), 1.45)
        elif low == 0.0:
            there = high * (min(max(0.98 * limit / stress, 0.55), 0.98) if sound else 0.5)
            if there < 1e-12:
                break
        else:
            width = high - low
            if width <= (CLOSE if sound else LOST_CLOSE) * high or (sound and over == 0.0):
                break
            there = low + 0.5 * width
            if sound:
                there = low - f_low * width / (f_high - f_low)
                # Off the end that is kept, or the other one would never come near.
                least = 0.25 * CLOSE * high
                there = min(max(there, low + least), high - least)
    if not sound:
        for row in range(LOADED):
            solved[BREAK + row, i] = math.nan


@njit(nogil=True, **KERNEL)
def solve_ducts(
    state: State,
    fibres: Array | None,
    grasp: int | None,
    control: int,
    bounds: Array,
    room: Room,
    ducts: Array,
    solved: Array,
    set_up: bool,
) -> None:
    """Fill the solved from the ducts, each set up first unless all are the beam of the state."""
    grasp_node = state[1].shape[1] if grasp is None else grasp
    for i in range(ducts.shape[1]):
        if set_up:
            _set_up(state, fibres, grasp, bounds, room, ducts, i)
        newton.rest(state, fibres)
        if ducts[LIMIT, i] > 0.0:
            _find_break(state, fibres, grasp, bounds, room, ducts, solved, i)
        for row in range(LOADED, SOLVED_ROWS):
            solved[row, i] = math.nan
        load = ducts[LOAD, i]
        if load == load:
            newton.rest(state, fibres)
            if newton.solve(state, fibres, grasp, control, load) == FOUND:
                stress = _read_stress(
                    state, fibres, grasp_node, bounds, room, solved, int(LOADED), i
                )
                if stress != stress:
                    for row in range(LOADED, SOLVED_ROWS):
                        solved[row, i] = math.nan


def solve_exact_ducts(
    law: Linear | FibreLaw,
    intervals: int,
    ducts: NDArray[np.float64],
    rings: list[Ring],
    *,
    by_force: bool,
) -> NDArray[np.float64]:
    """Return the (SOLVED_ROWS, N) solved of (DUCT_ROWS, N) ducts, given down to the row `NU`."""
    # `rings` have their areas and second moments, mm^2 and mm^4.
    ratios = ducts[NU].tolist()
    if isinstance(law, FibreLaw):
        ducts[LATERAL] = lateral_constants(ducts[NU])
        for i, (ring, nu) in enumerate(zip(rings, ratios, strict=True)):
            distance, ducts[FIBRE_WEIGHT, i] = ring.fibres
            ducts[FIBRE, i] = distance * math.sqrt(
                ducts[MOMENT_2, i] * ring.area / ring.second_moment
            )
            ducts[LACK, i] = (1.0 - ring.free_shear_coefficient(nu)) * 0.5 / (1.0 + nu)
    else:
        ducts[SHEAR_FLEX] = 0.0
        if law.shear:
            ducts[SHEAR_FLEX] = [
                2.0 * (1.0 + nu) / ring.shear_coefficient(nu)
                for ring, nu in zip(rings, ratios, strict=True)
            ]
    solved = np.full((SOLVED_ROWS, ducts.shape[1]), np.nan)
    central = np.abs(ducts[GRASP] - 0.5) <= 1e-12
    for half, which in ((True, central), (False, ~central)):
        if not which.any():
            continue
        per_piece = intervals // 2
        elements = per_piece if half else 2 * per_piece
        state, fibres = new_state(elements, law.point_rows, law.fibre_rows)
        if isinstance(law, FibreLaw):
            state[3][STIFFENING] = law.stiffening
        even = np.linspace(0.0, 1.0, 41)
        # The clamps and the grasp, whose place is written for each duct; and all the way along.
        ends = np.array([0.0, 0.5] if half else [0.0, 1.0, 0.5])
        along = even[even <= 0.5] if half else np.append(even, 0.5)
        room = _room(ends, along, elements)
        few, found = (np.ascontiguousarray(rows[:, which]) for rows in (ducts, solved))
        solve_ducts(
            state,
            fibres,
            None if half else per_piece,
            BY_FORCE if by_force else BY_DEFLECTION,
            np.zeros(elements + 1),
            room,
            few,
            found,
            True,
        )
        solved[:, which] = found
    return solved


def solve_exact_beam(
    state: State,
    fibres: Array | None,
    grasp: int | None,
    bounds: Array,
    stations: Array,
    sections: Array,
    ducts: Array,
    *,
    by_force: bool,
) -> Array:
    """Return the (SOLVED_ROWS, N) solved of a beam that is set up; see `ExactPull.solve_loads`."""
    solved = np.full((SOLVED_ROWS, ducts.shape[1]), np.nan)
    room = _room(stations, np.empty(0), state[1].shape[1])
    room[2][:] = sections
    control = BY_FORCE if by_force else BY_DEFLECTION
    solve_ducts(state, fibres, grasp, control, bounds, room, ducts, solved, False)
    return solved


def _room(stations: Array, besides: Array, elements: int) -> Room:
    return (
        stations,
        besides,
        np.zeros((SECTION_ROWS, stations.size)),
        np.zeros((SECTION_ROWS, besides.size)),
        np.zeros((2, elements + 1)),
        np.zeros((sampling.SAMPLE_ROWS, stations.size)),
        np.zeros((sampling.SAMPLE_ROWS, besides.size)),
    )


def lateral_constants(poisson_ratios: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return `physics.section.lateral_constant` of (N,) Poisson's ratios, all at once."""
    ratios, inverse = np.unique(poisson_ratios, return_inverse=True)
    stretch = np.linspace(0.6, 3.5, 300)
    excess = stretch - 1.0
    found = np.empty(ratios.size)
    for first in range(0, ratios.size, 64):
        nu = ratios[first : first + 64, None]
        ratio = (1.0 - 2.0 * nu) / (2.0 * (1.0 + nu))
        # Newton's method on the cube root j of the volume ratio, and then on the constant.
        j = stretch ** ((1.0 - 2.0 * nu) / 3.0)
        for _ in range(12):
            j2 = j * j
            j3 = j2 * j
            j5 = j3 * j2
            value = j5 * (j3 - 1.0) + ratio * (j3 / stretch - stretch**2)
            slope = 8.0 * j5 * j2 - 5.0 * j2 * j2 + 3.0 * ratio * j2 / stretch
            j -= np.clip(value / slope, -0.5 * j, 0.5 * j)
        lateral = np.sqrt(j * j * j / stretch)
        constant = np.full_like(nu, 0.3)
        for _ in range(30):
            bottom = 1.0 + (constant + nu) * excess
            error = (1.0 + constant * excess) / (bottom * lateral) - 1.0
            slope = nu * excess**2 / (bottom**2 * lateral)
            square = np.sum(slope * slope, axis=1, keepdims=True)
            step = np.sum(slope * error, axis=1, keepdims=True) / np.where(
                square > 0.0, square, 1.0
            )
            constant = np.where(square > 0.0, np.maximum(constant - step, 0.0), 0.0)
        found[first : first + 64] = constant[:, 0]
    return found[inverse]
