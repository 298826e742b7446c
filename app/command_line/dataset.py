"""`bluntdissect dataset`: demonstrations of scripted hands, for learners of other projects."""

import re
import time
from pathlib import Path
from typing import Annotated

import typer

from app.command_line.answer import AsJson, answer, progress_bar


def dataset(
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="Folder of the data; one that was ended goes on."),
    ],
    exercise: Annotated[str, typer.Option(help="window, follow_front or free_scar.")] = "window",
    bed: Annotated[str, typer.Option(help="A bed; the scar's exercise brings its own.")] = "normal",
    seeds: Annotated[
        str, typer.Option(help="Seeds of the beds, an episode each: FIRST-LAST.")
    ] = "1-20",
    manner: Annotated[
        str, typer.Option(help="How the scripted hands work: good, hasty, clumsy.")
    ] = "good",
    tremor: Annotated[
        float, typer.Option(help="Standard deviation of where a hand is led, mm.", min=0.0, max=5.0)
    ] = 0.1,
    ticks: Annotated[int, typer.Option(help="Ticks of 1/30 s in a step.", min=1, max=30)] = 3,
    name: Annotated[
        str | None, typer.Option(help="Of the data set.", show_default="bluntdissect/EXERCISE-v0")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(help="Processes on this machine.", show_default="one a core", min=1),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            help="A Dask scheduler whose workers, on this folder, do it: tcp://HOST:PORT."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Make demonstrations by scripted hands, as data sets of Minari and LeRobot.

    Each episode is also a run that replays, with its measures and errors.

    Example: bluntdissect dataset -o window/ --exercise window --seeds 1-100 --tremor 0.1
    """
    if workers is not None and scheduler is not None:
        raise ValueError("give either --workers or --scheduler")
    try:
        from app.rl.dataset import make_dataset
    except ImportError as error:
        raise ValueError(f"this needs {error.name}: pip install 'bluntdissect[dataset]'") from None
    from app.workers import cores

    asked = re.fullmatch(r"(\d{1,18})(?:-(\d{1,18}))?", seeds.strip())
    first, last = (int(asked[1]), int(asked[2] or asked[1])) if asked else (1, 0)
    if not 0 < last - first + 1 <= 1_000_000:
        raise ValueError(f"--seeds must be FIRST-LAST, such as 1-20, got {seeds}")
    started = time.perf_counter()
    with progress_bar("episodes", time_left=True) as progress:
        done = make_dataset(
            output,
            name or f"bluntdissect/{exercise.replace('_', '-')}-v0",
            {"exercise": exercise, "bed": bed, "ticks_per_step": ticks},
            range(first, last + 1),
            manner=manner,
            tremor=tremor,
            workers=workers or min(cores(), last - first + 1),
            scheduler=scheduler,
            progress=progress,
        )
    seconds = time.perf_counter() - started
    errors = ", ".join(f"{count} {key}" for key, count in done["errors"].items())
    lines = [
        ("episodes", f"{done['episodes']:,}, {done['passed']:,} passed, {done['steps']:,} steps"),
        ("errors", errors or "none"),
        ("time", f"{seconds:.1f} s"),
        ("Minari", output / "data"),
        ("LeRobot", output / "lerobot"),
        ("runs", output / "runs"),
    ]
    answer(done | {"seconds": seconds}, lines, as_json=as_json, width=10)
