"""The trainer's log: one bounded record a line."""

import json
import logging
import sys

import pytest
from program import refused

from app.trainer.server import log


def record(message: str, *, fault: bool = False) -> logging.LogRecord:
    try:
        raise ValueError("a fault")
    except ValueError:
        found = sys.exc_info() if fault else None
    return logging.LogRecord("a.logger", logging.WARNING, "a.py", 1, message, (), found)


def test_a_record_is_a_line_of_json_with_its_traceback() -> None:
    line = log._Json(4000).format(record("two\nlines", fault=True))
    assert "\n" not in line
    read = json.loads(line)
    assert set(read) == {"time", "level", "logger", "message"}
    assert read["level"] == "warning"
    assert read["message"].startswith("two\nlines\nTraceback")
    assert read["message"].endswith("ValueError: a fault")


def test_a_record_is_cut() -> None:
    text = log._Bounded(4000).format(record("x" * 10_000))
    assert text == f"{'x' * 4000} ... and 10,000 in all"
    assert len(json.loads(log._Json(4000).format(record("x" * 10_000)))["message"]) < 4100


def test_what_comes_too_fast_is_dropped_and_counted() -> None:
    now = 0.0
    rate = log._Rate(lambda: now)
    assert sum(rate.filter(record("again")) for _ in range(1000)) == 100
    now = 1.0
    late = record("late")
    assert rate.filter(late)
    assert late.getMessage() == "late (900 records before were dropped)"


def test_a_format_that_is_none_is_refused() -> None:
    assert "--log-format must be text or json" in refused(("trainer", "--log-format", "xml"))


def test_the_log_goes_to_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    root = logging.getLogger()
    before, level = root.handlers[:], root.level
    root.handlers = []
    try:
        log.set_up_log("json", 4000)
        logging.getLogger("some.part").warning("refused from %s", "10.0.0.1")
        logging.getLogger("some.part").info("nobody reads this")
    finally:
        root.handlers, root.level = before, level
        logging.captureWarnings(False)
    read = json.loads(capsys.readouterr().err)
    assert (read["logger"], read["message"]) == ("some.part", "refused from 10.0.0.1")
