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
) -> T:
    """Return what JSON or TOML holds, older keys too; an error says what is `wrong`, and why."""
    try:
        return msgspec.convert(with_present_keys(decode(content)), kind, str_keys=True)
    except UnicodeDecodeError:
        raise error(f"{wrong}: it is not text") from None
    except (msgspec.MsgspecError, RecursionError) as fault:  # nested without end
        raise error(f"{wrong}: {_explained(str(fault), kind)}") from None


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
