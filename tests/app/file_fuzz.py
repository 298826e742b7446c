"""Mutated organ, run, preset, image, spacing and exercise files: read, and what was read is used.

`python tests/app/file_fuzz.py KIND RUNS` has atheris (libFuzzer) mutate good files, led by lines
that they reach. It ends in an error at the first that is neither taken nor refused in words,
takes more than `SECONDS` of the processor, or has the process grow by more than `MEGABYTES`.
"""

import binascii
import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any

import cv2
import numpy as np
from program import run

from app.classroom import exercise_file
from app.classroom.exercise_file import GOALS, read_exercise, template
from app.command_line.load import shipped_organ
from app.simulation import read_run
from app.simulation.runs import older_runs, run_file
from app.simulation.specimen import preset
from app.simulation.specimen.preset import preset_toml, presets, read_preset
from organ_geometry import read_image_stack
from organ_geometry.images import image_files, spacing_file, stack_reader
from organ_geometry.organ_file import organ_code, organ_file, organ_from_bytes, symbol_coder

SECONDS, MEGABYTES = 5.0, 1024
LONGEST = 4096  # bytes of a mutated file
LED_BY = (
    organ_file, organ_code, symbol_coder, preset, run_file, older_runs, image_files,
    spacing_file, stack_reader, exercise_file,
)  # fmt: skip
"""Modules whose lines lead the mutations; compiled code cannot."""
REPLAYED = 300  # ticks at most of a run that is made again
RUNS = Path(__file__).parent / "runs"
SPACING = b'{"pixel_spacing_mm": 0.1, "slice_spacing_mm": 0.5}'


def use_organ(content: bytes, folder: Path) -> None:
    """Read an organ, and export its surface."""
    organ_from_bytes(content)
    path = folder / "mutated.organ"
    path.write_bytes(content)
    _done("export", path, "-o", folder / "mutated.stl")


def use_run(content: bytes, folder: Path) -> None:
    """Read a run, and make it again if it is short."""
    if read_run(content).log.ticks <= REPLAYED:
        path = folder / "mutated.json"
        path.write_bytes(content)
        _done("replay", path)


def use_preset(content: bytes, folder: Path) -> None:
    """Read a preset."""
    del folder
    read_preset(content, "mutated.toml")


def use_image(content: bytes, folder: Path) -> None:
    """Read a stack of which one image is mutated."""
    _stack(folder, content, SPACING)


def use_spacing(content: bytes, folder: Path) -> None:
    """Read a stack whose spacing.json is mutated."""
    _stack(folder, _image(0), content)


def use_exercise(content: bytes, folder: Path) -> None:
    """Read an exercise, and ask what it says of a duct."""
    del folder
    read_exercise(content.decode("utf-8", "replace")).on(shipped_organ(), None)


KINDS: dict[str, tuple[Callable[[bytes, Path], None], Callable[[], list[bytes]]]] = {
    "organ": (use_organ, lambda: [shipped_organ().encoded or b""]),
    "run": (use_run, lambda: [path.read_bytes() for path in sorted(RUNS.iterdir())]),
    "preset": (use_preset, lambda: [preset_toml(each) for each in presets().values()]),
    "image": (use_image, lambda: [_image(number) for number in range(3)]),
    "spacing": (use_spacing, lambda: [SPACING]),
    "exercise": (use_exercise, lambda: [template(goal).encode() for goal in GOALS]),
}
"""What is done with a file of each kind, and good ones to begin with."""


def _done(*arguments: object) -> None:
    done = run(*arguments)
    if done.returncode not in (0, 2) or "Traceback" in done.stderr:
        raise RuntimeError(f"{arguments}: {done.returncode}\n{done.stderr}")


def _image(number: int) -> bytes:
    picture = cv2.circle(np.zeros((24, 24), np.uint8), (12 + number, 12), 6, 255, -1)
    return cv2.imencode((".png", ".tif", ".jpg")[number], picture)[1].tobytes()


def _stack(folder: Path, content: bytes, spacing: bytes) -> None:
    for number in range(2):
        (folder / f"{number}.png").write_bytes(_image(0))
    kind = ".jpg" if content[:2] == b"\xff\xd8" else ".tif" if content[:1] in b"IM" else ".png"
    path = folder / f"2{kind}"
    path.write_bytes(content)
    (folder / "spacing.json").write_bytes(spacing)
    try:
        for image in read_image_stack(folder).images():
            del image
    finally:
        path.unlink()


def organ_of(packed: bytes) -> bytes:
    """Return an organ file of mutated numbers, with the checksum that fits."""
    start = b"\x89\xe3"
    check = binascii.crc_hqx(packed, binascii.crc_hqx(start, 0xFFFF))
    return start + check.to_bytes(2, "big") + packed


def _lead(atheris: Any) -> None:
    """Have the lines reached in `LED_BY` reported to atheris."""
    for module in LED_BY:
        for each in vars(module).values():
            if getattr(each, "__module__", None) != module.__name__:
                continue
            for function in (each, *vars(each).values()) if isinstance(each, type) else (each,):
                if isinstance(function, FunctionType):
                    atheris.instrument_func(function)


def main() -> None:
    """Fuzz one kind of file."""
    import atheris  # pyright: ignore[reportMissingImports, reportMissingModuleSource]

    kind, runs = sys.argv[1], int(sys.argv[2])
    use, seeds = KINDS[kind]
    _lead(atheris)
    with tempfile.TemporaryDirectory() as place:
        folder, corpus = Path(place, "used"), Path(place, "corpus")
        folder.mkdir()
        corpus.mkdir()
        for number, seed in enumerate(seeds()):
            use(seed, folder)
            (corpus / str(number)).write_bytes(seed)
        begun = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        count = taken = 0
        slowest = 0.0

        def try_one(content: bytes) -> None:
            nonlocal count, taken, slowest
            start = time.process_time()
            try:
                use(content, folder)
                taken += 1
            except ValueError as refusal:
                if not str(refusal):
                    raise RuntimeError("refused without a word") from refusal
            count, slowest = count + 1, max(slowest, time.process_time() - start)
            grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 - begun
            if slowest > SECONDS or grown > MEGABYTES:
                raise RuntimeError(f"{slowest:.1f} s, +{grown:.0f} MB")
            if count == runs:
                print(
                    f"{kind}: {count:,} files, {taken:,} taken, none unclean, slowest "
                    f"{slowest:.1f} s, +{grown:.0f} MB",
                    flush=True,
                )
                sys.stdout.flush()
                os._exit(0)

        def mutated_organ(content: bytes, longest: int, _: int) -> bytes:
            return organ_of(atheris.Mutate(content[4:], longest - 4))

        options = [f"-max_len={LONGEST}", "-seed=15", "-timeout=120", "-rss_limit_mb=0"]
        found = Path.cwd() / "build"
        found.mkdir(exist_ok=True)
        options += [f"-artifact_prefix={found}/", str(corpus)]
        mutator = {"custom_mutator": mutated_organ} if kind == "organ" else {}
        atheris.Setup([sys.argv[0], *options], try_one, **mutator)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
