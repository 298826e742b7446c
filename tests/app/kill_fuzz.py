"""Kills during `compress` and `export`: whether files are whole, and what the next start leaves.

`python tests/app/kill_fuzz.py COUNT` forks COUNT processes and ends each with SIGKILL: half at a
random moment, half as soon as an unfinished file is seen. A file must be the old or the new one.
`kill_fuzz.py COUNT export` kills `export` only.
"""

import os
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

from program import run
from test_compress import tube

from organ_geometry.atomic_file import remove_left_behind

PHANTOM = Path(__file__).parents[2] / "assets" / "bile_duct_phantom.organ"
SEED = 15
LONGEST = 60.0  # s that a process may take


def _started(arguments: list[object]) -> int:
    if (child := os.fork()) == 0:
        try:
            run(*arguments)
        finally:
            os._exit(0)
    return child


def main() -> None:
    """Kill, and say what was left."""
    count, chance = int(sys.argv[1]), random.Random(SEED)
    with tempfile.TemporaryDirectory() as place:
        os.environ["TMPDIR"] = tempfile.tempdir = place
        images = tube(Path(place, "images"), 14, 14, 14)
        written = Path(place, "written")
        written.mkdir()
        organ, mesh = written / "duct.organ", written / "duct.glb"
        jobs: list[tuple[Path, list[object]]] = [
            (organ, ["compress", images, "-o", organ]),
            (mesh, ["export", PHANTOM, "-o", mesh]),
        ]
        jobs = [job for job in jobs if len(sys.argv) < 3 or job[1][0] == sys.argv[2]]
        whole: dict[Path, bytes] = {}
        seconds: dict[Path, float] = {}
        for path, arguments in jobs:
            done = run(*arguments)  # once for what is compiled
            assert done.returncode == 0, done.stderr
            start = time.monotonic()
            os.waitpid(_started(arguments), 0)
            whole[path], seconds[path] = path.read_bytes(), time.monotonic() - start
        half = seen = 0
        for number in range(count):
            path, arguments = jobs[number % len(jobs)]
            path.write_bytes(b"old")
            child, start = _started(arguments), time.monotonic()
            waits = number // len(jobs) % 2 == 1
            until = start + (LONGEST if waits else chance.uniform(0.0, seconds[path]))
            ended = False
            while time.monotonic() < until and not ended:
                if waits and any(written.glob(".*.part")):
                    seen += 1
                    break
                ended = os.waitpid(child, os.WNOHANG)[0] != 0
                time.sleep(5e-4)  # leave the processor to what is watched
            if not ended:
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)
            half += path.read_bytes() not in (b"old", whole[path])
            for each in (*written.iterdir(), *Path(place).glob("bluntdissect-*")):
                os.utime(each, (0, 0), follow_symlinks=False)  # as if some time had passed
        remove_left_behind()
        for _, arguments in jobs:
            os.waitpid(_started(arguments), 0)
        left = {each.name for each in written.iterdir()} - {organ.name, mesh.name}
        left |= {each.name for each in Path(place).glob("bluntdissect-*")}
        print(
            f"{count} of {' and '.join(str(job[1][0]) for job in jobs)}, {seen} with an "
            f"unfinished file: {half} half files, "
            f"{len(left)} left after the next start"
        )
        sys.exit(1 if half or left else 0)


if __name__ == "__main__":
    main()
