"""`bluntdissect study`: many ducts whose inputs are not known well, and what comes of it."""

import json
import time
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from app.command_line.answer import AsJson, answer, progress_bar


class _RunUnlessNamed(TyperGroup):
    """A group whose `run` need not be written."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if args and args[0] not in {*self.commands, "--help", "-h"}:
            args = ["run", *args]
        return super().parse_args(ctx, args)


study = typer.Typer(
    cls=_RunUnlessNamed,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Solve many ducts whose inputs are not known well, and say what follows.\n\n"
    "Examples: bluntdissect study plan.toml -o results/, then bluntdissect study report results/",
)


@study.command("run")
def run(
    plan: Annotated[
        Path, typer.Argument(help="The plan, a TOML file; docs/study.md has its keys.")
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", help="Folder of the results; a study that was ended goes on."
        ),
    ],
    workers: Annotated[
        int | None,
        typer.Option(
            help="Processes on this machine.",
            show_default="one a core, none for a short study",
            min=1,
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="A Dask scheduler whose workers do it instead: tcp://HOST:PORT."),
    ] = None,
    as_csv: Annotated[bool, typer.Option("--csv", help="Write the results as CSV, too.")] = False,
    as_json: AsJson = False,
) -> None:
    """Solve the ducts of a plan; `study PLAN` is the same as `study run PLAN`.

    Example: bluntdissect study plan.toml -o results/
    """
    from app.study.ensemble import run_study
    from app.study.plan import read_plan

    if workers is not None and scheduler is not None:
        raise ValueError("give either --workers or --scheduler")
    need("pyarrow", "scipy")
    chosen = read_plan(plan)
    started = time.perf_counter()
    with progress_bar("rows", time_left=True) as progress:
        done = run_study(
            chosen,
            output,
            workers=workers,
            scheduler=scheduler,
            as_csv=as_csv,
            progress=progress,
        )
    seconds = time.perf_counter() - started
    result = {
        "rows": done.rows,
        "solved_now": done.solved,
        "faults": done.faults,
        "seconds": seconds,
        "results": str(output / "results.parquet"),
    }
    kept = done.rows - done.solved
    what = "cases" if chosen.has_anatomy else "ducts"
    rate = f", {done.solved / max(seconds, 1e-9):,.3g} {what} a second"
    lines = [
        (what, f"{done.rows:,}" + (f", {kept:,} of them from before" if kept else "")),
        ("faults", f"{done.faults:,} {what} could not be solved" if done.faults else "none"),
        ("time", f"{seconds:.1f} s" + rate if done.solved else "none was left to solve"),
        ("results", result["results"]),
    ]
    answer(result, lines, as_json=as_json, width=10)


@study.command("report")
def report(
    results: Annotated[Path, typer.Argument(help="The folder of a study's results.")],
    preset: Annotated[
        Path | None,
        typer.Option(help="Write a preset, .toml, of the ducts: the trainer shows their band."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The figures as JSON on stdout.")] = False,
) -> None:
    """Draw what comes of a study: report.html, and its figures in report.json.

    Example: bluntdissect study report results/
    """
    need("pyarrow", "scipy", "SALib", "matplotlib")
    from app.study.report import write_report

    if preset is not None and preset.suffix.lower() != ".toml":
        raise ValueError(f"--preset {preset} must end in .toml")
    found = write_report(results)
    if preset is not None:
        from app.simulation import preset_toml
        from app.study.preset import preset_of_results
        from organ_geometry import write_atomic

        write_atomic(preset, preset_toml(preset_of_results(results)))
    if as_json:
        print(json.dumps(found))
        return
    for line in found["summary"]:
        print(line)
    print(f"\n{results / 'report.html'} and report.json are written")
    if preset is not None:
        print(f"{preset} has the ducts' tissue: open it under Model in the trainer")


def need(*packages: str) -> None:
    """Raise unless packages of the extra are installed."""
    from importlib.util import find_spec

    missing = [name for name in packages if find_spec(name) is None]
    if missing:
        raise ValueError(f"this needs {', '.join(missing)}: pip install 'bluntdissect[study]'")
