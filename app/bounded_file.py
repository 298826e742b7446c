"""Files of a user's: read whole unless far larger than such a file is, and decoded in words."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import msgspec.inspect

from app.older_keys import with_present_keys

__all__ = ["decoded", "read_bounded"]

T = TypeVar("T")


def read_bounded(path: Path, most: int, kind: str) -> bytes:
    """Return a file's bytes; a `ValueError` names one that cannot be read or has too many."""
    try:
        with path.open("rb") as file:
            content = file.read(most + 1)
    except OSError as error:
        raise ValueError(f"cannot read {path}: {(error.strerror or str(error)).lower()}") from error
    if len(content) > most:
        raise ValueError(f"{path} is no {kind}: it has more than {most:,} bytes")
    return content


def decoded(
    decode: Callable[[Any], Any],
    content: bytes | str,
    kind: type[T],
    wrong: str,
    error: type[ValueError] = ValueError,
    *,
    lines: bool = False,  # in errors, instead of msgspec's path
) -> T:
    """Return what JSON or TOML holds; an error says what is `wrong`, why, and of TOML its line."""
    # Keys of earlier versions are taken, too.
    try:
        return msgspec.convert(with_present_keys(decode(content)), kind, str_keys=True)
    except UnicodeDecodeError:
        raise error(f"{wrong}: it is not text") from None
    except (msgspec.MsgspecError, RecursionError) as fault:  # nested without end
        words = f"{wrong}: {_explained(str(fault), kind)}"
        raise error(_with_line(words, content) if lines else words) from None


def _explained(fault: str, kind: type) -> str:
    """Return a fault with the names or values that would be right there, if there is a list."""
    where = re.search(r"at `\$(.*?)`$", fault)
    if not fault.startswith(("Object contains unknown field", "Invalid enum value")):
        return fault
    there = _types_at(msgspec.inspect.type_info(kind), where[1] if where else "")
    if fault.startswith("Object"):
        right = [field.encode_name for each in there for field in getattr(each, "fields", ())]
    else:
        right = [str(value) for each in there for value in getattr(each, "values", ())]
    message, at, path = fault.partition(" - at `")
    return f"{message} (there are {', '.join(right)}){at}{path}" if right else fault


def _with_line(fault: str, content: bytes | str) -> str:
    """Return what is wrong with a file, by the line instead of the path in it."""
    found = re.fullmatch(r"(.*?) - at `([^`]*)`(?: - at `[^`]*`)?", fault, re.DOTALL)
    if found is None:
        return fault
    message, path = found[1], found[2]
    keys = re.findall(r"\w+", path)
    own = next((key for key in reversed(keys) if not key.isdecimal()), "")
    # A field that is not known, or the one that a sentence begins with.
    named = re.search(r"unknown field `(\w+)`", message) or re.search(r": (\w+)", message)
    text = content if isinstance(content, str) else content.decode()
    line = _line_of([*keys, *([named[1]] if named else [])], text.splitlines())
    # Our own sentences name the field; msgspec's do not.
    field = f" in {own}" if re.search(r": (Expected|Invalid) ", message) else ""
    return f"{message}{field} (line {line})"


def _line_of(keys: list[str], lines: list[str]) -> int:
    """Return the line of what a path of tables, places and keys leads to, as near as it goes."""
    at, rest = 0, keys
    if len(keys) > 1 and keys[1].isdecimal():
        heads = [i for i, line in enumerate(lines) if line.strip().startswith(f"[[{keys[0]}]]")]
        at, rest = heads[int(keys[1])] if int(keys[1]) < len(heads) else 0, keys[2:]
    for key in rest:
        start = at
        for i in range(at, len(lines)):
            line = lines[i].strip()
            if i > start and line.startswith("[["):
                break
            if re.match(rf"({key}\s*=|\[(\w+\.)*{key}\])", line) or re.search(
                rf"[{{,]\s*{key}\s*=", line
            ):
                at = i
                break
    return at + 1


def _types_at(there: Any, path: str) -> list[Any]:
    """Return the types that may stand at a path of msgspec's, as `.hand[0].at_mm`."""
    found = _apart(there)
    for step in re.findall(r"\.[^.\[]+|\[", path):
        inner: list[Any] = []
        for each in found:
            if step == "[":
                inner += [getattr(each, "item_type", None), *getattr(each, "item_types", ())[:1]]
            else:
                fields = getattr(each, "fields", ())
                inner += [field.type for field in fields if field.encode_name == step[1:]]
        found = [leaf for each in inner for leaf in _apart(each)]
    return found


def _apart(there: Any) -> list[Any]:
    """Return a type, or the types of a union."""
    return list(there.types) if isinstance(there, msgspec.inspect.UnionType) else [there]
