"""Files of a user's: read whole unless far larger than such a file is, and decoded in words."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import msgspec

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
    decode: Callable[..., T],
    content: bytes | str,
    kind: type[T],
    wrong: str,
    error: type[ValueError] = ValueError,
) -> T:
    """Return what JSON or TOML holds, by msgspec's `decode`; an error says what is `wrong`, why."""
    try:
        return decode(content, type=kind)
    except UnicodeDecodeError:
        raise error(f"{wrong}: it is not text") from None
    except (msgspec.MsgspecError, RecursionError) as fault:  # nested without end
        raise error(f"{wrong}: {fault}") from None
