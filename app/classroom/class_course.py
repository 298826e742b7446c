"""The course of a class: which it is, where its people stand in it, and what each does next."""

from collections.abc import Callable, Collection, Sequence
from datetime import UTC, datetime

from app.classroom.course import Course, read_course
from app.classroom.exercise_file import AssignedExercise
from app.classroom.progress import LevelStanding, Try, next_level, standings
from app.classroom.store import ClassStore, Person
from app.simulation import Preset
from organ_geometry import Organ


class ClassCourse:
    """The course of an open class; finished tries that were read are kept: they do not change.

    `going` gives the runs that go on now: they are not tries yet. An unfinished one of which it is
    not known has failed.
    """

    def __init__(self, store: ClassStore, going: Callable[[], Collection[str]] = tuple) -> None:
        self._store, self._going = store, going
        self._tries: dict[str, Try] = {}
        self._course: Course | None = None
        self.read_again()

    @property
    def course(self) -> Course | None:
        """The course, if the class has one."""
        return self._course

    def read_again(self) -> None:
        """Take the course that the class has in its store."""
        content = self._store.course
        self._course = None if content is None else read_course(content)

    def choose(self, content: str | None) -> None:
        """Take the course in a file, or none; a `ValueError` says what is wrong with it.

        Levels that a teacher has set and that it does not have are no longer set.
        """
        course = None if content is None else read_course(content)
        self._store.course, self._course = content, course
        known = set[str]() if course is None else {each.id for each in course.level}
        for person in self._store.people():
            if person.level is not None and person.level not in known:
                self._store.set_level(None, person.id)

    def set_level(self, level: str | None, person_id: str | None = None) -> None:
        """Have one, or all, do a level until it is mastered; None leaves it to the course."""
        if self._course is None:
            raise ValueError("This class has no course.")
        if level is not None:
            self._course.level_of(level)
        if person_id is not None and person_id not in {each.id for each in self._store.people()}:
            raise ValueError("There is nobody like that.")
        self._store.set_level(level, person_id)

    def tries(self, person_id: str | None = None) -> dict[str, list[Try]]:
        """Return everybody's tries, or one's, oldest first, by person."""
        found: dict[str, list[Try]] = {
            each.id: [] for each in self._store.people() if person_id in (None, each.id)
        }
        going = self._going()
        for run in self._store.level_runs(person_id):
            if not run.finished and run.id in going:
                continue
            each = self._tries.get(run.id) or Try.of(run)
            if run.finished:
                self._tries[run.id] = each
            found.setdefault(run.person_id, []).append(each)
        return found

    def standing(self, tries: Sequence[Try]) -> list[LevelStanding]:
        """Return where somebody with some tries stands now."""
        if self._course is None:
            return []
        return standings(self._course, tries, datetime.now(UTC))

    def next_try(
        self, person: Person, tries: Sequence[Try], organ: Organ, preset: Preset | None
    ) -> tuple[LevelStanding, AssignedExercise] | None:
        """Return the level that somebody does next and its exercise; None if nothing is open."""
        where = next_level(self.standing(tries), person.level)
        if self._course is None or where is None:
            return None
        level = self._course.level_of(where.level)
        return where, level.try_on(organ, preset, row=where.row, seed=where.seed)
