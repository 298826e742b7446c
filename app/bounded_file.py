"""Files of a user's that are read whole, unless they are far larger than such a file is."""

from pathlib import Path

__all__ = ["read_bounded"]


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
