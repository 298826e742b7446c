"""A trainer in a process of its own that reports steps, time and memory when asked."""

import gc
import subprocess
import sys
import tempfile
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import psutil

from app.command_line.load import shipped_organ

if TYPE_CHECKING:
    from app.trainer.client.practice import SceneName
    from app.trainer.server.trainer import Trainer

__all__ = ["Served", "Takings", "served_trainer"]


class Takings(msgspec.Struct, frozen=True):
    """A trainer's steps since its start, with its processor time and memory."""

    ticks: int
    missed: int  # Ticks that the machine had no time for
    frames: dict[int, int]  # How often the duct of each client was drawn
    processor_s: float
    resident_bytes: int  # Memory of the process
    # Blocks of memory that Python's own allocator has given, one or more for each small object.
    blocks: int
    # Memory that Python's allocator has given, without what is counting it; 0 if not traced.
    traced_bytes: int
    log_inputs: int  # Inputs that the runs of all sessions hold


class Served:
    """A trainer's process, seen from outside."""

    def __init__(self, process: "subprocess.Popen[str]", link: str, teacher_link: str) -> None:
        self._process, self.link, self.teacher_link = process, link, teacher_link
        self.address = link.partition("/?")[0]

    def takings(self) -> Takings:
        """Ask the trainer."""
        asked, answers = self._process.stdin, self._process.stdout
        assert asked is not None
        assert answers is not None
        print("takings", file=asked, flush=True)
        return msgspec.json.decode(answers.readline(), type=Takings)


@contextmanager
def served_trainer(
    *, mode: str = "pull", traced: bool = False, of_class: bool = False
) -> Iterator[Served]:
    """Run a trainer in a process of its own, whose pages open in a mode, if need be of a class."""
    # A client that leaves while it is being drawn is a warning of viser's, here by intent.
    command = [sys.executable, "-W", "ignore::UserWarning", "-m", "benchmarks.served_trainer", mode]
    with subprocess.Popen(
        [*command, *(["--traced"] if traced else []), *(["--class"] if of_class else [])],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            link = process.stdout.readline().strip() if process.stdout else ""
            if not link:
                raise RuntimeError("the trainer did not start")
            assert process.stdout is not None
            yield Served(process, link, process.stdout.readline().strip())
        finally:
            process.terminate()


def _takings(trainer: "Trainer") -> Takings:
    times, memory = psutil.Process().cpu_times(), psutil.Process().memory_info()
    timer = trainer.timer
    traced = tracemalloc.is_tracing()
    gc.collect()
    return Takings(
        ticks=timer.ticks,
        missed=timer.missed,
        frames=trainer.frames,
        processor_s=times.user + times.system,
        resident_bytes=memory.rss,
        # Never a list of all objects: it would hold what other threads are still making.
        blocks=sys.getallocatedblocks(),
        traced_bytes=tracemalloc.get_traced_memory()[0] if traced else 0,
        log_inputs=sum(session.run.inputs for session in trainer.sessions.values()),
    )


def main() -> None:
    """Serve, and answer each line with the takings, until the parent has gone."""
    if "--traced" in sys.argv:
        tracemalloc.start()
    from app.trainer.server.trainer import Trainer

    organ, lesson = shipped_organ(), None
    with tempfile.TemporaryDirectory() as folder:
        if "--class" in sys.argv:
            from app.classroom.store import ClassStore
            from app.trainer.classroom.lesson import Lesson

            lesson = Lesson(ClassStore.new(Path(folder, "class.sqlite"), "Measured"), organ)
        scene: SceneName = "free" if "pull" in sys.argv else "bed"
        trainer = Trainer(organ, port=0, scene=scene, lesson=lesson)
        trainer.warm_up.done.wait()
        print(trainer.link, trainer.teacher_link or "", sep="\n", flush=True)
        for _ in sys.stdin:
            print(msgspec.json.encode(_takings(trainer)).decode(), flush=True)
        trainer.stop()


if __name__ == "__main__":
    main()
