"""Files that appear whole or not at all."""

import os
import tempfile
from pathlib import Path

__all__ = ["check_target", "make_folder", "write_atomic"]


def check_target(path: Path) -> None:
    """Raise if no file can be written there: better before long work than after it."""
    if not path.parent.is_dir():
        raise ValueError(f"cannot write {path}: there is no folder {path.parent}")
    if path.is_dir():
        raise ValueError(f"cannot write {path}: it is a folder; give the name of a file")
    if path.exists() and not path.is_file():
        raise ValueError(f"cannot write {path}: it is a device or a pipe; give the name of a file")


def make_folder(path: Path, refusal: str) -> None:
    """Make a folder, and those above it, where there is none."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"{refusal}: {(error.strerror or str(error)).lower()}") from error


def write_atomic(path: Path, content: bytes) -> None:
    """Write a file under a temporary name and move it into place."""
    check_target(path)
    path = path.resolve()  # a link stays one: what it points to is replaced
    beside: Path | None = None
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
        beside = Path(name)
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        beside.chmod(0o666 & ~_umask())
        beside.replace(path)
    except OSError as error:
        raise ValueError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        if beside is not None:
            beside.unlink(missing_ok=True)


def _umask() -> int:
    """Return the process's mask of permissions, which can only be read by setting it."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
