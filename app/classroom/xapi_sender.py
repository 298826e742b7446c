"""Sends what waits in a class's queue of xAPI statements to its learning record store."""

import base64
import json
import logging
import os
import random
import threading
import urllib.error
import urllib.parse
import urllib.request
from http import HTTPStatus
from pathlib import Path
from typing import Any

import msgspec
import platformdirs

from app.classroom.class_course import ClassCourse
from app.classroom.progress import Try
from app.classroom.store import ClassStore, RunRecord, Statement
from app.classroom.xapi import VERSIONS, Version, run_statements

BATCH = 50
TIMEOUT = 10.0
FIRST_WAIT, LONGEST_WAIT, STOP_SECONDS = 2.0, 3600.0, 2.0
ONE_BY_ONE = (HTTPStatus.BAD_REQUEST, HTTPStatus.CONFLICT, HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
DONE = (HTTPStatus.OK, HTTPStatus.NO_CONTENT)
LONGEST_URL, LONGEST_WORD = 500, 300

log = logging.getLogger(__name__)


class LearningRecordStore(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where statements go, as the class's file has it; the key to it is kept elsewhere."""

    url: str
    version: Version

    @classmethod
    def of(cls, url: str, version: str) -> "LearningRecordStore":
        """Return one, or a `ValueError` that says what is wrong with it."""
        for each in VERSIONS:
            if each == version:
                return cls(checked_url(url), each)
        raise ValueError(f"version must be one of {', '.join(VERSIONS)}, got {version!r}")


def checked_url(url: str) -> str:
    """Return the address of a store without a slash at its end; https only, but on this machine."""
    try:
        split = urllib.parse.urlsplit(url)
        host = split.hostname or ""
        _ = split.port
    except ValueError:
        raise ValueError(f"{url!r} is no address of a learning record store") from None
    here = host in ("localhost", "127.0.0.1", "::1")
    if len(url) > LONGEST_URL or not host or split.username or split.query or split.fragment:
        raise ValueError(
            f"{url[:LONGEST_URL]!r} is no address such as https://lrs.example.org/xapi"
        )
    if split.scheme != "https" and not (split.scheme == "http" and here):
        raise ValueError(f"{url!r} must begin with https:// for what is sent to be encrypted")
    return url.rstrip("/")


def keep_key(class_id: str, key: str, secret: str) -> None:
    """Keep the key of a class's store in a file that only its user can read."""
    if not key or not secret or max(len(key), len(secret)) > LONGEST_WORD or ":" in key:
        raise ValueError(f"key and secret have 1 to {LONGEST_WORD} characters, the key no colon")
    path = _key_path(class_id)
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    fresh = path.with_suffix(".new")
    fresh.unlink(missing_ok=True)
    with os.fdopen(os.open(fresh, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600), "w") as file:
        json.dump({"key": key, "secret": secret}, file)
    fresh.replace(path)


def _key_path(class_id: str) -> Path:
    folder = Path(platformdirs.user_config_dir("bluntdissect", appauthor=False))
    return folder / "learning-record-stores" / f"{class_id}.json"


def connect(
    store: ClassStore, book: ClassCourse, url: str, version: str, key: str, secret: str
) -> None:
    """Have a class's results sent to a learning record store, those that are kept first."""
    found = LearningRecordStore.of(url, version)
    keep_key(store.id, key, secret)
    store.learning_record_store = msgspec.json.encode(found).decode()
    queue_kept(store, book)


def queue_kept(store: ClassStore, book: ClassCourse) -> None:
    """Queue what the learning record store is to be told of the runs that are kept."""
    for run in store.runs():
        whole = store.run(run.id)
        if whole is not None:
            store.queue(class_statements(store, book, whole))


def disconnect(store: ClassStore) -> None:
    """Send nothing more, and forget what waits and the key."""
    store.learning_record_store = None
    _key_path(store.id).unlink(missing_ok=True)


def class_statements(store: ClassStore, book: ClassCourse, run: RunRecord) -> list[Statement]:
    """Return what a class's learning record store is to be told of a run, if it has one."""
    content = store.learning_record_store
    if content is None or not run.finished:
        return []
    version = msgspec.json.decode(content, type=LearningRecordStore).version
    if run.level is None or book.course is None:
        return run_statements(store.id, version, run)
    tries = book.tries(run.person_id).get(run.person_id, [])
    if run.id not in {each.run_id for each in tries}:
        tries = [*tries, Try.of(run)]
    return run_statements(store.id, version, run, book.course, book.standing(tries))


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """A redirect is an answer: keys go nowhere but to the store."""

    def redirect_request(self, *_: Any, **__: Any) -> None:
        """Follow none."""
        return


class Sender:
    """A thread that sends what waits, while the class has a store. `problem` says what is wrong."""

    def __init__(self, store: ClassStore, first_wait: float = FIRST_WAIT) -> None:
        self._store, self._first_wait = store, first_wait
        self._opener = urllib.request.build_opener(_NoRedirect())
        self._news, self._stopping, self._failures = threading.Event(), threading.Event(), 0
        self._retry_after: float | None = None
        self.problem = ""
        self._thread = threading.Thread(target=self._run, name="xapi", daemon=True)
        self._thread.start()

    def wake(self) -> None:
        """Look for what is new, or for another store."""
        self._news.set()

    def stop(self) -> None:
        """End; what waits is sent the next time."""
        self._stopping.set()
        self._news.set()
        self._thread.join(STOP_SECONDS)

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                more = self._send()
            except Exception as error:  # the class may be closed, its disk full
                if self._stopping.is_set():
                    return
                log.warning("xAPI statements could not be sent: %s", error)
                self.problem, more = str(error), None
            if more is None:
                self._failures += 1
                wait = min(LONGEST_WAIT, self._first_wait * 2.0 ** min(self._failures - 1, 60))
                # A failing store is not asked sooner for what is new.
                self._stopping.wait(
                    self._retry_after or wait * random.uniform(0.5, 1.0)  # noqa: S311 (spread)
                )
            else:
                self._failures, self.problem = 0, ""
                if not more:
                    self._news.wait()
                    self._news.clear()

    def _send(self) -> bool | None:
        """Send a batch; return whether there may be more, or None if it is to be tried later."""
        content = self._store.learning_record_store
        if content is None:
            return False
        found = msgspec.json.decode(content, type=LearningRecordStore)
        waiting = self._store.statements_to_send(content, BATCH)
        if not waiting:
            return False
        body = b"[" + b",".join(each.content for each in waiting) + b"]"
        code, reason = self._ask(found, "POST", "/statements", body)
        if code in DONE:
            self._store.statements_sent(content, [each.id for each in waiting])
            return True
        if code in ONE_BY_ONE:
            done = [self._send_one(content, found, each) for each in waiting]
            return True if all(done) else None
        self.problem = reason
        return None

    def _send_one(self, content: str, found: LearningRecordStore, each: Statement) -> bool:
        """Send one; what the store refuses for itself is kept with its reason."""
        path = f"/statements?statementId={each.id}"
        code, reason = self._ask(found, "PUT", path, each.content)
        # A conflict: it has a statement of this id, which is this one.
        if code in DONE or code == HTTPStatus.CONFLICT:
            self._store.statements_sent(content, [each.id])
        elif code in ONE_BY_ONE:
            self._store.statement_refused(content, each.id, reason)
        else:
            self.problem = reason
            return False
        return True

    def _ask(
        self, found: LearningRecordStore, method: str, path: str, body: bytes
    ) -> tuple[int, str]:
        """Return the status of the answer, 0 without one, and what is wrong in words."""
        self._retry_after = None
        try:
            words = json.loads(_key_path(self._store.id).read_text(encoding="utf-8"))
            pair = f"{words['key']}:{words['secret']}"
        except (OSError, ValueError, KeyError):
            return 0, "There is no key for the learning record store on this machine."
        headers = {
            "X-Experience-API-Version": found.version,
            "Content-Type": "application/json",
            "Authorization": "Basic " + base64.b64encode(pair.encode()).decode(),
        }
        # The address was checked: https, or this machine.
        request = urllib.request.Request(  # noqa: S310
            found.url + path, body, headers, method=method
        )
        try:
            with self._opener.open(request, timeout=TIMEOUT) as answer:
                return answer.status, ""
        except urllib.error.HTTPError as error:
            after = error.headers.get("Retry-After", "")
            if after.isdecimal():
                self._retry_after = min(float(after), LONGEST_WAIT)
            text = error.read(LONGEST_WORD).decode(errors="replace")
            return error.code, f"The learning record store answers {error.code}: {text}"
        except (OSError, ValueError) as error:
            return 0, f"The learning record store does not answer: {error}"
