"""Files that appear whole or not at all, and work folders that no killed process leaves for long.

Who writes a file or works in a folder holds a lock on it, which ends with the process. So what has
no lock was left behind, and is removed by the next that works there.
"""

import contextlib
import glob
import os
import re
import shutil
import tempfile
import time
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows: what was left behind stays
    fcntl = None

# How names of work folders begin.
WORK_FOLDER = "bluntdissect-"
# s in which what was just made gets its lock.
LOCKED_WITHIN = 2.0


def file_name(name: str) -> str:
    """Return a name as a file's, valid on every system: of letters, digits, `-` and `_`."""
    return re.sub(r"[^\w-]+", "_", name).strip("_") or "organ"


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
        remove_left_behind(path.parent, f".{glob.escape(path.name)}.*.part")
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
        beside = Path(name)
        _lock(handle)
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        beside.chmod(0o666 & ~_umask())
        beside.replace(path)
    except OSError as error:
        raise ValueError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        if beside is not None:
            beside.unlink(missing_ok=True)


class WorkFolder(tempfile.TemporaryDirectory[str]):
    """A temporary folder that the next one's maker removes if this process is killed."""

    def __init__(self) -> None:
        remove_left_behind()
        super().__init__(prefix=WORK_FOLDER, ignore_cleanup_errors=True)
        self._handle: int | None = None
        if fcntl is not None:
            self._handle = os.open(self.name, os.O_RDONLY)
            _lock(self._handle)

    def cleanup(self) -> None:
        """Remove the folder with all that is in it."""
        handle, self._handle = self._handle, None
        super().cleanup()
        if handle is not None:
            os.close(handle)


def remove_left_behind(folder: Path | None = None, names: str = f"{WORK_FOLDER}*") -> None:
    """Remove what killed processes have left: work folders, or unfinished files in a folder."""
    if fcntl is None:
        return
    for left in Path(tempfile.gettempdir() if folder is None else folder).glob(names):
        # Another may be faster, and others' files are their own.
        with contextlib.suppress(OSError):
            found = left.lstat()
            young = abs(time.time() - found.st_mtime) < LOCKED_WITHIN
            if young or found.st_uid != os.geteuid() or left.is_symlink():
                continue
            handle = os.open(left, os.O_RDONLY)
            try:
                if not _lock(handle):
                    continue
                if left.is_dir():
                    shutil.rmtree(left, ignore_errors=True)
                else:
                    left.unlink()
            finally:
                os.close(handle)


def _lock(handle: int) -> bool:
    """Lock an open file or folder until it is closed; return False if another has the lock."""
    if fcntl is not None:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
    return True


def _umask() -> int:
    """Return the process's mask of permissions, which can only be read by setting it."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
