"""How commands answer: in lines of names and values, or as JSON; and a bar while they work."""

import json
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from app.workers import Progress

AsJson = Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")]


def answer(
    result: object, lines: Iterable[tuple[str, object]], *, as_json: bool, width: int = 18
) -> None:
    """Print a result as JSON, or lines that say the same."""
    if as_json:
        print(json.dumps(result))
    else:
        print_lines(lines, width)


def print_lines(lines: Iterable[tuple[str, object]], width: int = 18) -> None:
    """Print names and values in two columns."""
    for name, value in lines:
        print(f"{name:<{width}} {value}")


@contextmanager
def progress_bar(what: str, *, time_left: bool = False) -> "Generator[Progress]":
    """Give what shows on stderr how many are done of how many, while somebody watches."""
    from rich import progress
    from rich.console import Console

    console = Console(stderr=True)
    columns = (progress.TimeRemainingColumn(), "left") if time_left else ()
    with progress.Progress(
        what,
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        *columns,
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
