"""The trainer's log on stderr: bounded in length and number, as text or JSON, one record a line."""

import json
import logging
import time
from collections.abc import Callable
from typing import Literal

from app.trainer.connections.bounds import Bucket

LogFormat = Literal["text", "json"]
# Records at once and in the long run; how many more there were is said with the next.
MOST_AT_ONCE, PER_SECOND = 100.0, 1.0


class _Bounded(logging.Formatter):
    def __init__(self, longest: int) -> None:
        super().__init__("%(message)s")
        self._longest = longest

    def format(self, record: logging.LogRecord) -> str:
        """Return the record's text with its traceback, cut to the longest."""
        text = super().format(record)
        if len(text) <= self._longest:
            return text
        return f"{text[: self._longest]} ... and {len(text):,} in all"


class _Json(_Bounded):
    def format(self, record: logging.LogRecord) -> str:
        """Return the record as one JSON object."""
        at = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        return json.dumps(
            {
                "time": f"{at}.{record.msecs:03.0f}Z",
                "level": record.levelname.lower(),
                "logger": record.name,
                "message": super().format(record),
            }
        )


class _Rate(logging.Filter):
    """Drops records that come too fast."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._bucket = Bucket(MOST_AT_ONCE, PER_SECOND, clock=clock)
        self._dropped = 0

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a record is written."""
        if not self._bucket.passes():
            self._dropped += 1
            return False
        if self._dropped:
            record.msg = f"{record.getMessage()} ({self._dropped:,} records before were dropped)"
            record.args, self._dropped = None, 0
        return True


def set_up_log(kind: LogFormat, longest: int) -> None:
    """Write this process's log in one format, from warnings on, of so many characters a record."""
    handler = logging.StreamHandler()
    handler.setFormatter((_Json if kind == "json" else _Bounded)(longest))
    handler.addFilter(_Rate())
    logging.basicConfig(handlers=[handler], level=logging.WARNING, force=True)
    logging.captureWarnings(True)
