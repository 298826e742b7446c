"""Goals of exercises, as data, and how far an attempt has come with one."""

import math
from collections.abc import Sequence
from typing import ClassVar, Literal, Protocol

import msgspec

from app.anatomy import tube_title
from app.simulation.exercises.critical_view import MOST_POINTS, Closing
from app.simulation.exercises.metrics import Metrics
from app.simulation.exercises.metrics_recorder import MetricsRecorder
from app.simulation.inputs.clock import TICK_SECONDS
from app.simulation.inputs.inputs import STRUCTURES, Structure
from app.simulation.specimen.grasped_beam import GraspedBeam

MOST_REPEATS = 100
VIEW_TICKS, MOST_CLIPS = 10, 4
LOST_MM = 3.0
"""mm freed where the exercise does not ask for it, from which on that is worth a word."""
Span = tuple[float, float]


class Followed(Protocol):
    """How far an attempt has come."""

    progress: float  # 0 to 1
    standing: str  # what to do now, in a few words
    so_far: str  # what there is of the goal, as it follows 'with'

    def take(self, recorder: MetricsRecorder) -> bool:
        """Take a tick whose measures are taken; return whether the goal is reached."""
        ...


class Stay(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True,
    tag_field="kind", tag="stay",
):  # fmt: skip
    """Hold the duct with a quantity between two values for a time, once or several times."""

    quantity: Literal["deflection_mm", "distance_to_break"]
    low: float
    high: float
    seconds: float  # without leaving the band
    repeats: int = 1
    return_below: float | None = None  # mm: led back by hand to this deflection after each

    def __post_init__(self) -> None:
        most = math.inf if self.quantity == "deflection_mm" else 1.0
        if not 0.0 <= self.low < self.high < most:
            raise ValueError(
                f"low and high of {self.quantity} must rise from 0 and be below {most:g}, "
                f"got {self.low} and {self.high}"
            )
        if not 0.0 < self.seconds < math.inf:
            raise ValueError(f"seconds must be above 0 and finite, got {self.seconds}")
        if not 1 <= self.repeats <= MOST_REPEATS:
            raise ValueError(f"repeats must be from 1 to {MOST_REPEATS}, got {self.repeats}")
        back = self.return_below
        if back is None and self.repeats > 1:
            raise ValueError("return_below must be given where repeats is above 1")
        if back is not None and not (self.quantity == "deflection_mm" and 0.0 < back < self.low):
            raise ValueError(
                f"return_below must be a deflection above 0 and below low, {self.low} mm, "
                f"got {back}"
            )

    @property
    def words(self) -> str:
        """What to do, as a sentence begins."""
        where = f"{self.low:.1f} to {self.high:.1f} mm"
        often = f" {self.repeats} times" if self.repeats > 1 else ""
        back = "" if self.return_below is None else ", and lead it back by hand"
        if self.quantity == "deflection_mm":
            return f"Lift the duct{often} to {where}, keep it there for {self.seconds:g} s{back}"
        return (
            f"Bring the distance to break down to {100.0 * self.high:.0f} % or less{often} and "
            f"keep it there for {self.seconds:g} s"
        )

    @property
    def least_seconds(self) -> float:
        """The least time that it takes, s."""
        return self.repeats * self.seconds

    @property
    def band(self) -> Span | None:
        """Deflections between which it lies wherever the duct is held, mm, or None."""
        return (self.low, self.high) if self.quantity == "deflection_mm" else None

    def band_on(self, duct: GraspedBeam) -> Span | None:
        """Return the deflections between which it lies as the duct is held, mm, or None."""
        event = duct.breaks_at
        if self.band is not None or event is None:
            return self.band
        near = duct.load_at(1.0 - self.high)
        return None if near is None else (near.deflection, event.deflection)

    def follow(self) -> Followed:
        """Return what follows an attempt."""
        return _Staying(self)

    def reached(self, metrics: Metrics) -> str:
        """Return how it was reached, in a sentence."""
        often = f", {self.repeats} times" if self.repeats > 1 else ""
        back = " and led back" if self.return_below is not None else ""
        most, left = metrics["maximum_force_N"], metrics["smallest_distance_to_break"]
        return (
            f"Kept there for {self.seconds:g} s{often}{back}, with at most {most:.3g} N and "
            f"{100.0 * left:.1f} % left to the break."
        )


class _Staying:
    """Counts the time for which the quantity has been in the band without a break."""

    def __init__(self, goal: Stay) -> None:
        self._goal, self._wanted = goal, max(1, round(goal.seconds / TICK_SECONDS))
        self._rest, self._edge = (
            (0.0, goal.low) if goal.quantity == "deflection_mm" else (1.0, goal.high)
        )
        self._done = self._ticks = self._longest = 0
        self._near = 0.0  # how far it has come on its way to the band, 0 to 1
        self._back = False  # whether it was there long enough and is to be led back
        self._holds, self._led = 0, True  # how many, and whether the last one has led it there
        self._show()

    def take(self, recorder: MetricsRecorder) -> bool:
        """Take a tick; return whether the goal is reached."""
        goal = self._goal
        value: float = getattr(recorder, goal.quantity)
        if self._done == goal.repeats:
            return True
        inside = goal.low <= value <= goal.high
        # Held elsewhere it has another deflection and another stress, although no hand has led it;
        # and what was released has sprung back.
        if recorder.holds != self._holds:
            self._led, self._holds = self._holds == 0, recorder.holds
            self._back, self._ticks = False, 0
        elif not recorder.held:
            self._back = False
        self._led |= not inside
        if self._back:
            if recorder.deflection_mm <= (goal.return_below or 0.0):
                self._next()
        else:
            approach = (value - self._rest) / (self._edge - self._rest) if self._edge else 1.0
            self._near = max(self._near, min(approach, 1.0))
            there = recorder.held and self._led and inside
            self._ticks = min(self._ticks + 1, self._wanted) if there else 0
            self._longest = max(self._longest, self._ticks)
            if self._ticks == self._wanted:
                if goal.return_below is None:
                    self._next()
                else:
                    self._back = True
        self._show()
        return self._done == goal.repeats

    def _next(self) -> None:
        self._done, self._ticks, self._back = self._done + 1, 0, False
        if self._done < self._goal.repeats:
            self._near, self._longest = 0.0, 0

    def _show(self) -> None:
        goal = self._goal
        if self._done == goal.repeats:
            self.progress, self.standing, self.so_far = 1.0, "", ""
            return
        fraction = 0.5 * self._near + 0.5 * self._ticks / self._wanted
        if goal.return_below is not None:
            fraction *= 0.8
        self.progress = (self._done + fraction) / goal.repeats
        seconds = (self._wanted - self._ticks) * TICK_SECONDS
        if self._back:
            what = "lead it back"
        elif self._ticks:
            what = f"keep it, {seconds:.1f} s to go"
        elif not self._led:
            what = "out of the band, and into it with this hold"
        else:
            what = "into the band"
        self.standing, self.so_far = what, f"it held {self._held():.1f} of {goal.seconds:g} s"
        if goal.repeats > 1:
            self.standing = f"Lift {self._done + 1} of {goal.repeats}: {what}"
            self.so_far = f"{self._done} of {goal.repeats} lifts done"

    def _held(self) -> float:
        return self._longest * TICK_SECONDS


class FreeLength(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True,
    tag_field="kind", tag="free_length",
):  # fmt: skip
    """Free a length of duct from what it lies in."""

    length_mm: float  # that is to be free between `from_mm` and `to_mm`
    from_mm: float  # from the first clamp
    to_mm: float
    one_stretch: bool = False  # whether it is of one free stretch, or of all

    def __post_init__(self) -> None:
        if not 0.0 <= self.from_mm < self.to_mm < math.inf:
            raise ValueError(f"from_mm and to_mm must rise, got {self.from_mm} and {self.to_mm}")
        if not 0.0 < self.length_mm <= self.to_mm - self.from_mm:
            raise ValueError(
                f"length_mm must be above 0 and within from_mm to to_mm, "
                f"{self.to_mm - self.from_mm:g} mm, got {self.length_mm}"
            )

    least_seconds = TICK_SECONDS
    band: ClassVar[Span | None] = None

    def band_on(self, duct: GraspedBeam) -> Span | None:
        """None: it is no deflection."""

    @property
    def words(self) -> str:
        """What to do, as a sentence begins."""
        where = " in one stretch" if self.one_stretch else ""
        return f"Free {self.length_mm:.0f} mm of the duct{where}"

    def freed(self, stretches: list[Span]) -> float:
        """Return the length that is free within the goal's ends, mm: of all stretches or of one."""
        inside = [min(b, self.to_mm) - max(a, self.from_mm) for a, b in stretches]
        return (max if self.one_stretch else sum)([0.0, *(each for each in inside if each > 0.0)])

    def follow(self) -> Followed:
        """Return what follows an attempt."""
        return _Freeing(self)

    def reached(self, metrics: Metrics) -> str:
        """Return how it was reached, in a sentence."""
        freed, peak = metrics["freed_mm"], metrics["peak_stress_ratio"]
        return (
            f"Freed the {self.length_mm:.0f} mm asked for, {freed:.0f} mm in all, at no more than "
            f"{100.0 * peak:.0f} % of the wall's break."
        )


class _Freeing:
    """Measures how much is free of what is asked for."""

    def __init__(self, goal: FreeLength) -> None:
        self._goal, self._before = goal, -1.0
        self._seen: list[Span] | None = None
        self._reached = False
        self._holding: tuple[int, float] | None = None
        self._show(0.0, 0.0)

    def take(self, recorder: MetricsRecorder) -> bool:
        """Take a tick; return whether the goal is reached."""
        stretches, goal = recorder.stretches, self._goal
        if stretches is self._seen:
            return self._reached
        self._seen = stretches
        total, freed = sum(b - a for a, b in stretches), goal.freed(stretches)
        if self._before < 0.0:
            self._before = total - freed  # a divided duct's end is free at the start
        self._holding = recorder.holding_beside(goal.from_mm, goal.to_mm)
        self._show(freed, total - freed - self._before)
        # Bins are whole, so lengths differ from the goal by rounding only.
        self._reached = freed >= goal.length_mm - 1e-6
        return self._reached

    def _show(self, freed: float, elsewhere: float) -> None:
        goal = self._goal
        where = " in one stretch" if goal.one_stretch else ""
        self.progress = min(freed / goal.length_mm, 1.0)
        self.standing = self.so_far = f"{freed:.0f} of {goal.length_mm:.0f} mm free{where}"
        if elsewhere >= LOST_MM:
            self.so_far += f"; {elsewhere:.0f} mm elsewhere do not count"
        if self._holding is not None and freed < goal.length_mm:
            strands, station = self._holding
            hold = "strands hold" if strands > 1 else "strand holds"
            self.standing += f"; {strands} {hold} at {station:.0f} mm"


class BreakApart(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="break_apart"
):
    """Tear the duct. Not offered: a limit of the force-time product rewards a quick pull."""

    words = "Tear the duct"
    least_seconds = TICK_SECONDS
    band: ClassVar[Span | None] = None

    def band_on(self, duct: GraspedBeam) -> Span | None:
        """None: the goal is a tear."""

    def follow(self) -> Followed:
        """Return what follows an attempt."""
        return _Breaking()

    def reached(self, metrics: Metrics) -> str:
        """Return how it was reached, in a sentence."""
        return f"Torn with {metrics['force_time_product_N_s']:.3g} N s."


class _Breaking:
    """Waits for the tear."""

    def __init__(self) -> None:
        self.progress, self.standing, self.so_far = 0.0, "", "the duct whole"

    def take(self, recorder: MetricsRecorder) -> bool:
        """Take a tick; return whether the goal is reached."""
        distance = 0.0 if recorder.torn else recorder.distance_to_break
        self.progress = min(max(1.0 - distance, 0.0), 1.0)
        return recorder.torn


class CriticalView(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True,
    tag_field="kind", tag="critical_view",
):  # fmt: skip
    """Free what must be free before anything is clipped: the critical view of safety."""

    points: int  # of 6
    # Then each structure that enters the gallbladder is marked, and divided between so many clips
    # on the side that stays and on that which goes; with none it ends with the view.
    stay: int = 0
    go: int = 0

    least_seconds = TICK_SECONDS
    band: ClassVar[Span | None] = None

    def __post_init__(self) -> None:
        if not 1 <= self.points <= MOST_POINTS:
            raise ValueError(f"points must be from 1 to {MOST_POINTS}, got {self.points}")
        for name, count in (("stay", self.stay), ("go", self.go)):
            if not 0 <= count <= MOST_CLIPS:
                raise ValueError(f"{name} must be from 0 to {MOST_CLIPS} clips, got {count}")

    def band_on(self, duct: GraspedBeam) -> Span | None:
        """None: it is no deflection."""

    @property
    def words(self) -> str:
        """What to do, as a sentence begins."""
        view = f"Reach {self.points} of {MOST_POINTS} points of the critical view of safety"
        if not self.closes:
            return view
        return (
            f"{view}, mark the cystic duct and the artery by pointing, and divide each between "
            f"clips, {self.stay} to stay and {self.go} to go"
        )

    @property
    def structures(self) -> tuple[Structure, ...]:
        """What is to be pointed at."""
        return ("cystic duct", "cystic artery") if self.closes else ()

    @property
    def closes(self) -> bool:
        """Whether structures are marked and divided once the view is reached."""
        return self.stay + self.go > 0

    def follow(self) -> Followed:
        """Return what follows an attempt."""
        return _Viewing(self)

    def reached(self, metrics: Metrics) -> str:
        """Return how it was reached, in a sentence."""
        then = ", marked both structures and divided them between clips" if self.closes else ""
        return (
            f"Reached {self.points} of {MOST_POINTS} points with nothing torn{then}, at no more "
            f"than {100.0 * metrics['peak_stress_ratio']:.0f} % of a wall's break."
        )


class _Viewing:
    """Judges the critical view, three times a second, and then how structures are closed."""

    def __init__(self, goal: CriticalView) -> None:
        self._goal, self._ticks, self._points = goal, 0, 0
        self._show(0.0, [])

    def take(self, recorder: MetricsRecorder) -> bool:
        """Take a tick; return whether the goal is reached."""
        if self._points >= self._goal.points:  # what is divided is no part of the view any more
            return self._close(recorder.closings())
        if self._ticks % VIEW_TICKS == 0:
            view = recorder.critical_view()
            self._points = view.total
            self._show(view.towards(self._goal.points), view.checklist())
        self._ticks += 1
        if self._points < self._goal.points:
            return False
        return self._close(recorder.closings()) if self._goal.closes else True

    def _close(self, closings: Sequence[Closing]) -> bool:
        """Say what is to be done with each structure; return whether all is."""
        goal = self._goal
        steps = left = 0
        words: list[str] = []
        for each in closings:
            name = tube_title(each.tube)
            # Before it is divided, no clip is on either side yet.
            clipped = min(each.stay, goal.stay) + min(each.go, goal.go)
            if not each.divided:
                clipped = min(each.stay, goal.stay + goal.go)
            missing = goal.stay + goal.go - clipped
            steps += 2 + goal.stay + goal.go
            left += missing + (not each.marked) + (not each.divided)
            if not each.marked:
                words.append(f"mark the {name}")
            elif missing:
                words.append(f"clip the {name}, {clipped} of {goal.stay + goal.go} clips")
            elif not each.divided:
                words.append(f"divide the {name}, {goal.stay} clips stay and {goal.go} go")
        self.progress = 0.5 + 0.5 * (1.0 - left / steps) if steps else 1.0
        self.so_far = self.standing = f"the view reached; {'; '.join(words)}" if words else ""
        return not left

    def _show(self, progress: float, checklist: Sequence[str]) -> None:
        asked = self._goal.points
        self.progress = (0.5 if self._goal.closes else 1.0) * progress
        self.so_far = f"{self._points} of {MOST_POINTS} points, {asked} asked"
        self.standing = "; ".join([self.so_far, *checklist])


class StopBleeding(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="stop_bleeding"
):
    """Stop the blood that flows out of a tube, for a time."""

    seconds: float  # for which none may flow

    def __post_init__(self) -> None:
        if not 0.0 < self.seconds < math.inf:
            raise ValueError(f"seconds must be above 0 and finite, got {self.seconds}")

    band: ClassVar[Span | None] = None

    @property
    def least_seconds(self) -> float:
        """The least time that it takes, s."""
        return self.seconds

    def band_on(self, duct: GraspedBeam) -> Span | None:
        """None: it is no deflection."""

    @property
    def words(self) -> str:
        """What to do, as a sentence begins."""
        return f"Stop the bleeding, and see that it stays stopped for {self.seconds:g} s"

    def follow(self) -> Followed:
        """Return what follows an attempt."""
        return _Stopping(self)

    def reached(self, metrics: Metrics) -> str:
        """Return how it was reached, in a sentence."""
        return f"Stopped the bleeding with {metrics['blood_lost_ml']:.0f} ml of blood lost."


class _Stopping:
    """Counts the time for which no blood has flowed."""

    def __init__(self, goal: StopBleeding) -> None:
        self._wanted, self._ticks = max(1, round(goal.seconds / TICK_SECONDS)), 0
        self._bled = False
        self.progress, self.standing = 0.0, "it bleeds from your first touch on"
        self.so_far = "the bleeding going on"

    def take(self, recorder: MetricsRecorder) -> bool:
        """Take a tick; return whether the goal is reached."""
        # The tube tears with the first touch, and bleeds from the tick after it.
        self._bled |= recorder.bleeds
        self._ticks = 0 if recorder.bleeds or not self._bled else self._ticks + 1
        self.progress = min(self._ticks / self._wanted, 1.0)
        left = (self._wanted - self._ticks) * TICK_SECONDS
        self.standing = f"stopped, {left:.1f} s to go" if self._ticks else "it bleeds"
        self.so_far = "the bleeding " + ("just stopped" if self._ticks else "going on")
        return self._ticks >= self._wanted


class WhoIsWho(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True,
    tag_field="kind", tag="who_is_who",
):  # fmt: skip
    """Name the structures of a picture, or say that too little is seen of them."""

    points: int = 5  # of the critical view, from which on it is safe to tell

    least_seconds = TICK_SECONDS
    band: ClassVar[Span | None] = None
    structures: ClassVar[tuple[Structure, ...]] = STRUCTURES
    words = (
        "Point at the cystic duct, the cystic artery and the common duct, or say that it is not "
        "yet safe to tell"
    )

    def __post_init__(self) -> None:
        if not 1 <= self.points <= MOST_POINTS:
            raise ValueError(f"points must be from 1 to {MOST_POINTS}, got {self.points}")

    def band_on(self, duct: GraspedBeam) -> Span | None:
        """None: it is no deflection."""

    def follow(self) -> Followed:
        """Return what follows an attempt."""
        return _Naming()

    def reached(self, metrics: Metrics) -> str:
        """Return how it was reached, in a sentence."""
        points = metrics["critical_view_points"]
        of = f"{points} of {MOST_POINTS} points of the critical view"
        if points >= self.points:
            return f"All three named as what they are, which is safe with {of}."
        return f"Not yet safe to tell, with {of}."


class _Naming:
    """Waits until all structures are named, or it is called unsafe."""

    def __init__(self) -> None:
        self._show(0)

    def take(self, recorder: MetricsRecorder) -> bool:
        """Take a tick; return whether the goal is reached."""
        self._show(len(recorder.named))
        return recorder.called_unsafe or self.progress == 1.0

    def _show(self, count: int) -> None:
        self.progress = count / len(STRUCTURES)
        self.standing = self.so_far = f"{count} of {len(STRUCTURES)} pointed at"


Goal = WhoIsWho | Stay | FreeLength | BreakApart | CriticalView | StopBleeding
"""What an exercise asks for. Each has `words`, `band`, `least_seconds`, and follows attempts."""
