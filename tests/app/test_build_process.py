"""The process that builds organs: what it makes, tells, refuses, and how it is ended."""

import os
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from made import dead, doubled, forever, large, missing, refused
from own_organ import phantom_start
from program import LONGEST

from app.compression.build_process import Abandoned, BuildProcess
from app.compression.organ_workbench import OrganWorkbench, PromiseRefusedError
from app.trainer.client.background_worker import BackgroundWorker
from assets import BILE_DUCT_PHANTOM
from organ_geometry import Promise
from organ_geometry.images.stack_reader import read_image_stack
from organ_geometry.organ_builder import build_organ


@pytest.fixture(scope="module")
def process() -> Iterator[BuildProcess]:
    running = BuildProcess()
    yield running
    running.stop()
    assert running._process is None


def nothing(done: int, total: int) -> None:
    """A progress that nobody looks at."""


def test_what_is_made_comes_back_with_its_progress(process: BuildProcess) -> None:
    reported: list[tuple[int, int]] = []
    twice, number = process.make(
        doubled, 3, progress=lambda *each: reported.append(each), wanted=lambda: True
    )
    assert twice == 6
    assert reported == [(1, 3), (2, 3), (3, 3)]
    assert number != os.getpid()
    # The same process makes the next.
    assert process.make(doubled, 1, progress=nothing, wanted=lambda: True) == (2, number)


def test_a_refusal_is_a_refusal_here_and_the_process_goes_on(process: BuildProcess) -> None:
    _, number = process.make(doubled, 1, progress=nothing, wanted=lambda: True)
    with pytest.raises(ValueError, match=r"^not possible$"):
        process.make(refused, progress=nothing, wanted=lambda: True)
    assert process.make(doubled, 1, progress=nothing, wanted=lambda: True)[1] == number


def test_what_nobody_wants_any_more_is_ended_at_once_and_the_next_is_made(
    process: BuildProcess,
) -> None:
    begun = threading.Event()
    with pytest.raises(Abandoned):
        process.make(forever, progress=lambda *_: begun.set(), wanted=lambda: not begun.is_set())
    assert begun.is_set()
    with pytest.raises(Abandoned):
        process.make(doubled, 1, progress=nothing, wanted=lambda: False)
    assert process.make(doubled, 4, progress=nothing, wanted=lambda: True)[0] == 8


def test_a_file_that_is_missing_there_is_missing_here(process: BuildProcess) -> None:
    with pytest.raises(FileNotFoundError):
        process.make(missing, progress=nothing, wanted=lambda: True)


def test_a_process_that_dies_is_said_and_the_next_is_made(process: BuildProcess) -> None:
    with pytest.raises(RuntimeError, match="process that builds organs has ended"):
        process.make(dead, progress=nothing, wanted=lambda: True)
    assert process.make(doubled, 4, progress=nothing, wanted=lambda: True)[0] == 8


def test_stop_ends_what_is_being_made() -> None:
    own, begun = BuildProcess(), threading.Event()
    failed: list[type[BaseException]] = []

    def make() -> None:
        try:
            own.make(forever, progress=lambda *_: begun.set(), wanted=lambda: True)
        except Abandoned as error:
            failed.append(type(error))

    thread = threading.Thread(target=make)
    thread.start()
    assert begun.wait(LONGEST)
    own.stop()
    thread.join(LONGEST)
    assert failed == [Abandoned]
    with pytest.raises(Abandoned):
        own.make(doubled, 1, progress=nothing, wanted=lambda: True)
    assert own._process is None


def test_a_workbench_gives_the_same_bytes_by_another_process(
    process: BuildProcess, tmp_path: Path
) -> None:
    few = phantom_start(tmp_path / "few", 12)
    bench, reported = OrganWorkbench(process=process), list[tuple[int, int]]()
    opened = bench.open_folder(few, lambda *each: reported.append(each))
    assert reported[-1] == (12, 12)
    assert opened.picture(6).shape == (480, 480, 3)
    built = bench.build(0.5)
    here = build_organ(read_image_stack(few), promise=Promise(tolerance_px=0.5))
    assert built.organ.encoded == here.organ.encoded
    with pytest.raises(PromiseRefusedError, match="the smallest that can is"):
        bench.build(0.01)
    bench.close()


def test_closing_a_workbench_ends_what_is_built_on_it(process: BuildProcess) -> None:
    bench = OrganWorkbench(process=process)
    with pytest.raises(Abandoned):
        bench.open_folder(
            Path(BILE_DUCT_PHANTOM), lambda done, _total: bench.close() if done == 2 else None
        )


def test_who_waits_is_told_for_how_many() -> None:
    background, at, go = BackgroundWorker(), threading.Event(), threading.Event()

    def work() -> None:
        at.set()
        assert go.wait(LONGEST)

    assert background.tasks_ahead_of("mine") == 0
    background.submit("first", work)
    assert at.wait(LONGEST)
    assert background.tasks_ahead_of("first") == 0
    assert background.tasks_ahead_of("mine") == 1
    background.submit("second", lambda: None)
    assert background.tasks_ahead_of("mine") == 2
    background.submit("mine", lambda: None)
    assert background.tasks_ahead_of("mine") == 2
    go.set()
    background.stop()
    assert background.tasks_ahead_of("mine") == 0


@pytest.mark.skipif(sys.platform != "linux", reason="another system bounds no process's memory")
def test_a_task_has_so_much_time_and_memory_and_the_next_is_made() -> None:
    spacious, quick = BuildProcess(seconds=LONGEST, mib=1024), BuildProcess(seconds=1.0)
    try:
        with pytest.raises(ValueError, match="more than 1024 MiB of memory: use fewer or smaller"):
            spacious.make(large, progress=nothing, wanted=lambda: True)
        with pytest.raises(ValueError, match="longer than 1 s, which others wait for: use fewer"):
            quick.make(forever, progress=nothing, wanted=lambda: True)
        assert spacious.make(doubled, 4, progress=nothing, wanted=lambda: True)[0] == 8
    finally:
        spacious.stop()
        quick.stop()
    with pytest.raises(ValueError, match="--build-seconds must be at least 1"):
        BuildProcess(seconds=0.0)
    with pytest.raises(ValueError, match="--build-memory must be at least 512"):
        BuildProcess(mib=0)
