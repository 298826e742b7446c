"""Results of a class as xAPI statements, for a learning record store (LRS) of the teacher's choice.

Statements are made of what is kept of a run, with ids that are the same whenever they are made
again. People are pseudonyms: no name leaves the machine. There is no score: whether an exercise was
passed is the result, and the measures are extensions of it.
"""

import hashlib
import uuid
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any, Literal

import msgspec

from app.classroom.course import Course
from app.classroom.progress import LevelStanding
from app.classroom.store import RunRecord, Statement
from app.simulation import ERROR_CLASSES, METRICS, read_incidents, renamed_metrics

BASE = "https://bluntdissect.example/xapi"
"""What the project's own identifiers begin with: names, which lead nowhere (docs/xapi.md)."""
SPACE = uuid.uuid5(uuid.NAMESPACE_URL, BASE)
VERBS = "http://adlnet.gov/expapi/verbs/"
SIMULATION = "http://adlnet.gov/expapi/activities/simulation"
COURSE = "http://adlnet.gov/expapi/activities/course"
MODULE = "http://adlnet.gov/expapi/activities/module"
Version = Literal["1.0.3", "2.0.0"]
VERSIONS: tuple[Version, ...] = ("1.0.3", "2.0.0")
MOST_INCIDENTS = 200
"""Incidents of a run that are told, the first of them."""

Json = dict[str, Any]


def pseudonym(class_id: str, person_id: str) -> str:
    """Return a person's name in statements; the identity, 96 random bits, is not found from it."""
    return uuid.uuid5(SPACE, f"{class_id}/person/{person_id}").hex


def run_statements(
    class_id: str,
    version: Version,
    run: RunRecord,
    course: Course | None = None,
    standing: Sequence[LevelStanding] = (),
    *,
    actor: str | None = None,
) -> list[Statement]:
    """Return the statements of a finished run: its result, its errors, a level that it mastered.

    Parameters
    ----------
    class_id
        Of the class.
    version
        Of xAPI.
    run
        The run. One without an exercise has none.
    course
        The course, if the run is a try at a level.
    standing
        Where its person stands in the course, with this run.
    actor
        The person's name in them; None for the pseudonym in this class.

    Returns
    -------
    list of Statement
    """
    if run.passed is None and run.level is None and run.assignment_id is None:
        return []
    measures: Json = renamed_metrics(msgspec.json.decode(run.measures))
    began = datetime.fromisoformat(run.started_at)
    seconds = float(measures["time_s"])
    what = run.level or (f"exercise-{run.assignment_id}" if run.assignment_id else run.mode)
    home = f"{BASE}/classes/{class_id}"
    group = _activity(home, COURSE, "A class of bluntdissect")
    activities = {
        "grouping": [group],
        "category": [_activity(f"{BASE}/profile/1", f"{BASE}/types/profile", "bluntdissect")],
    }
    of_course = course is not None and run.level is not None
    if course is not None and of_course:
        activities["parent"] = [_activity(f"{BASE}/courses/{course.id}", COURSE, course.title)]
    context: Json = {
        "registration": str(uuid.uuid5(SPACE, f"{class_id}/{run.person_id}/{what}")),
        "platform": "bluntdissect",
        "language": "en",
        "contextActivities": activities,
        "extensions": {
            f"{BASE}/extensions/run-sha256": hashlib.sha256(run.file).hexdigest(),
            **({} if run.seed is None else {f"{BASE}/extensions/bed-seed": run.seed}),
        },
    }
    common: Json = {
        "actor": {
            "objectType": "Agent",
            "account": {"homePage": home, "name": actor or pseudonym(class_id, run.person_id)},
        },
        "version": version,
    }
    passed = run.passed is True
    result_id = str(uuid.uuid5(SPACE, f"{class_id}/{run.id}/result"))
    found: list[Json] = [
        common
        | {
            "id": result_id,
            "verb": _adl("passed" if passed else "failed"),
            "object": _activity(f"{home}/{what}", SIMULATION, run.title),
            "result": {
                "success": passed,
                "completion": run.passed is not None,
                "duration": _duration(seconds),
                "response": run.reason or "It was given up.",
                "extensions": {
                    f"{BASE}/measures/{each.key}": measures[each.key]
                    for each in METRICS
                    if measures.get(each.key) is not None
                },
            },
            "context": context,
            "timestamp": _time(began, seconds),
        }
    ]
    incidents = read_incidents(run.incidents)
    for number, each in enumerate(incidents[:MOST_INCIDENTS]):
        extensions: Json = {
            f"{BASE}/extensions/at-s": each.start_s,
            f"{BASE}/extensions/seconds": each.end_s - each.start_s,
            f"{BASE}/extensions/consequence": each.consequence,
        }
        if each.station_mm is not None:
            extensions[f"{BASE}/extensions/station-mm"] = each.station_mm
        if each.hand is not None:
            extensions[f"{BASE}/extensions/hand"] = ("left", "right")[each.hand]
        found.append(
            common
            | {
                "id": str(uuid.uuid5(SPACE, f"{class_id}/{run.id}/error/{number}")),
                "verb": {"id": f"{BASE}/verbs/erred", "display": {"en": "made an error"}},
                "object": _activity(
                    f"{BASE}/errors/{each.error}", f"{BASE}/types/error",
                    ERROR_CLASSES[each.error].title,
                ),
                "result": {"response": each.sentence, "extensions": extensions},
                "context": context | {"statement": {"objectType": "StatementRef", "id": result_id}},
                "timestamp": _time(began, each.start_s),
            }
        )  # fmt: skip
    if course is not None:
        found += [
            common
            | {
                "id": str(uuid.uuid5(SPACE, f"{class_id}/{run.person_id}/{each.level}/mastered")),
                "verb": _adl("mastered"),
                "object": _activity(f"{BASE}/courses/{course.id}/{each.level}", MODULE, each.title),
                "result": {"completion": True},
                "context": context | {"statement": {"objectType": "StatementRef", "id": result_id}},
                "timestamp": _time(began, seconds),
            }
            for each in standing
            if each.mastered_by == run.id
        ]
    return [Statement(each["id"], run.person_id, msgspec.json.encode(each)) for each in found]


def voiding(class_id: str, statement: Statement) -> Statement:
    """Return the statement that voids another, whose person has been deleted."""
    home = f"{BASE}/classes/{class_id}"
    version: Version = msgspec.json.decode(statement.content)["version"]
    made: Json = {
        "id": str(uuid.uuid5(SPACE, f"{class_id}/voids/{statement.id}")),
        "actor": {"objectType": "Agent", "account": {"homePage": home, "name": "class"}},
        "verb": _adl("voided"),
        "object": {"objectType": "StatementRef", "id": statement.id},
        "timestamp": _time(datetime.now(UTC), 0.0),
        "version": version,
    }
    return Statement(made["id"], None, msgspec.json.encode(made))


def _adl(verb: str) -> Json:
    return {"id": f"{VERBS}{verb}", "display": {"en": verb}}


def _activity(iri: str, kind: str, name: str) -> Json:
    return {
        "objectType": "Activity",
        "id": iri,
        "definition": {"type": kind, "name": {"en": name}},
    }


def _duration(seconds: float) -> str:
    """Return a duration as ISO 8601 has it, to the hundredth, by which xAPI compares."""
    return f"PT{seconds:.2f}S"


def _time(began: datetime, seconds: float) -> str:
    """Return a time in UTC, as a store keeps it, some seconds after another."""
    at = (began + timedelta(seconds=seconds)).astimezone(UTC)
    return f"{at.replace(tzinfo=None).isoformat(timespec='milliseconds')}Z"
