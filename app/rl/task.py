"""A policy's task: the numbers that it sees, sends and is rewarded by (docs/rl-spaces.md)."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from app.anatomy import anatomy_named, read_anatomy
from app.rl.picture import Camera, Pose
from app.simulation import (
    ALL_INSTRUMENTS,
    ELEMENTS,
    HAND_SPEED,
    HANDS,
    HOLDING,
    INSTRUMENTS,
    MOST_OPENING,
    TICKS_PER_SECOND,
    TOWARDS_VIEWER,
    Exercise,
    FreeLength,
    Instrument,
    Opening,
    Session,
    SpatialTissue,
    Specimen,
    bed_named,
    exercises_offered,
    preset_named,
    specimen_in_bed,
)
from assets import BILE_DUCT
from organ_geometry import read_organ

SEEDS = tuple(range(1, 21))
"""Seeds of beds to learn on; those from 21 on are kept to judge by."""
PIXELS = "pixels"
VERTICES = 50  # of the skin, which no policy sees
MOST_TICKS_PER_STEP, MOST_PIXELS = 30, 1024
WIDE_MM, MOST_LOST_ML, AWAY_ANATOMY_MM = 300.0, 1000.0, 120.0
FAR_MM, MOST_FORCE_N, MOST_RATIO, MOST_SECONDS = 60.0, 20.0, 4.0, 3600.0
"""Bounds of what is observed; what lies beyond is clipped to them."""


class Number(NamedTuple):
    """One number, or one row of them: its range, unit and meaning; `span` is added to the range."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    with_span: bool = False


TIP = (
    Number("x", "mm", -FAR_MM, FAR_MM, "the tip, along the duct from the first clamp", True),
    Number("y", "mm", -FAR_MM, FAR_MM, "the tip, to the side; the viewer is at negative ones"),
    Number("z", "mm", -FAR_MM, FAR_MM, "the tip, away from the bed"),
)
HOLD = (
    Number("force x", "N", -MOST_FORCE_N, MOST_FORCE_N, "the hand's force on duct and strands"),
    Number("force y", "N", -MOST_FORCE_N, MOST_FORCE_N, "the same, to the side"),
    Number("force z", "N", -MOST_FORCE_N, MOST_FORCE_N, "the same, away from the bed"),
    Number("holds", "", 0.0, 1.0, "1 while the hand holds the duct"),
    Number("opening", "mm", 0.0, MOST_OPENING, "between the jaws"),
)


def _held(instruments: Sequence[Instrument]) -> tuple[Number, ...]:
    return tuple(
        Number(each, "", 0.0, 1.0, f"1 if the instrument is a {each}") for each in instruments
    )


OBSERVATIONS: dict[str, tuple[Number, ...]] = {
    "hands": (*TIP, *HOLD, *_held(INSTRUMENTS)),
    "duct": tuple(
        Number(each, "mm", -FAR_MM, FAR_MM, f"how far a node of the axis has moved, {where}")
        for each, where in (("x", "along"), ("y", "to the side"), ("z", "away from the bed"))
    ),
    "strands": (Number("whole", "", 0.0, 1.0, "share of the strands that hold, at each mm"),),
    "wall": (
        Number("stress ratio", "", 0.0, MOST_RATIO, "largest stress over its threshold; 1 tears"),
        Number("station", "mm", 0.0, 0.0, "where it is, from the first clamp", True),
        Number("peak", "", 0.0, MOST_RATIO, "largest ratio of the episode"),
    ),
    "goal": (
        Number("from", "mm", 0.0, 0.0, "where the stretch begins that is to be freed", True),
        Number("to", "mm", 0.0, 0.0, "where it ends", True),
        Number("free", "mm", 0.0, 0.0, "length within it that is to be free", True),
        Number("progress", "", 0.0, 1.0, "the exercise's own, 1 when it is done"),
        Number("time left", "s", 0.0, MOST_SECONDS, "until the episode is truncated"),
    ),
}
"""What is observed of a duct in its bed: of each hand, node and mm one row."""
AT_ANATOMY: dict[str, tuple[Number, ...]] = {
    "hands": (
        *(
            Number(each, "mm", -WIDE_MM, WIDE_MM, "the tip, in the anatomy's frame")
            for each in "xyz"
        ),
        *HOLD,
        *_held(ALL_INSTRUMENTS),
    ),
    "duct": OBSERVATIONS["duct"],
    "strands": OBSERVATIONS["strands"],
    "wall": OBSERVATIONS["wall"],
    "tubes": (
        Number("stress ratio", "", 0.0, MOST_RATIO, "largest stress over its threshold"),
        Number("torn", "", 0.0, 1.0, "1 once it has torn"),
    ),
    "fluids": (
        Number("lost", "ml", 0.0, MOST_LOST_ML, "what has flowed out"),
        Number("rate", "ml/s", 0.0, MOST_LOST_ML, "what flows out"),
    ),
    "view": (
        Number("two structures", "", 0.0, 2.0, "points: two and only two structures enter"),
        Number("triangle", "", 0.0, 2.0, "points: the triangle is cleared"),
        Number("plate", "", 0.0, 2.0, "points: the lower third of the cystic plate is freed"),
        Number("structures parted", "", 0.0, 1.0, "smallest share of strands about one of them"),
        Number("neck parted", "", 0.0, 1.0, "share of strands between gallbladder and tubes"),
        Number("triangle parted", "", 0.0, 1.0, "share of strands in the triangle"),
        Number("plate parted", "", 0.0, 1.0, "share of strands at the plate's lower third"),
        Number("progress", "", 0.0, 1.0, "the exercise's own, 1 when it is done"),
        Number("time left", "s", 0.0, MOST_SECONDS, "until the episode is truncated"),
    ),
}
"""What is observed at an anatomy: of each hand, node, mm, tube and fluid one row."""
ACTIONS = (
    Number("x", "of the speed", -1.0, 1.0, "velocity of the hand along the duct"),
    Number("y", "of the speed", -1.0, 1.0, "velocity to the side"),
    Number("z", "of the speed", -1.0, 1.0, "velocity away from the bed"),
    Number("jaws", "of the speed", -1.0, 1.0, "rate at which a dissector opens"),
    Number("grip", "", -1.0, 1.0, "above 0: hold the duct, if the tip is within 4 mm of its axis"),
    Number("use", "", -1.0, 1.0, "as it rises above 0: clip, cut; while above 0: suck"),
    Number("instrument", "", -1.0, 1.0, "a part each of those that may be taken, in order"),
)
"""What a policy sends for each hand: `use` at anatomies only, the last one only where instruments
are free to choose."""
REWARDS: dict[str, tuple[float, str]] = {
    "progress": (0.5, "growth of the exercise's progress, 0 to 1"),
    "parted": (0.5, "growth of the share of strands parted that the goal asks for, 0 to 1"),
    "time": (-0.02, "s that have passed"),
    "errors": (-0.1, "incidents that began, of every class (docs/errors.md)"),
    "stress": (-0.1, "growth of the peak stress ratio"),
    "passed": (1.0, "1 when the exercise is passed"),
    "failed": (-1.0, "1 when it is failed or the duct torn"),
}
"""Weights of the reward's terms and what each counts."""


@lru_cache(maxsize=8)
def _exercises(specimen: Specimen) -> dict[str, Exercise]:
    """Return the exercises of a specimen by name: a second's work."""
    return {each.name: each for each in exercises_offered(Session(specimen, vertices=VERTICES))}


@lru_cache(maxsize=8)
def _anatomy(name: str) -> tuple[Specimen, dict[str, Exercise]]:
    """Return an anatomy's tubes, and the exercises there by name."""
    whole = read_anatomy(Path(name)) if name.endswith(".toml") else anatomy_named(name)
    specimen = Specimen.of_anatomy(whole)
    offered = exercises_offered(Session(specimen, vertices=VERTICES))
    # A policy points at nothing: its critical view is over with the view.
    return specimen, {each.name: each.by_hands_alone() for each in offered if not each.looks_only}


@lru_cache(maxsize=32)
def _specimen(bed: str, organ: Path | None, preset: str | None) -> Specimen:
    return specimen_in_bed(
        read_organ(organ or BILE_DUCT),
        None if preset is None else preset_named(preset),
        bed_named(bed),
    )


def _lists(names: Sequence[str]) -> str:
    return ", ".join(map(repr, names))


@dataclass(frozen=True, kw_only=True)
class Task:
    """The arguments of an environment.

    Parameters
    ----------
    exercise
        Name of an exercise, "window", "follow_front" or "free_scar" in a bed; or one of your own.
    bed
        Name of a bed; the scar's exercise brings its own.
    organ, preset
        An organ file and the name of a preset; the shipped duct with the thesis's when None.
    anatomy
        Instead of these: name of an anatomy or its file, .toml; its exercise is "critical_view".
    specimen
        What is in hand, instead of all these.
    hands
        How many hands act, 1 or 2.
    instruments
        One of each hand; "free" to let the policy choose; when None, the last hand has a dissector
        if the exercise allows one, and the other a hook.
    ticks_per_step
        Ticks of 1/30 s in a step, 1 to 30.
    speed
        mm/s of a hand and of jaws at an action of 1, at most 60.
    seeds
        Seeds of beds that `reset` draws from; an anatomy has none.
    time_limit
        s after which an episode is truncated; the exercise's own when None.
    reward
        Weights of the reward's terms that differ from the usual.
    observation
        "state", "pixels" or "both".
    picture, camera
        Height and width of the pixels, 16 to 1024; where the camera is and what it looks at, mm,
        the standard view when None.
    """

    exercise: str | Exercise = "window"
    bed: str = "normal"
    organ: str | Path | None = None
    preset: str | None = None
    anatomy: str | None = None
    specimen: Specimen | None = None
    hands: int = 2
    instruments: Sequence[Instrument] | str | None = None
    ticks_per_step: int = 3
    speed: float = 20.0
    seeds: Sequence[int] = SEEDS
    time_limit: float | None = None
    reward: Mapping[str, float] | None = None
    observation: str = "state"
    picture: tuple[int, int] = (96, 96)
    camera: Pose | None = None

    def __post_init__(self) -> None:
        if not 1 <= self.hands <= HANDS:
            raise ValueError(f"hands must be 1 to {HANDS}, got {self.hands}")
        if not 1 <= self.ticks_per_step <= MOST_TICKS_PER_STEP:
            raise ValueError(
                f"ticks_per_step must be 1 to {MOST_TICKS_PER_STEP}, got {self.ticks_per_step}"
            )
        if not 0.0 < self.speed <= HAND_SPEED:
            raise ValueError(
                f"speed must be above 0 and at most {HAND_SPEED:g} mm/s, got {self.speed}"
            )
        if not self.seeds or not all(0 <= int(each) < 2**63 for each in self.seeds):
            raise ValueError(f"seeds must be one or more from 0 to below 2^63, got {self.seeds}")
        limit = self.time_limit
        if limit is not None and not 0.0 < limit <= MOST_SECONDS:
            raise ValueError(
                f"time_limit must be above 0 and at most {MOST_SECONDS:g} s, got {limit}"
            )
        if self.observation not in ("state", PIXELS, "both"):
            raise ValueError(
                f"observation must be 'state', 'pixels' or 'both', got {self.observation!r}"
            )
        if len(self.picture) != 2 or not all(16 <= each <= MOST_PIXELS for each in self.picture):
            raise ValueError(f"picture must be two of 16 to {MOST_PIXELS}, got {self.picture}")
        for name, weight in (self.reward or {}).items():
            if name not in REWARDS:
                raise ValueError(f"reward has {name!r}; its terms are {_lists(list(REWARDS))}")
            if not math.isfinite(weight):
                raise ValueError(f"reward's {name} must be a finite number, got {weight}")
        _ = self.goal, self.view(*self.picture)  # they look whether they make sense
        allowed, chosen = self.asked.instruments, self.instruments
        if chosen is not None and chosen != "free":
            if isinstance(chosen, str) or len(chosen) != self.hands:
                raise ValueError(f"instruments must be one of each hand or 'free', got {chosen!r}")
            for each in chosen:
                if each not in allowed:
                    raise ValueError(f"{each!r} is not allowed here; there are {_lists(allowed)}")

    @cached_property
    def duct(self) -> Specimen:
        """What is in hand."""
        if self.specimen is not None:
            return self.specimen
        if self.anatomy is not None:
            return _anatomy(self.anatomy)[0]
        organ = None if self.organ is None else Path(self.organ)
        return _specimen(self.bed, organ, self.preset)

    @cached_property
    def asked(self) -> Exercise:
        """The exercise."""
        if isinstance(self.exercise, Exercise):
            return self.exercise
        where = f"in a {self.bed} bed"
        if self.anatomy is None:
            offered = _exercises(self.duct)
        else:
            where, offered = f"at the anatomy {self.anatomy}", _anatomy(self.anatomy)[1]
        if self.exercise not in offered:
            raise ValueError(
                f"exercise must be one of {_lists(list(offered))} {where}, got {self.exercise!r}"
            )
        return offered[self.exercise]

    @cached_property
    def goal(self) -> FreeLength | None:
        """The length that the exercise asks for; None at an anatomy, for the critical view."""
        goal = self.asked.goal
        if self.several:
            return None
        if self.asked.opening is None or not isinstance(goal, FreeLength):
            raise ValueError(f"{self.asked.title} is not about freeing a duct from a bed")
        return goal

    @cached_property
    def several(self) -> bool:
        """Whether there are several tubes, of an anatomy."""
        return self.duct.anatomy is not None

    @cached_property
    def known(self) -> tuple[Instrument, ...]:
        """The instruments that are observed."""
        return ALL_INSTRUMENTS if self.several else INSTRUMENTS

    @cached_property
    def observed(self) -> dict[str, tuple[Number, ...]]:
        """What is observed."""
        return AT_ANATOMY if self.several else OBSERVATIONS

    @cached_property
    def free_choice(self) -> bool:
        """Whether the policy chooses instruments."""
        return self.instruments == "free"

    @cached_property
    def first_instruments(self) -> tuple[Instrument, ...]:
        """The instrument of each hand at first."""
        if self.instruments is not None and not isinstance(self.instruments, str):
            return tuple(self.instruments)
        last: Instrument = "dissector" if "dissector" in self.asked.instruments else HOLDING[-1]
        return (*(HOLDING[:1] * (self.hands - 1)), last)

    @cached_property
    def limit_ticks(self) -> int:
        """Ticks of an episode."""
        return max(1, round((self.time_limit or self.asked.time_limit_s) * TICKS_PER_SECOND))

    @cached_property
    def weights(self) -> dict[str, float]:
        """The reward's weights, by term."""
        return {name: weight for name, (weight, _) in REWARDS.items()} | dict(self.reward or {})

    @cached_property
    def spans(self) -> tuple[float, ...]:
        """Length of each tube, mm."""
        if not self.several:
            return (self.duct.beam.span,)
        tubes = self.duct.tubes(elements=ELEMENTS)
        return tuple(each.beam.span for each in tubes.dissections)

    @cached_property
    def bins(self) -> tuple[NDArray[np.float64], ...]:
        """(B,) middles of each tube's mm at which strands are observed, mm."""
        return tuple(np.arange(max(1, round(span)), dtype=np.float64) + 0.5 for span in self.spans)

    @cached_property
    def within(self) -> NDArray[np.bool_]:
        """(B,) whether those of a duct in its bed are within the goal."""
        goal = self.goal
        assert goal is not None  # noqa: S101 (an anatomy has no bins to free)
        return (self.bins[0] >= goal.from_mm) & (self.bins[0] <= goal.to_mm)

    def view(self, height: int, width: int) -> Camera:
        """Return the camera, for pictures of a size."""
        pose = self.camera
        if pose is None and self.several:
            places = self.duct.tubes(elements=ELEMENTS).network.tubes.values()
            middle = np.concatenate([each.places for each in places]).mean(axis=0)
            away = middle + AWAY_ANATOMY_MM * TOWARDS_VIEWER
            pose = tuple(away.tolist()), tuple(middle.tolist())
        return Camera(height, width, self.duct.beam.span, pose)

    @cached_property
    def actions(self) -> int:
        """Numbers of an action for each hand."""
        return len(self.acted)

    @cached_property
    def acted(self) -> tuple[str, ...]:
        """Their names."""
        left_out = {"" if self.several else "use", "" if self.free_choice else "instrument"}
        return tuple(each.name for each in ACTIONS if each.name not in left_out)

    @property
    def size(self) -> int:
        """Numbers of an action: hand after hand."""
        return self.hands * self.actions

    @property
    def action_space(self) -> spaces.Box:
        """The space of a policy's actions."""
        return spaces.Box(-1.0, 1.0, (self.size,), np.float32)

    @property
    def steps_per_second(self) -> int:
        """Steps in a second of the duct's time, to a whole number."""
        return max(1, round(TICKS_PER_SECOND / self.ticks_per_step))

    def bounds(self, tissue: SpatialTissue) -> dict[str, tuple[NDArray[Any], NDArray[Any]]]:
        """Return the smallest and largest observations of a tissue, by key."""
        span = max(self.spans)
        rows = {
            "hands": self.hands,
            "duct": len(tissue.beam.places),
            "tubes": len(self.spans),
            "fluids": len(tissue.fluids),
        }
        flat = {"strands": sum(each.size for each in self.bins)}
        found: dict[str, tuple[NDArray[Any], NDArray[Any]]] = {}
        for key, numbers in self.observed.items() if self.observation != PIXELS else ():
            low = np.array([each.low for each in numbers], np.float32)
            high = np.array([each.high + span * each.with_span for each in numbers], np.float32)
            shape = (rows[key], 1) if key in rows else flat.get(key, 1)
            found[key] = np.tile(low, shape), np.tile(high, shape)
        if self.observation != "state":
            pixels = np.zeros((*self.picture, 3), np.uint8)
            found[PIXELS] = pixels, pixels + np.uint8(255)
        return found

    def seeded(self, bed_seed: int) -> Exercise:
        """Return the exercise in the bed of another seed; its limits are those of an even bed."""
        assert self.asked.opening is not None  # noqa: S101 (`goal` has looked)
        opening: Opening = self.asked.opening
        if not self.several:
            opening = msgspec.structs.replace(opening, bed_seed=bed_seed)
        limit = self.time_limit or self.asked.time_limit_s
        return msgspec.structs.replace(self.asked, opening=opening, time_limit_s=limit)
