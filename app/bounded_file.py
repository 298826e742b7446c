"""Files of a user's: read whole unless far larger than such a file is, and decoded in words."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import msgspec.inspect

from app.older_keys import with_present_keys
from app.toml_lines import TomlLines

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
    message = found[1]
    path = [int(step) if step.isdecimal() else step for step in re.findall(r"\w+", found[2])]
    own = next((step for step in reversed(path) if isinstance(step, str)), "")
    # A field that is not known, or the one that a sentence begins with.
    named = re.search(r"unknown field `(\w+)`", message) or re.search(r": (\w+)", message)
    text = content if isinstance(content, str) else content.decode()
    line = TomlLines(text).line_of(*path, *([named[1]] if named else [])) or 1
    # Our own sentences name the field; msgspec's do not.
    field = f" in {own}" if re.search(r": (Expected|Invalid) ", message) else ""
    return f"{message}{field} (line {line})"


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
