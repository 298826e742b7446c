"""Where keys stand in a TOML file, for messages about them."""

import re
from collections import Counter

HEADER = re.compile(r"\s*(\[\[?)\s*([^\]#]+?)\s*\]")
KEY = re.compile(r"\s*([\w.\"'-]+)\s*=")
INNER = re.compile(r"[{,]\s*([\w\"'-]+)\s*=")  # of a table that is a value

_Path = tuple[str | int, ...]


class TomlLines:
    """The lines of a file's keys, by paths such as `("tube", 1, "radius_mm")`."""

    def __init__(self, text: str) -> None:
        self._lines: dict[_Path, int] = {}
        counts: Counter[_Path] = Counter()  # of the tables of each array so far
        table: _Path = ()
        key: _Path = ()
        for number, line in enumerate(text.splitlines(), 1):
            if header := HEADER.match(line):
                *above, last = _keys(header[2])
                table, key = (), ()
                for name in above:
                    table = (*table, name)
                    table = (*table, counts[table] - 1) if table in counts else table
                table = (*table, last)
                if header[1] == "[[":
                    counts[table] += 1
                    table = (*table, counts[table] - 1)
            elif named := KEY.match(line):
                key = _keys(named[1])
            inner = [_keys(each) for each in INNER.findall(line)]
            for path in ((*table, *key), *((*table, *key, *each) for each in inner)):
                names = tuple(step for step in path if isinstance(step, str))  # of the first table
                for known in (path, names):
                    for end in range(1, len(known) + 1):
                        self._lines.setdefault(known[:end], number)

    def line_of(self, *path: str | int) -> int | None:
        """Return the line of a key, or of the nearest that holds it; None if there is none."""
        # A path without a place in an array of tables means the first; what is in an array that
        # is a value counts as in one place of it.
        at: _Path = ()
        for step in path:
            if (*at, step) in self._lines:
                at = (*at, step)
            elif isinstance(step, str):
                break
        return self._lines.get(at)


def _keys(dotted: str) -> tuple[str, ...]:
    return tuple(re.sub(r"[\s\"']", "", dotted).split("."))
