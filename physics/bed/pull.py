"""Hands and rods that follow paths, and the history of their forces."""

import csv
import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from physics.bed.beam_on_bed import BeamOnBed
from physics.bed.bed import Bed
from physics.bed.flow import Flow
from physics.bed.network import Network
from physics.bed.relaxation import Relaxation
from physics.bed.space_beam import SpaceBeam
from physics.bed.strands import Strands
from physics.equilibrium import NoEquilibrium
from physics.quantity import finite, positive
from physics.tear_growth import DEEPEST

Floats = NDArray[np.float64]
Steps = int | tuple[int, ...]

MOST_STEPS = 100_000
# ml of a mm^3.
ML = 1e-3
# Elements that stay between two tears of a tube.
APART = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Hand:
    """A hook that holds the beam at one place and follows a path."""

    at: float  # where it holds, mm from the first end along the axis at rest
    # points joined by straight legs, from 0: displacements from where it took hold, mm, or forces,
    # N
    path: tuple[tuple[float, float, float], ...]
    by: Literal["displacement", "force"] = "displacement"
    # along the whole path, shared among its legs by their lengths; or one number a leg
    steps: Steps = 100
    # which of x, y and z it holds by displacement; the beam slides in it along the others
    along: tuple[bool, bool, bool] = (True, True, True)
    from_step: int = 0  # takes hold after so many steps of the whole
    until_step: int | None = None  # lets go after so many; never when None
    tube: str | None = None  # that it holds, of a network; the first one when None

    def __post_init__(self) -> None:
        finite(self.at, "a hook's place", "mm")
        step_places(self.path, self.steps, "a hand's path")
        if self.from_step < 0:
            raise ValueError(f"from_step of a hand must be 0 or more, got {self.from_step}")
        if self.until_step is not None and self.until_step <= self.from_step:
            raise ValueError("until_step of a hand must be after from_step")
        if not any(self.along):
            raise ValueError("a hand must hold the beam along x, y or z")


@dataclass(frozen=True, slots=True, kw_only=True)
class Rod:
    """A blunt rod moved among the strands: a jaw, a closed dissector, a swab; steps as a `Hand`."""

    # places of its tip, mm; at the first of them it touches nothing
    path: tuple[tuple[float, float, float], ...]
    shaft: tuple[float, float, float]  # direction from the tip back along the shaft
    radius: float  # mm
    steps: Steps = 100
    from_step: int = 0

    def __post_init__(self) -> None:
        if len(self.path) < 2:
            raise ValueError("a rod's path must have 2 points or more")
        step_places(self.path, self.steps, "a rod's path", begin=False)
        positive(self.radius, "radius of a rod", "mm")
        size = sum(finite(each, "shaft of a rod", "") ** 2 for each in self.shaft)
        if size == 0.0:
            raise ValueError("shaft of a rod must have a direction, got 0, 0, 0")
        if self.from_step < 0:
            raise ValueError(f"from_step of a rod must be 0 or more, got {self.from_step}")


def step_places(
    path: Sequence[Sequence[float]], steps: Steps, name: str, *, begin: bool = True
) -> Floats:
    """Return the (steps, 3) places after each step of a path, or forces; from 0 if `begin`."""
    try:
        points = np.array(path, dtype=np.float64)
    except (TypeError, ValueError):
        points = np.empty(0)
    if points.ndim != 2 or points.size == 0 or points.shape[-1] != 3:
        raise ValueError(f"{name} must be points of 3 numbers each, got {path!r}")
    if not np.all(np.isfinite(points)):
        where = int(np.argmin(np.isfinite(points).all(axis=1)))
        raise ValueError(
            f"{name} must be finite numbers, got {points[where].tolist()} at point {where + 1}"
        )
    if begin and np.any(points[0] != 0.0):
        points = np.concatenate([np.zeros((1, 3)), points])
    legs = max(points.shape[0] - 1, 1)
    if points.shape[0] == 1:
        points = np.repeat(points, 2, axis=0)
    if isinstance(steps, tuple):
        counts = list(steps)
        if len(counts) != legs:
            raise ValueError(f"{name} has {legs} leg{'s' * (legs > 1)} and steps for {len(counts)}")
    else:
        if steps < legs:
            raise ValueError(
                f"{name} of {legs} leg{'s' * (legs > 1)} needs as many steps, got {steps}"
            )
        lengths = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1))
        counts = [1] * legs
        for _ in range(min(steps, MOST_STEPS + 1) - legs):
            counts[int(np.argmax(lengths / np.array(counts)))] += 1
    if min(counts) < 1 or sum(counts) > MOST_STEPS:
        raise ValueError(f"steps of {name} must be 1 to {MOST_STEPS:,}, got {sum(counts):,}")
    return np.concatenate(
        [
            a + (b - a) * (np.arange(1, count + 1) / count)[:, None]
            for a, b, count in zip(points, points[1:], counts, strict=False)
        ]
    )


@dataclass(frozen=True, slots=True, eq=False)
class TubeHistory:
    """What happened to a tube of a network in each of T steps."""

    name: str
    freed: Floats  # (T,) length whose strands have parted, mm
    stress: Floats | None  # (T,) largest normal plus bending stress, MPa; None without a wall
    highest_at: Floats | None  # (T,) where that is, mm from its first end
    strength: float  # nominal stress at which it tears, MPa; infinite where it does not
    torn: tuple[tuple[int, float], ...]  # steps, from 0, after which it tore, and where, mm
    nicked: Floats | None = None  # (T,) how deep it is torn, of its height; None without a wall
    nick: Floats | None = None  # (T,) depth of its deepest tear part of the way, mm; likewise
    lost: Floats | None = None  # (T,) fluid lost so far, mm^3; None without one
    flow: Floats | None = None  # (T,) what flows out of its holes, mm^3/s; likewise

    def row(self, step: int) -> dict[str, object]:
        """Return what `bluntdissect peel --json` writes of it after a step."""
        out: dict[str, object] = {"freed_mm": float(self.freed[step])}
        if self.stress is not None:
            stress = float(self.stress[step])
            out["stress_MPa"] = stress
            if self.highest_at is not None:
                out["highest_at_mm"] = float(self.highest_at[step])
            if self.strength < np.inf:
                out["distance_to_break_percent"] = 100.0 * (1.0 - stress / self.strength)
        if self.nicked is not None and self.nick is not None and self.nicked[step] > 0.0:
            out |= {"nicked": float(self.nicked[step]), "nick_mm": float(self.nick[step])}
        if self.lost is not None and self.flow is not None:
            out["lost_ml"] = ML * float(self.lost[step])
            out["flow_ml_per_s"] = ML * float(self.flow[step])
        out["torn_at_mm"] = [at for when, at in self.torn if when <= step]
        return out


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """What happened in each of T steps of H hands."""

    # (T, H, 3) displacements of the places held, mm from rest; NaN while a hand does not hold
    hands: Floats
    forces: Floats  # (T, H, 3) of the hands on the beam, N; NaN likewise
    rods: Floats  # (T, R, 3) forces of the hands on the rods, N
    freed: Floats  # (T,) lengths of beam whose strands have parted, mm
    broken: NDArray[np.int64]  # (T,) numbers of strands broken
    work: Floats  # (T,) this and the next three: the energy balance, mJ; see `EnergyBalance`
    stored: Floats
    dissipated: Floats
    snap: Floats
    # (T,) largest normal plus bending stress of the wall, MPa, and where that is, mm from the first
    # clamp; None without a wall
    stress: Floats | None
    highest_at: Floats | None
    shape: Floats  # (N, 3) the nodes after the last step, mm
    damage: Floats  # (S,) of the strands after the last step, 0 to 1
    rounding: float  # work that rounding may do along the way, mJ
    notes: tuple[str, ...]  # on hands whose force moves nothing, in words
    tubes: tuple[TubeHistory, ...] = ()  # of a network
    times: Floats | None = None  # (T,) s, where tissue relaxes or a fluid flows
    viscous: Floats | None = None  # (T,) what relaxing dissipates, mJ
    # (T,) of each fluid what is left, mm^3
    left: Mapping[str, Floats] = field(default_factory=dict[str, Floats])

    @property
    def steps(self) -> int:
        """How many."""
        return self.freed.size

    @property
    def residual_ratio(self) -> float:
        """Part of all work that the energy balance does not explain, in absolute value."""
        missing = self.work - self.stored - self.dissipated - self.snap
        if self.viscous is not None:
            missing -= self.viscous
        most, left = (float(np.abs(each).max(initial=0.0)) for each in (self.work, missing))
        return left / most if most > self.rounding else 0.0

    def rows(self, threshold: float | None = None) -> list[dict[str, object]]:
        """Return a row for each step, as `bluntdissect peel --json` writes it."""
        rows: list[dict[str, object]] = []
        for t in range(self.steps):
            row: dict[str, object] = {
                "hand_mm": _triple(self.hands[t, 0]) if self.hands.shape[1] else None,
                "force_N": _triple(self.forces[t, 0]) if self.hands.shape[1] else None,
                "freed_mm": float(self.freed[t]),
                "strands_broken": int(self.broken[t]),
                "work_mJ": float(self.work[t]),
                "stored_mJ": float(self.stored[t]),
                "dissipated_mJ": float(self.dissipated[t]),
                "snap_mJ": float(self.snap[t]),
            }
            if self.times is not None:
                row["time_s"] = float(self.times[t])
            if self.viscous is not None:
                row["viscous_mJ"] = float(self.viscous[t])
            if self.hands.shape[1] > 1:
                row["hands"] = [
                    {"hand_mm": _triple(at), "force_N": _triple(force)}
                    for at, force in zip(self.hands[t], self.forces[t], strict=True)
                ]
            if self.rods.shape[1]:
                row["rods_N"] = [_triple(force) for force in self.rods[t]]
            if self.stress is not None:
                row["stress_MPa"] = float(self.stress[t])
                if self.highest_at is not None:
                    row["highest_at_mm"] = float(self.highest_at[t])
                if threshold is not None:
                    row["distance_to_break_percent"] = 100.0 * (
                        1.0 - float(self.stress[t]) / threshold
                    )
            if self.tubes:
                row["tubes"] = {each.name: each.row(t) for each in self.tubes}
            if self.left:
                row["left_ml"] = {name: ML * float(left[t]) for name, left in self.left.items()}
            rows.append(row)
        if rows:
            rows[-1]["shape_mm"] = self.shape.tolist()
        return rows

    def csv(self, threshold: float | None = None) -> str:
        """Return a table with a line for each step."""
        count = self.hands.shape[1]
        head: list[str] = ["step"]
        for h in range(count):
            tag = "" if count == 1 else f"_{h + 1}"
            head += [f"hand{tag}_{axis}_mm" for axis in "xyz"]
            head += [f"force{tag}_{axis}_N" for axis in "xyz"]
        for m in range(self.rods.shape[1]):
            head += [f"rod_{m + 1}_{axis}_N" for axis in "xyz"]
        head += ["freed_mm", "strands_broken", "work_mJ", "stored_mJ", "dissipated_mJ", "snap_mJ"]
        if self.stress is not None:
            head += ["stress_MPa", "highest_at_mm"]
            head += ["distance_to_break_percent"] * (threshold is not None)
        head += ["time_s"] * (self.times is not None) + ["viscous_mJ"] * (self.viscous is not None)
        for tube in self.tubes:
            head += [f"{tube.name}_freed_mm", f"{tube.name}_stress_MPa", f"{tube.name}_tears"]
            if tube.nicked is not None:
                head += [f"{tube.name}_nicked", f"{tube.name}_nick_mm"]
            if tube.lost is not None:
                head += [f"{tube.name}_lost_ml", f"{tube.name}_flow_ml_per_s"]
        head += [f"{name}_left_ml" for name in self.left]
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(head)
        for t in range(self.steps):
            line: list[object] = [t + 1]
            for h in range(count):
                line += [_cell(v) for v in (*self.hands[t, h], *self.forces[t, h])]
            for m in range(self.rods.shape[1]):
                line += [_cell(v) for v in self.rods[t, m]]
            line += [_cell(self.freed[t]), int(self.broken[t])]
            line += [_cell(b[t]) for b in (self.work, self.stored, self.dissipated, self.snap)]
            if self.stress is not None:
                line.append(_cell(self.stress[t]))
                line.append(_cell(np.nan if self.highest_at is None else self.highest_at[t]))
                if threshold is not None:
                    line.append(_cell(100.0 * (1.0 - self.stress[t] / threshold)))
            line += [_cell(each[t]) for each in (self.times, self.viscous) if each is not None]
            for tube in self.tubes:
                stress = np.nan if tube.stress is None else tube.stress[t]
                tears = sum(when <= t for when, _ in tube.torn)
                line += [_cell(tube.freed[t]), _cell(stress), tears]
                if tube.nicked is not None and tube.nick is not None:
                    line += [_cell(tube.nicked[t]), _cell(tube.nick[t])]
                if tube.lost is not None and tube.flow is not None:
                    line += [_cell(ML * tube.lost[t]), _cell(ML * tube.flow[t])]
            line += [_cell(ML * left[t]) for left in self.left.values()]
            writer.writerow(line)
        return out.getvalue()


def pull(
    beam: SpaceBeam | Network,
    bed: Bed | Strands | Sequence[Bed] | None,
    hands: Sequence[Hand],
    *,
    rods: Sequence[Rod] = (),
    plane: bool = False,
    floor: Floats | Sequence[Floats] | None = None,
    strength: Mapping[str, float] | None = None,
    step_seconds: float = 0.0,
    strand_relaxation: Relaxation | None = None,
    wall_relaxation: Relaxation | None = None,
    tear_mm: float = np.inf,
    fluids: Callable[[BeamOnBed], Mapping[str, Flow]] | None = None,
    watch: Callable[[BeamOnBed], bool] | None = None,
) -> History:
    """Move hands and rods along their paths through equilibria and return what happened.

    All hands move at the same time, step by step; one whose path is through stays where it is. The
    result depends on no rate and is the same to the bit in each run.

    Parameters
    ----------
    beam, bed
        The beam at rest, with nodes where hands take hold (`SpaceBeam.from_axis(nodes_at=...)`),
        and its bed or beds, or strands made by hand; or a network and its strands.
    hands, rods
        What moves.
    plane
        Whether nothing leaves the plane of x and z.
    floor
        (N,) stiffness of the floor at the nodes, N/mm, beside the beds' own; of a network a row
        for each tube.
    strength
        Of a network's tubes the stresses at which they tear, MPa, where they have a wall. A tube
        tears after the step in which it is passed, at the worst place, and again where three
        elements or more are left of a piece.
    step_seconds
        Time that each step takes, s, in which strands and walls relax and fluids flow.
    strand_relaxation, wall_relaxation
        How they do; not at all when None.
    tear_mm
        How far a tear crosses the wall of a network's tube in a step, mm: through at once, or part
        of the way (`BeamOnBed.nick`).
    fluids
        Of a network at rest makes the fluids in its tubes, by name. They flow for the time of a
        step once its tears are made: out of what has torn by then, as the tubes lie at its end.
    watch
        Called with the beam at rest, once hands have taken hold, and after each step, with which
        the pull ends if it returns True.

    Returns
    -------
    History
        One row for each step that was made.

    Raises
    ------
    NoEquilibrium
        If a step has no equilibrium near the last one; it says which.
    ValueError
        If hands are on top of one another or behind a clamp.
    """
    strands, ground = _tissue(beam, bed, floor)
    held = BeamOnBed(
        beam,
        strands,
        floor=ground,
        rods=len(rods),
        plane=plane,
        strand_relaxation=strand_relaxation,
        wall_relaxation=wall_relaxation,
    )
    relaxes = strand_relaxation is not None or wall_relaxation is not None
    names = beam.tubes if isinstance(beam, Network) else ()
    flows = {} if fluids is None else dict(fluids(held))
    tubes = [
        _TubeRecord(
            held, name, strength, tear_mm, [each for each in flows.values() if name in each.tubes]
        )
        for name in names
    ]
    paths = [step_places(hand.path, hand.steps, "a hand's path") for hand in hands]
    sweeps = [step_places(rod.path, rod.steps, "a rod's path", begin=False) for rod in rods]
    total = max(
        [hand.from_step + len(path) for hand, path in zip(hands, paths, strict=True)]
        + [rod.from_step + len(path) for rod, path in zip(rods, sweeps, strict=True)],
        default=0,
    )
    if total == 0:
        raise ValueError("a pull needs a hand or a rod")
    nodes: list[int | None] = [None] * len(hands)
    taken = np.zeros((len(hands), 3))
    shape = (total, len(hands), 3)
    at, force = np.full(shape, np.nan), np.full(shape, np.nan)
    pushed = np.zeros((total, len(rods), 3))
    walled = not isinstance(beam, Network) and beam.wall is not None
    worst = np.empty((total, 2)) if walled else None
    energy = np.empty((total, 6))
    freed, broken = np.empty(total), np.empty(total, dtype=np.int64)
    left: dict[str, Floats] = {name: np.empty(total) for name in flows}
    for t in range(total):
        for h, hand in enumerate(hands):
            if t == hand.from_step:
                along = hand.along if hand.by == "displacement" else (False, False, False)
                node = held.take(hand.at, hand.tube, along=along)
                nodes[h], taken[h] = node, held.places[node]
            node = nodes[h]
            if node is None:
                continue
            if t == hand.until_step:
                held.let_go(node)
                nodes[h] = None
                continue
            place = paths[h][min(t - hand.from_step, len(paths[h]) - 1)]
            if hand.by == "displacement":
                held.lead(node, taken[h] + place)
            else:
                held.push(node, place)
        for m, rod in enumerate(rods):
            if t == rod.from_step:
                held.set_rod(m, rod.path[0], rod.shaft, rod.radius)
            if t >= rod.from_step:
                held.lead_rod(m, sweeps[m][min(t - rod.from_step, len(sweeps[m]) - 1)])
        if watch is not None and t == 0:
            watch(held)
        try:
            held.advance(step_seconds)
        except NoEquilibrium as lost:
            raise NoEquilibrium(f"step {t + 1} of {total}: {lost}") from None
        for h, node in enumerate(nodes):
            if node is not None:
                at[t, h] = held.places[node] - held.rest_place(node)
                force[t, h] = held.hand_force(node)
        for m in range(len(rods)):
            pushed[t, m] = held.rod_force(m)
        freed[t], broken[t] = held.freed, held.broken
        now = held.energy
        energy[t] = now.work, now.stored, now.dissipated, now.snap, now.residual, now.viscous
        if worst is not None:
            highest = held.worst_stress()
            worst[t] = highest.total, highest.station
        for tube in tubes:
            tube.add(held, t)
        for name, flow in flows.items():
            flow.advance(step_seconds)
            left[name][t] = flow.left
        for tube in tubes:
            tube.add_flow()
        if watch is not None and watch(held):
            total = t + 1
            break
    far = float(np.nan_to_num(np.abs(at)).max(initial=0.0))
    far = max([far, *(float(np.ptp(sweep, axis=0).max()) for sweep in sweeps)])
    return History(
        at[:total],
        force[:total],
        pushed[:total],
        freed[:total],
        broken[:total],
        energy[:total, 0],
        energy[:total, 1],
        energy[:total, 2],
        energy[:total, 3],
        None if worst is None else worst[:total, 0],
        None if worst is None else worst[:total, 1],
        held.places.copy(),
        held.damage,
        held.rounding * far,
        tuple(
            f"the force at {hand.at:g} mm moves nothing: in this beam forces below "
            f"{held.rounding:.1g} N are rounding"
            for hand, path in zip(hands, paths, strict=True)
            if hand.by == "force" and 0.0 < np.abs(path).max() <= held.rounding
        ),
        tuple(tube.history() for tube in tubes),
        step_seconds * np.arange(1.0, total + 1.0) if relaxes or flows else None,
        energy[:total, 5] if relaxes else None,
        {name: each[:total] for name, each in left.items()},
    )


class _TubeRecord:
    """A tube of a network while it is pulled."""

    def __init__(
        self,
        held: BeamOnBed,
        name: str,
        strength: Mapping[str, float] | None,
        tear_mm: float,
        flows: Sequence[Flow],
    ) -> None:
        if not tear_mm > 0.0:
            raise ValueError(f"tear_mm must be above 0 mm, got {tear_mm} mm")
        self.name, self._tear_mm, self._flows = name, tear_mm, flows
        self.strength = (strength or {}).get(name, np.inf)
        self._walled = held.network.tubes[name].wall is not None
        if self.strength < np.inf and not self._walled:
            raise ValueError(f"tube {name!r} has no wall that could tear")
        self._freed: list[float] = []
        self._worst: list[tuple[float, float]] = []
        self._torn: list[tuple[int, float]] = []
        self._elements: list[int] = []
        self._nicked: list[tuple[float, float]] = []
        self._flowed: list[tuple[float, float]] = []

    def add(self, held: BeamOnBed, step: int) -> None:
        """Take down a step, and tear the tube where it is past its strength."""
        self._freed.append(held.freed_of(self.name))
        if not self._walled:
            return
        worst = held.worst_stress(self.name)
        self._worst.append((worst.total, worst.station))
        element = held.element_at(worst.station, self.name)
        near = any(abs(element - torn) < APART for torn in self._elements)
        past = worst.total > self.strength and not near
        if past and held.nick(worst, self._tear_mm, self.name) >= DEEPEST:
            self._elements.append(held.tear(worst.station, self.name))
            self._torn.append((step, worst.station))
        nicks = held.nicks_of(self.name)
        depth = 1.0 if self._torn else max((each.depth for each in nicks), default=0.0)
        deepest = max((each.depth * each.height for each in nicks), default=0.0)
        self._nicked.append((depth, deepest))
        for flow in self._flows:
            for nick in nicks:
                flow.open_nick(nick, flow.wall_at(nick.station, self.name))

    def add_flow(self) -> None:
        """Take down what has flowed out of the tube in a step."""
        holes = [hole for flow in self._flows for hole in flow.holes if hole.tube == self.name]
        lost, rate = math.fsum(each.lost for each in holes), math.fsum(each.flow for each in holes)
        self._flowed.append((lost, rate))

    def history(self) -> TubeHistory:
        """Return all that was taken down."""
        stress, at = np.array(self._worst).reshape(-1, 2).T if self._walled else (None, None)
        torn = tuple(self._torn)
        nicked, nick = np.array(self._nicked).reshape(-1, 2).T if self._walled else (None, None)
        lost, flow = np.array(self._flowed).reshape(-1, 2).T if self._flows else (None, None)
        return TubeHistory(
            self.name, np.array(self._freed), stress, at, self.strength, torn, nicked, nick,
            lost, flow,
        )  # fmt: skip


def _tissue(
    beam: SpaceBeam | Network,
    bed: Bed | Strands | Sequence[Bed] | None,
    floor: Floats | Sequence[Floats] | None,
) -> tuple[Strands, Sequence[Floats]]:
    """Return strands and floors of tubes."""
    if isinstance(beam, Network):
        if not (bed is None or isinstance(bed, Strands)):
            raise ValueError("a network takes strands, which name their tubes, and no beds")
        none = [np.zeros(each.stations.size) for each in beam.tubes.values()]
        return bed or Strands.none(), none if floor is None else list(floor)
    beds = [bed] if isinstance(bed, Bed) else [] if isinstance(bed, Strands) else list(bed or ())
    strands = (
        bed
        if isinstance(bed, Strands)
        else Strands.joined([each.strands_under(beam) for each in beds])
    )
    ground: Floats = np.zeros(beam.stations.size) if floor is None else np.array(floor)
    for each in beds:
        ground += each.floor_under(beam)
    return strands, [ground]


def _triple(row: Floats) -> list[float] | None:
    return None if np.isnan(row).any() else [float(v) for v in row]


def _cell(value: float) -> str:
    return "" if np.isnan(value) else repr(float(value))
