"""The teacher's page: plain HTML, files to download, and a websocket for what goes on.

The guard has let only the teacher's link in here. All text that people typed is escaped, here or by
the page's script; the page may load nothing from elsewhere and run no script but its own.
"""

import asyncio
import contextlib
import html
import re
from collections.abc import Awaitable, Callable
from functools import partial
from http import HTTPStatus
from importlib.resources import files
from typing import Any
from urllib.parse import parse_qs

import msgspec
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from app.classroom.course import default_course
from app.classroom.course_page import course_html, level_choices
from app.classroom.exercise_file import ExerciseFile, read_exercise, template
from app.classroom.exercise_form import exercise_form
from app.classroom.photograph import kind_of
from app.classroom.report import report_page, results_html, style
from app.classroom.results import results, results_csv, results_json
from app.trainer.classroom.lesson import Lesson
from app.trainer.connections.bounds import PageConnection
from app.trainer.connections.guard import opens_elsewhere
from app.trainer.panel.frame import DISCLAIMER

LIVE_SECONDS = 0.5
ONLY_HERE = (
    '<p class="empty">Only this computer can open this link. '
    "Start the class with --host 0.0.0.0 for other devices.</p>"
)
"""In place of a link's QR code."""
LONGEST_COMMAND = 50_000
HTML, SCRIPT, STYLE = "text/html", "text/javascript", "text/css"
SAFE = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
        "img-src 'self' data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


class Assign(msgspec.Struct, tag="assign", forbid_unknown_fields=True):
    """Set the exercise in a file."""

    text: str


class Start(msgspec.Struct, tag="start", forbid_unknown_fields=True):
    """Start it for all."""


class Stop(msgspec.Struct, tag="stop", forbid_unknown_fields=True):
    """Stop it for all."""


class Delete(msgspec.Struct, tag="delete", forbid_unknown_fields=True):
    """Delete a person."""

    person: str


class ShowStanding(msgspec.Struct, tag="standing", forbid_unknown_fields=True):
    """Let trainees see where they stand, or not."""

    shown: bool


class ChooseCourse(msgspec.Struct, tag="course", forbid_unknown_fields=True):
    """Take the course in a file, the one that comes with the program, or none."""

    text: str = ""
    default: bool = False


class SetLevel(msgspec.Struct, tag="level", forbid_unknown_fields=True):
    """Set a level for one or for all; an empty one leaves it to the course."""

    level: str
    person: str = ""


class Connect(msgspec.Struct, tag="connect", forbid_unknown_fields=True):
    """Send results to a learning record store; without an address send none any more."""

    url: str
    version: str = "1.0.3"
    key: str = ""
    secret: str = ""


class Rate(msgspec.Struct, tag="rate", forbid_unknown_fields=True):
    """Give points of 6 for the critical view of a run, or none."""

    run: str
    points: int | None = None


Command = Rate | Assign | Start | Stop | Delete | ShowStanding | ChooseCourse | SetLevel | Connect


class TeacherPage:
    """Answers what the teacher's page asks."""

    def __init__(self, lesson: Lesson, link: Callable[[], str]) -> None:
        self._lesson, self._link = lesson, link
        self._decoder = msgspec.json.Decoder(Command)

    def __call__(
        self, connection: PageConnection, request: Request
    ) -> Response | Awaitable[Response] | None:
        """Return the answer to a request below `/class`; None for the page's websocket."""
        path, _, query = request.path.partition("?")
        if path == "/class/live" and request.headers.get("Upgrade") == "websocket":
            connection.serve = partial(self._serve, connection)
            return None
        given = {key: values[0] for key, values in parse_qs(query).items()}
        return asyncio.to_thread(self._answer, path, given)

    def _answer(self, path: str, given: dict[str, str]) -> Response:
        store = self._lesson.store
        name = re.sub(r"[^\w]+", "-", store.title, flags=re.ASCII).strip("-") or "class"
        if path == "/class":
            return Response(
                HTTPStatus.TEMPORARY_REDIRECT, "Temporary Redirect",
                Headers({"Location": "class/", "Content-Length": "0", "Connection": "close"}), b"",
            )  # fmt: skip
        if path == "/class/":
            return _content(self._page(), HTML)
        if path == "/class/teacher.js":
            return _content(_file("teacher.js"), SCRIPT)
        if path == "/class/class.css":
            return _content(style(), STYLE)
        if path == "/class/results":
            return _content(results_html(store), HTML)
        if path == "/class/course":
            return _content(course_html(store, self._lesson.course), HTML)
        if path == "/class/course.toml" and store.course is not None:
            return _content(store.course, "application/toml", "course.toml")
        if path == "/class/report":
            return _content(report_page(store, given.get("person")), HTML)
        if path == "/class/results.csv":
            return _content(results_csv(results(store)), "text/csv", f"{name}.csv")
        if path == "/class/results.json":
            return _content(results_json(store), "application/json", f"{name}.json")
        if path == "/class/run" and (run := store.run(given.get("id", ""))) is not None:
            return _content(run.file, "application/json", f"run-{run.started_at[:16]}.json")
        if path == "/class/photograph":
            taken = store.photographs(given.get("run", ""))
            number = given.get("number", "0")
            if number.isdecimal() and int(number) < len(taken):
                content = taken[int(number)]
                return _content(content, kind_of(content) or "application/octet-stream")
        return _content("There is no such page.\n", "text/plain", status=HTTPStatus.NOT_FOUND)

    def _page(self) -> str:
        import segno

        store, link = self._lesson.store, self._link()
        current = self._lesson.assignment
        text = template("window") if current is None else current[0].text
        code = (
            segno.make(link, micro=False).svg_inline(omitsize=True, light="#fff")
            if opens_elsewhere(link)
            else ONLY_HERE
        )
        values = {
            "TITLE": html.escape(store.title),
            "LINK": html.escape(link),
            "CODE": code,
            "FORM": exercise_form(None if current is None else _as_set(text)),
            "COURSE": html.escape(store.course or default_course()),
            "EXERCISE": html.escape(text),
            "STANDING": "checked" if store.shows_standing else "",
            "DISCLAIMER": DISCLAIMER,
        }
        return re.sub(r"\{\{([A-Z]+)\}\}", lambda found: values[found[1]], _file("teacher.html"))

    async def _serve(self, connection: PageConnection) -> None:
        """Serve a page's websocket: commands come, what goes on goes."""
        telling = asyncio.create_task(self._tell(connection))
        try:
            while True:
                text = await connection.recv_text()
                await connection.send(await asyncio.to_thread(self._done, text))
        except ConnectionClosed:
            return
        finally:
            telling.cancel()

    async def _tell(self, connection: PageConnection) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                await connection.send(await asyncio.to_thread(self._state))
                await asyncio.sleep(LIVE_SECONDS)

    def _state(self) -> str:
        rows, nameless = self._lesson.rows()
        state: dict[str, Any] = {
            "rows": rows, "nameless": nameless, "version": self._lesson.version, "exercise": None,
            "levels": "", "sending": self._sending(),
        }  # fmt: skip
        if (course := self._lesson.course.course) is not None:
            state["levels"] = level_choices(course)
        if (current := self._lesson.assignment) is not None:
            assignment, asked = current
            state["exercise"] = {
                "title": asked.title,
                "text": asked.text,
                "goal": asked.exercise.task,
                "limit": asked.exercise.full_caution,
                "going": assignment.goes_on,
                "started": assignment.started_at is not None,
            }
        return msgspec.json.encode(state).decode()

    def _sending(self) -> str:
        """Return what becomes of results that are sent, in a sentence; empty if none are."""
        store = self._lesson.store
        if store.learning_record_store is None:
            return ""
        waiting, sent, refused, reason = store.statement_counts()
        answer = f"{sent} statements were sent, {waiting} wait"
        answer += f", {refused} were refused: {reason}." if refused else "."
        return f"{answer} {self._lesson.sender.problem}".strip()

    def _done(self, text: str) -> str:
        """Do a command; return what the page says of it."""
        try:
            if len(text) > LONGEST_COMMAND:
                raise ValueError("This is too long.")
            command = self._decoder.decode(text)
            answer = {"notice": self._do(command), "assigned": isinstance(command, Assign)}
            return msgspec.json.encode(answer).decode()
        except (ValueError, msgspec.MsgspecError) as error:
            return msgspec.json.encode({"refused": str(error)}).decode()

    def _do(self, command: Command) -> str:
        lesson = self._lesson
        if isinstance(command, Assign):
            return f"{lesson.assign(command.text).title!r} is set. Start it when all are ready."
        if isinstance(command, Rate):
            lesson.store.rate(command.run, command.points)
            return "Kept beside the computed points."
        if isinstance(command, Start):
            lesson.start()
            return "It is on everybody's duct; time runs from each one's first touch."
        if isinstance(command, Stop):
            lesson.end()
            return "Stopped."
        if isinstance(command, Delete):
            lesson.delete(command.person)
            return "Deleted."
        if isinstance(command, ChooseCourse):
            text = default_course() if command.default else command.text
            lesson.choose_course(text or None)
            return "The course is set." if text else "The class has no course any more."
        if isinstance(command, SetLevel):
            lesson.set_level(command.level or None, command.person or None)
            return "Set." if command.level else "The course's own order again."
        if isinstance(command, Connect):
            if not command.url:
                lesson.disconnect()
                return "Nothing is sent any more."
            lesson.connect(command.url, command.version, command.key, command.secret)
            return "Results are sent, those that are kept first."
        lesson.show_standing(command.shown)
        return "Trainees see where they stand." if command.shown else "Only you see the results."


def _as_set(text: str) -> ExerciseFile | None:
    """Return the exercise that is set; None of one that an earlier version took."""
    try:
        return read_exercise(text)
    except ValueError:
        return None


def _file(name: str) -> str:
    return files("app.trainer.classroom").joinpath(name).read_text(encoding="utf-8")


def _content(
    content: str | bytes,
    kind: str,
    name: str | None = None,
    status: HTTPStatus = HTTPStatus.OK,
) -> Response:
    """Return a response; a name makes it a download."""
    body = content.encode() if isinstance(content, str) else content
    headers = Headers(SAFE)
    headers["Content-Type"] = f"{kind}; charset=utf-8"
    headers["Content-Length"] = str(len(body))
    headers["Connection"] = "close"
    if name is not None:
        headers["Content-Disposition"] = f'attachment; filename="{name}"'
    return Response(status.value, status.phrase, headers, body)
