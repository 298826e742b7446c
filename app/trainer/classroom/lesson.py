"""A class at work: its pages, the exercise that is set, and the saving of every run."""

import contextlib
import html
import logging
import sqlite3
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple
from uuid import uuid4
from weakref import WeakKeyDictionary

import msgspec
import viser

from app.anatomy import anatomy_named
from app.classroom.class_course import ClassCourse
from app.classroom.exercise_file import AssignedExercise, read_exercise
from app.classroom.progress import Try, next_level
from app.classroom.recorder import Recorder
from app.classroom.results import Result, best, results, shown_names, standing
from app.classroom.store import Assignment, ClassStore, Person, RunRecord, Statement, now
from app.classroom.xapi import voiding
from app.classroom.xapi_sender import (
    Sender,
    class_statements,
    connect,
    disconnect,
    queue_kept,
)
from app.simulation import (
    Exercise,
    Preset,
    Run,
    RunFile,
    Session,
    default_preset,
    preset_named,
    read_run,
    run_json,
)
from app.trainer.classroom.class_card import Card, ClassCard
from app.trainer.classroom.live import Live, live
from app.trainer.client.practice import OLDER_NAMES, SceneName
from app.trainer.panel.frame import LEARN
from app.trainer.panel.result_page import run_title
from app.trainer.view.page_view import PageView
from app.trainer.viser_bridge.page import asked_by_address, open_tab
from organ_geometry import Organ

log = logging.getLogger(__name__)

LOOK_SECONDS = 1.0
# s between two savings of a run that goes on: a kill costs no more of it.
SAVE_SECONDS = 5.0
PATIENCE = 200.0
"""Times that a saving has taken, until the next."""
SAVING, SAVED = "Saving ...", "Saved"


class Row(msgspec.Struct, frozen=True):
    """A person in the teacher's list; `live` is None for who is not here."""

    id: str
    name: str
    live: Live | None
    tries: int
    best: str
    problem: str  # why a result is not saved, if it is not


@dataclass(slots=True, eq=False)
class _Member:
    """A page of a trainee."""

    view: PageView
    browser: str
    person: Person | None
    card: ClassCard
    saved: str = ""
    problem: str = ""
    last: str = ""
    saved_at: float = 0.0
    save_after: float = SAVE_SECONDS
    # of the course that was put on the duct, its exercise, and the seed of bed or anatomy
    level: tuple[str, Exercise, int | None] | None = None
    busy: bool = False  # whether an exercise waited or went on at the last look
    lock: threading.Lock = field(default_factory=threading.Lock)  # while a duct is put there


class _Identity(NamedTuple):
    """What a run is kept as from its first saving on."""

    id: str
    started_at: str
    level: str | None  # of the course, that it is a try at
    seed: int | None  # of its bed or anatomy


@dataclass(frozen=True, slots=True)
class WatchRequest:
    """What the teacher's page is asked to show: somebody's duct, or a run again."""

    scene: SceneName
    begin: Callable[[PageView], object]


class Lesson:
    """A class at work. Its methods may be called by any thread.

    `organ` and `preset` are what an exercise is done on where its file names no other; `version`
    grows with each new result.
    """

    def __init__(self, store: ClassStore, organ: Organ, preset: Preset | None = None) -> None:
        self.store, self._organ, self._preset = store, organ, preset
        self.course = ClassCourse(store, self._going)
        self.version = 0
        self._recorder = Recorder(store, self._statements)
        self.sender = Sender(store)
        self._lock = threading.RLock()
        self._members: dict[PageView, _Member] = {}
        # By the run, so that a run keeps its identity in whatever page it goes on.
        self._ids: WeakKeyDictionary[Run, _Identity] = WeakKeyDictionary()
        self._found: tuple[int, list[Result]] = -1, []
        self._read_tries: tuple[int, dict[str, list[Try]]] = -1, {}
        self._assignment: Assignment | None = None
        self._asked: AssignedExercise | None = None
        self._take_assignment(store.assignment())
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._look, name="class", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Save what goes on and close the class."""
        self._stopping.set()
        self._thread.join(LOOK_SECONDS)
        for member in self._all():
            self._save_unfinished(member)
        self._recorder.stop()
        self.sender.stop()
        self.store.close()

    # Pages of trainees

    def add_card(self, browser: str, view: PageView) -> None:
        """Add the class to a trainee's page, whenever its panel has been made."""
        card = ClassCard(
            view.client.gui,
            lambda name: self.join(view, name),
            lambda: self._put(member),
        )
        with self._lock:
            known = self._members.get(view)
            came = known is None
            member = known or _Member(view, browser, self.store.person_of(browser), card)
            self._members[view] = member
            member.card = card
        view.state.kept = lambda: self._save_kept(member)
        if came and member.person is not None:
            self._welcome(member)
        if view.session.run.going:  # a try that its page had left goes on
            self.version += 1
        self._show(member)
        if came:
            self._put_if_new(member)

    def leave(self, view: PageView) -> None:
        """Save what a page has done, which is gone."""
        with self._lock:
            member = self._members.pop(view, None)
        if member is not None:
            self._save_unfinished(member)

    def join(self, view: PageView, name: str) -> None:
        """Let who is at a page join under a name."""
        member = self._members.get(view)
        if member is None:
            return
        try:
            person = self.store.name_person(member.browser, name)
        except ValueError as error:
            view.state.refuse(str(error))
            return
        for each in self._all():
            if each.browser == member.browser:
                each.person = person
                self._show(each)
                self._put_if_new(each)

    def _welcome(self, member: _Member) -> None:
        """Say what is kept of the last run of who comes back, or what is gone."""
        assert member.person is not None  # noqa: S101 (the caller has looked)
        found = results(self.store, member.person.id)
        if not found:
            return
        last, run = found[-1], member.view.session.run
        if last.run.finished:
            member.last = _last_words(last.run)
        elif (own := self._ids.get(run)) is None or own.id != last.run.id:
            member.last = (
                f"{last.run.title} was cut short after {last.seconds:.0f} s. What was saved of it "
                "is kept; it cannot go on."
            )

    def _show(self, member: _Member) -> None:
        person, assignment, asked = member.person, self._assignment, self._asked
        text, where, course = "", None, self.course.course
        in_course = course is not None and person is not None
        if asked is not None and assignment is not None and assignment.goes_on:
            lines = [f"<b>{html.escape(asked.title)}</b>", *html.escape(asked.text).splitlines()]
            text, in_course = "<br>".join(lines), False
        steps = self.course.standing(self._tries(person)) if in_course and person else []
        step = next_level(steps, person.level) if person and steps else None
        if course is not None and step is not None:
            text = html.escape(course.level_of(step.level).step)
        if self.store.shows_standing and person is not None and assignment is not None:
            where = standing(self._results(), person.id, assignment.id)
        member.view.state.next_try = None if step is None else lambda: self._put(member)
        member.card.show(
            Card(
                title=self.store.title,
                name=None if person is None else person.name,
                exercise=text,
                can_start=bool(text) and not member.view.state.in_exercise,
                saved=member.saved,
                last=member.last,
                standing=where if where is not None and where.own is not None else None,
                levels=steps,
                level=step,
            )
        )

    # The exercise

    def assign(self, text: str) -> AssignedExercise:
        """Set the exercise in a file for all; a `ValueError` says what is wrong with it."""
        asked = read_exercise(text).on(self._organ, self._preset)
        self._end_all()
        self._take_assignment(self.store.assign(text, asked.json))
        self.version += 1
        self._show_all()
        return asked

    def start(self) -> None:
        """Put the exercise that is set on everybody's duct."""
        if self._assignment is None:
            raise ValueError("No exercise is set yet.")
        self._take_assignment(self.store.start_assignment())
        for member in self._all():
            if member.person is not None:
                threading.Thread(target=self._put, args=(member,), daemon=True).start()
        self._show_all()

    def end(self) -> None:
        """Stop the exercise for all."""
        self._end_all()
        self._take_assignment(self.store.stop_assignment())
        self._show_all()

    def delete(self, person_id: str) -> None:
        """Delete a person with all results; who is here yet may join anew."""
        if not self.store.delete_person(person_id, partial(voiding, self.store.id)):
            raise ValueError("There is nobody like that.")
        self.version += 1
        self.sender.wake()
        for member in self._all():
            if member.person is not None and member.person.id == person_id:
                member.person, member.saved, member.last = None, "", ""
                self._show(member)

    def show_standing(self, shown: bool) -> None:
        """Let trainees see where they stand, or not."""
        self.store.shows_standing = shown
        self._show_all()

    @property
    def assignment(self) -> tuple[Assignment, AssignedExercise] | None:
        """What is set."""
        with self._lock:
            if self._assignment is None or self._asked is None:
                return None
            return self._assignment, self._asked

    def _take_assignment(self, assignment: Assignment | None) -> None:
        asked = None if assignment is None else AssignedExercise.of_json(assignment.exercise)
        with self._lock:
            self._assignment, self._asked = assignment, asked

    def _put_if_new(self, member: _Member) -> None:
        """Put a started exercise on the duct of who comes later and has not done it."""
        current = self.assignment
        if current is None or member.person is None or not current[0].goes_on:
            return
        done = any(
            each.finished and each.assignment_id == current[0].id
            for each in self.store.runs(member.person.id)
        )
        if not done and member.view.session.run.exercise != current[1].exercise:
            threading.Thread(target=self._put, args=(member,), daemon=True).start()

    def _put(self, member: _Member) -> None:
        """Put the exercise that is set, or the next one of the course, on a duct."""
        current, person = self.assignment, member.person
        if person is None:
            return
        level: tuple[str, Exercise, int | None] | None = None
        if current is not None and current[0].goes_on:
            asked = current[1]
        else:
            found = self.course.next_try(person, self._tries(person), self._organ, self._preset)
            if found is None:
                return
            asked = found[1]
            level = found[0].level, asked.exercise, found[0].seed
        view = member.view
        preset = self._preset if asked.preset is None else preset_named(asked.preset)
        wanted = preset or default_preset(self._organ)
        with member.lock:
            try:
                view.state.keep_run()
                opening = asked.exercise.opening
                if opening is not None and opening.anatomy is not None:
                    view.show_anatomy(anatomy_named(opening.anatomy))
                else:
                    there = view.session.tissue.dissection
                    # A free duct's threshold and theory can be chosen: a new one has its own.
                    same = there.organ is self._organ and there.preset == wanted
                    scene = OLDER_NAMES[asked.mode]
                    # What the page began with may have been put into a bed, or into space.
                    if view.scene != scene or not same or view.state.in_plane or scene == "free":
                        view.show_duct(self._organ, preset, scene)
                member.level = level
                course = self.course.course
                if level is not None and course is not None:
                    view.state.marks = asked.exercise, course.marks(course.level_of(level[0]))
                view.state.start_exercise(asked.exercise, asked.feedback)
                open_tab(view.client, LEARN)
            except Exception:  # the page may have gone
                log.warning("an exercise could not be put on a page", exc_info=True)
        self._show(member)

    def choose_course(self, content: str | None) -> None:
        """Take the course in a file for the class, or none."""
        self.course.choose(content)
        self._course_changed()

    def set_level(self, level: str | None, person_id: str | None) -> None:
        """Set a level for one or for all; None leaves it to the course."""
        self.course.set_level(level, person_id)
        self._course_changed()

    def connect(self, url: str, version: str, key: str, secret: str) -> None:
        """Have results sent to a learning record store."""
        connect(self.store, self.course, url, version, key, secret)
        self.sender.wake()

    def disconnect(self) -> None:
        """Send no results any more."""
        disconnect(self.store)

    def _statements(self, run: RunRecord) -> list[Statement]:
        return class_statements(self.store, self.course, run)

    def _course_changed(self) -> None:
        for member in self._all():
            member.person = self.store.person_of(member.browser)
        self.version += 1
        self._show_all()

    def _end_all(self) -> None:
        current = self.assignment
        for member in self._all():
            state = member.view.state
            if current is None or state.session.run.exercise != current[1].exercise:
                continue
            if state.in_exercise:
                (state.finish if state.session.run.started else state.reset)()

    # Results

    def rows(self) -> tuple[list[Row], int]:
        """Return a row of each person, and how many have not typed a name."""
        people = self.store.people()
        names, found = shown_names(people), self._results()
        here = {each.person.id: each for each in self._all() if each.person is not None}
        current = self.assignment
        tries: dict[str, list[Result]] = {}
        for each in found:
            if current is not None and each.run.assignment_id == current[0].id:
                tries.setdefault(each.run.person_id, []).append(each)
        rows: list[Row] = []
        for person in people:
            member, own = here.get(person.id), tries.get(person.id, [])
            top = best(own)
            view = None if member is None else member.view
            rows.append(
                Row(
                    id=person.id,
                    name=names[person.id],
                    live=view and live(view.session, replaying=view.state.playback is not None),
                    tries=len(own),
                    best="" if top is None else _best(top),
                    problem="" if member is None else member.problem,
                )
            )
        return rows, sum(each.person is None for each in self._all())

    def _tries(self, person: Person) -> list[Try]:
        """Return somebody's tries at levels, read again when there are new ones."""
        if self._read_tries[0] != self.version:
            self._read_tries = self.version, self.course.tries()
        return self._read_tries[1].get(person.id, [])

    def _going(self) -> set[str]:
        """Return the runs that go on in an open page."""
        runs = [each.view.session.run for each in self._all()]
        return {own.id for each in runs if each.going and (own := self._ids.get(each))}

    def _results(self) -> list[Result]:
        """Return all results, read again when there are new ones."""
        if self._found[0] != self.version:
            self._found = self.version, results(self.store)
        return self._found[1]

    def to_watch(self, client: viser.ClientHandle) -> WatchRequest | None:
        """Return what the teacher's page asks for by its address, if it is there."""
        run_id = asked_by_address(client, "replay")
        if run_id is not None:
            kept = self.store.run(run_id)
            if kept is None:
                client.add_notification("No such run", "It has been deleted.", color="yellow")
                return None
            run = read_run(kept.file)

            return WatchRequest(OLDER_NAMES[_mode(run)], lambda view: view.replay(run))
        person_id = asked_by_address(client, "watch")
        if person_id is None:
            return None
        member = self._here(person_id)
        if member is None:
            client.add_notification("Not here", "This person has no page open.", color="yellow")
            return None

        anatomy = member.view.session.specimen.anatomy

        def find() -> Session | None:
            """Return the person's session, as long as it is seen in the same way."""
            there = self._here(person_id)
            if there is None:
                return None
            session = there.view.session
            return session if (session.specimen.anatomy is None) == (anatomy is None) else None

        def watch(view: PageView) -> None:
            if anatomy is not None:
                view.show_anatomy(anatomy)
            view.state.watch(member.view.session, find)

        return WatchRequest(member.view.scene, watch)

    def _here(self, person_id: str) -> _Member | None:
        return next(
            (each for each in self._all() if each.person and each.person.id == person_id), None
        )

    def _save_kept(self, member: _Member) -> None:
        """Save the run that has just ended or was given up."""
        state = member.view.state
        run, kept = state.session.run, state.last_run
        if kept is not None and member.person is not None:
            self._save(member, run, lambda: kept, finished=True)
            outcome = kept.outcome
            if outcome is not None:
                member.last = f"{'Passed' if outcome.passed else 'Failed'}. {outcome.reason}"

    def _save_unfinished(self, member: _Member) -> None:
        """Save a run that goes on, as far as it has come."""
        state = member.view.state
        run = state.session.run
        if run.going and member.person is not None:
            member.saved_at = time.monotonic()
            self._save(member, run, state.run_so_far, finished=False)

    def _save(
        self,
        member: _Member,
        run: Run,
        file: Callable[[], RunFile],
        *,
        finished: bool,
    ) -> None:
        person = member.person
        assert person is not None  # noqa: S101 (callers have looked)
        current = self.assignment
        exercise: Exercise | None = run.exercise
        level = member.level[0] if member.level and member.level[1] == exercise else None
        # One that was set and has been stopped takes no try from a level that asks for the same.
        goes_on = current is not None and (current[0].goes_on or level is None)
        mine = current is not None and goes_on and exercise == current[1].exercise
        level = None if mine else level
        seed = member.level[2] if level and member.level else None
        fresh = _Identity(uuid4().hex, now(), level, seed)
        with self._lock:
            run_id, started_at, level, seed = self._ids.setdefault(run, fresh)
        mine = mine and level is None
        course = self.course.course
        levels = () if course is None else course.level  # another may have been set meanwhile
        titled = next((each.title for each in levels if each.id == level), "")
        incidents = run.incidents() if finished else None
        photographs = list(member.view.state.photographs) if finished else []
        member.saved = SAVING if finished else member.saved

        def make() -> RunRecord:
            began = time.monotonic()
            content = file()
            outcome = content.outcome
            record = RunRecord(
                id=run_id,
                person_id=person.id,
                assignment_id=current[0].id if mine and current is not None else None,
                mode=_mode(content),
                title=current[1].title
                if mine and current is not None
                else titled or run_title(content),
                started_at=started_at,
                finished=finished,
                passed=None if outcome is None else outcome.passed,
                reason="" if outcome is None else outcome.reason,
                measures=msgspec.json.encode(content.metrics).decode(),
                file=run_json(content),
                level=level,
                seed=seed,
                incidents=None if incidents is None else msgspec.json.encode(incidents).decode(),
            )
            member.save_after = max(SAVE_SECONDS, PATIENCE * (time.monotonic() - began))
            return record

        def done(problem: str | None) -> None:
            member.problem = "" if problem is None else problem[:1].upper() + problem[1:]
            if problem is None and photographs:
                self.store.keep_photographs(run_id, photographs)
            if problem is not None:
                member.saved = member.problem
            elif finished:
                member.saved = f"{SAVED} {now()[11:19]}"
            # One that was left, too, which has failed unless it goes on.
            self.version += finished or member.view not in self._members
            self.sender.wake()
            if finished:
                self._show_safely(member)

        if finished:
            self._show_safely(member)
        self._recorder.save(run_id, make, done)

    def _look(self) -> None:
        """Save runs that go on, and bring the cards up to date."""
        version = self.version
        while not self._stopping.wait(LOOK_SECONDS):
            self._look_elsewhere()
            changed, version = version != self.version, self.version
            for member in self._all():
                if time.monotonic() - member.saved_at > member.save_after:
                    self._save_unfinished(member)
                busy = member.view.state.in_exercise
                if changed or busy != member.busy or self._assignment is not None:
                    member.busy = busy
                    self._show_safely(member)

    def _look_elsewhere(self) -> None:
        """Take what a command has set for the class while it is open."""
        receiver = self.store.learning_record_store
        try:
            if not self.store.changed_elsewhere():
                return
            self.course.read_again()
        except sqlite3.ProgrammingError:  # closed, as where the trainer could not start
            self._stopping.set()
            return
        except (sqlite3.Error, ValueError):
            log.warning("what a command has set could not be read", exc_info=True)
            return
        if self.store.learning_record_store not in (None, receiver):
            # Runs that ended since the command has read them.
            threading.Thread(target=self._queue_kept, name="xapi", daemon=True).start()
        self._course_changed()

    def _queue_kept(self) -> None:
        with contextlib.suppress(sqlite3.ProgrammingError):  # closed meanwhile
            queue_kept(self.store, self.course)
        self.sender.wake()

    def _show_all(self) -> None:
        for member in self._all():
            self._show_safely(member)

    def _show_safely(self, member: _Member) -> None:
        try:
            self._show(member)
        except Exception:
            log.debug("a page has gone", exc_info=True)

    def _all(self) -> list[_Member]:
        with self._lock:
            return list(self._members.values())


def _mode(run: RunFile) -> str:
    """Return what a run is of, as a class's file has it."""
    if run.log.start.anatomy is not None:
        return "anatomy"
    return "dissect" if run.log.start.in_bed else "pull"


def _best(top: Result) -> str:
    return (
        f"{top.word}, peak {100.0 * top.peak:.0f} % of break"
        if top.run.passed
        else f"failed: {top.why}"
    )


def _last_words(run: RunRecord) -> str:
    ended = {True: "passed", False: "failed", None: "ended"}[run.passed]
    return f"Your last run, {run.title}, {ended} at {run.started_at[11:16]}. {run.reason}"
