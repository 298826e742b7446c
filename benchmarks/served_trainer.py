"""A trainer in a process of its own that reports steps, time and memory when asked."""

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import psutil

from app.command_line.load import shipped_organ

if TYPE_CHECKING:
    from app.trainer.server.trainer import Trainer


class Takings(msgspec.Struct, frozen=True):
    """A trainer's steps since its start, with its processor time and memory."""

    ticks: int
    missed: int  # Ticks that the machine had no time for
    frames: dict[int, int]  # How often the duct of each client was drawn
    processor_s: float
    resident_bytes: int  # Memory of the process


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
def served_trainer(*, of_class: bool = False) -> Iterator[Served]:
    """Run a trainer in a process of its own, if need be of a class."""
    # A client that leaves while it is being drawn is a warning of viser's, here by intent.
    command = [sys.executable, "-W", "ignore::UserWarning", "-m", "benchmarks.served_trainer"]
    with subprocess.Popen(
        [*command, *(["--class"] if of_class else [])],
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
    return Takings(
        ticks=timer.ticks,
        missed=timer.missed,
        frames=trainer.frames,
        processor_s=times.user + times.system,
        resident_bytes=memory.rss,
    )


def main() -> None:
    """Serve, and answer each line with the takings, until the parent has gone."""
    from app.trainer.server.trainer import Trainer

    organ, lesson = shipped_organ(), None
    with tempfile.TemporaryDirectory() as folder:
        if "--class" in sys.argv:
            from app.classroom.store import ClassStore
            from app.trainer.classroom.lesson import Lesson

            lesson = Lesson(ClassStore.new(Path(folder, "class.sqlite"), "Measured"), organ)
        trainer = Trainer(organ, port=0, scene="free", lesson=lesson)
        trainer.warm_up.done.wait()
        print(trainer.link, trainer.teacher_link or "", sep="\n", flush=True)
        for _ in sys.stdin:
            print(msgspec.json.encode(_takings(trainer)).decode(), flush=True)
        trainer.stop()


if __name__ == "__main__":
    main()
