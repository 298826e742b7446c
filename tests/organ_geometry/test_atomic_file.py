"""Files appear whole or not at all."""

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from organ_geometry.atomic_file import WorkFolder, remove_left_behind, write_atomic


def test_a_full_disk_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "duct.organ"
    write_atomic(path, b"old")

    def full(handle: int, mode: str) -> object:
        os.close(handle)
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fdopen", full)
        with pytest.raises(ValueError, match=r"cannot write .*duct\.organ: No space left"):
            write_atomic(path, b"new")
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_targets_that_cannot_be_are_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="there is no folder"):
        write_atomic(tmp_path / "nowhere" / "duct.organ", b"")
    with pytest.raises(ValueError, match="it is a folder"):
        write_atomic(tmp_path, b"")
    assert not list(tmp_path.iterdir())


def test_devices_and_pipes_are_left_alone(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for target in (pipe, Path(os.devnull)):
        with pytest.raises(ValueError, match="a device or a pipe"):
            write_atomic(target, b"")
        assert target.exists()
        assert not target.is_file()


def test_a_link_stays_one_and_its_target_is_replaced(tmp_path: Path) -> None:
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_bytes(b"old")
    link.symlink_to(target)
    write_atomic(link, b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"


def test_permissions_are_those_of_any_new_file(tmp_path: Path) -> None:
    plain, whole = tmp_path / "plain", tmp_path / "whole"
    plain.write_bytes(b"")
    write_atomic(whole, b"")
    assert whole.stat().st_mode == plain.stat().st_mode


KILLED = """
import os, signal, sys
from pathlib import Path
from organ_geometry.atomic_file import WorkFolder, write_atomic
folder = WorkFolder()
Path(folder.name, "sent.png").write_bytes(b"an image")
os.fdopen = lambda handle, mode: (os.write(handle, b"half"), os.kill(os.getpid(), signal.SIGKILL))
write_atomic(Path(sys.argv[1]), b"new")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there what was left behind stays")
def test_what_a_killed_process_leaves_is_removed_by_the_next_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def aged() -> set[str]:
        for each in tmp_path.iterdir():
            os.utime(each, (0, 0), follow_symlinks=False)
        return {each.name for each in tmp_path.iterdir()}

    path = tmp_path / "duct.organ"
    write_atomic(path, b"old")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    killed = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert killed.returncode == -signal.SIGKILL
    (tmp_path / "bluntdissect-link").symlink_to(path)
    left = aged()
    assert len(left) == 4
    assert path.read_bytes() == b"old"
    working = WorkFolder()  # which removes another's folder
    aged()
    remove_left_behind()  # not what is at work
    write_atomic(path, b"new")
    assert path.read_bytes() == b"new"
    assert {each.name for each in tmp_path.iterdir()} == {
        path.name, "bluntdissect-link", Path(working.name).name
    }  # fmt: skip
    young = tmp_path / f".{path.name}.young.part"
    young.write_bytes(b"half")
    write_atomic(path, b"newer")
    assert young.exists()  # its writer may be about to lock it
    working.cleanup()
    assert not Path(working.name).exists()
