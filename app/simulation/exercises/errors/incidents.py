"""Incidents: errors that were made in a run, found tick by tick, and what came of each."""

import math
from collections.abc import Iterable, Mapping
from typing import Literal

import msgspec

from app.simulation.exercises.errors.classes import CLOSED_AFTER, ERROR_CLASSES, Conditions
from app.simulation.exercises.errors.older_values import with_present_names
from app.simulation.inputs.clock import TICK_SECONDS

Consequence = Literal["none", "near miss", "minor", "injury"]
"""Measured, up to 1 s after an incident. Near miss: the stress passed the exercise's limit, or the
break was nearer than a reaction time; minor: strands parted out of sight, or a wall tore in part;
injury: a tube tore, or leaks. A bleeding is minor up to 2 ml of blood, and an injury beyond."""
CONSEQUENCES: tuple[Consequence, ...] = ("none", "near miss", "minor", "injury")
Values = dict[str, float | str]

CLOSED_TICKS = round(CLOSED_AFTER / TICK_SECONDS)
FOLLOWED_TICKS = round(1.0 / TICK_SECONDS)
"""Ticks after an incident in which what happens is its consequence, or has it for a cause."""


class Incident(msgspec.Struct, frozen=True):
    """An error that was made: when, by which hand, where, with what consequence."""

    error: str  # key of its class
    start_s: float  # from the start of the run
    end_s: float
    hand: int | None
    tube: int  # number of the tube; 0 of a duct alone
    station_mm: float | None  # on it, from the first clamp
    consequence: Consequence
    values: Values  # of its worst tick

    @property
    def happened(self) -> str:
        """What was done and where: a clause without a full stop."""
        # Older runs have neither a pull's side nor what strained a vessel.
        known = {"to": "", "by": "", **self.values}
        return ERROR_CLASSES[self.error].happened.format(t=self.start_s, **known)

    @property
    def sentence(self) -> str:
        """What was done, where, and what to do instead."""
        return f"{self.advice[0].upper()}{self.advice[1:]}"

    @property
    def advice(self) -> str:
        """The same, as it follows a colon."""
        return f"{self.happened}. {self.instead}"

    @property
    def instead(self) -> str:
        """What to do instead: its own, where it is known what it came of, else its class's."""
        own = self.values.get("instead")
        return str(own) if own else ERROR_CLASSES[self.error].instead.format(**self.values)


def read_incidents(content: str | None) -> list[Incident]:
    """Return a run's incidents from JSON; none of a run of before they were kept."""
    return [
        msgspec.structs.replace(each, values=with_present_names(each.error, each.values))
        for each in msgspec.json.decode(content or "[]", type=list[Incident])
    ]


def cause_of(incidents: Iterable[Incident], seconds: float) -> Incident | None:
    """Return what a failure at a time, s, is put down to.

    Returns
    -------
    Incident | None
        Of the last second, the first by the order of `ERROR_CLASSES`; one that is a result only
        where no other error began before it or with it. A tear explains nothing, unless it says
        what did it: then it stands before all.
    """
    recent = [
        each
        for each in incidents
        if (each.error != "tear" or each.values.get("instead"))
        and round((seconds - each.end_s) / TICK_SECONDS) <= FOLLOWED_TICKS
    ]
    for each in recent:
        if each.error == "tear":
            return each
    acts = (each.start_s for each in recent if not ERROR_CLASSES[each.error].is_result)
    first, rank = min(acts, default=math.inf), list(ERROR_CLASSES)
    causes = [
        each for each in recent if each.start_s < first or not ERROR_CLASSES[each.error].is_result
    ]
    return min(causes, key=lambda each: rank.index(each.error), default=None)


class _Open:
    """An incident that may go on."""

    __slots__ = (
        "consequence", "end", "error", "hand", "start", "station", "tube", "values", "worst",
    )  # fmt: skip

    def __init__(
        self, error: str, tick: int, hand: int | None, station: float | None, tube: int
    ) -> None:
        self.error, self.hand, self.station, self.tube = error, hand, station, tube
        self.start = self.end = tick
        self.worst = -math.inf
        self.values: Values = {}
        self.consequence = 0


class Incidents:
    """The incidents of a run so far.

    `number` has how many there are of each class, `total` of all. `limits` are parameters by class
    and key, without a tissue only those that are not derived from one. `named` has the keys of
    those that an exercise names, `ignored` of those that count only if they are named. `followed`
    are those of the last second, of which something may still come.
    """

    def __init__(self, tissue: Conditions | None, named: Mapping[str, float]) -> None:
        self.limits = {
            each.key: {
                parameter.key: parameter.of(tissue)
                for parameter in each.parameters
                if tissue is not None or not callable(parameter.value)
            }
            for each in ERROR_CLASSES.values()
        }
        self.ignored = tuple(
            each.key for each in ERROR_CLASSES.values() if each.if_named and each.key not in named
        )
        self.number: dict[str, int] = {}
        self.total = 0
        self.tick = 0
        self._all: list[_Open] = []
        self._open: dict[tuple[str, int | None, int | None], _Open] = {}
        self.followed: list[_Open] = []

    def note(
        self,
        error: str,
        hand: int | None,
        station: float | None,
        severity: float = 0.0,
        parted: int | None = None,
        tube: int = 0,
        consequence: Consequence = "none",
        **values: float | str,
    ) -> None:
        """Note that a class's condition holds in this tick; the severest tick's values are kept.

        `parted` strands are added up over the incident, as the value `strands`.
        """
        if error in self.ignored:
            return
        key = error, hand, None if ERROR_CLASSES[error].past_tubes else tube
        found = self._open.get(key)
        if found is None or self.tick - found.end > CLOSED_TICKS:
            found = self._open[key] = _Open(error, self.tick, hand, station, tube)
            self._all.append(found)
            self.followed.append(found)
            self.number[error] = self.number.get(error, 0) + 1
            self.total += 1
        elif self.tick - found.end > FOLLOWED_TICKS:
            self.followed.append(found)
        found.end = self.tick
        found.consequence = max(found.consequence, CONSEQUENCES.index(consequence))
        total = found.values.get("strands", 0.0)
        if severity >= found.worst:
            found.worst, found.station = severity, station
            what = found.values.get("what", values.get("what"))  # of the first tube
            found.values.update(values if what is None else values | {"what": what})
        if parted is not None and isinstance(total, float | int):
            found.values["strands"] = total + parted

    def end_tick(self, consequence: Consequence) -> None:
        """Put what happened in this tick down to the incidents of the last second."""
        level = CONSEQUENCES.index(consequence)
        self.followed = [each for each in self.followed if self.tick - each.end <= FOLLOWED_TICKS]
        for each in self.followed:
            each.consequence = max(each.consequence, level)

    def all(self) -> list[Incident]:
        """Return all incidents, in the order in which they began."""
        return [self._incident(each) for each in self._all]

    def cause(self) -> Incident | None:
        """Return what a failure in this tick is put down to: an incident of the last second."""
        return cause_of(self.all(), self.tick * TICK_SECONDS)

    def last_of(self, error: str) -> Incident:
        """Return the last incident of a class of which there is one."""
        return self._incident([each for each in self._all if each.error == error][-1])

    def _incident(self, found: _Open) -> Incident:
        return Incident(
            error=found.error,
            start_s=found.start * TICK_SECONDS,
            end_s=found.end * TICK_SECONDS,
            hand=found.hand,
            tube=found.tube,
            station_mm=None if found.station is None else float(found.station),
            consequence=CONSEQUENCES[found.consequence],
            # Finders give numpy's numbers too, which no file can hold.
            values={
                key: value if isinstance(value, str | int) else float(value)
                for key, value in found.values.items()
            },
        )
