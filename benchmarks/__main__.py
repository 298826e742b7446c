"""Measure physics, trainer and geometry in one run: tables, and the figures in build/bench.json.

Run from the root of the repository: ``make bench``, or ``python -m benchmarks``; with names of
parts, as ``python -m benchmarks geometry``, only these. ``python -m benchmarks cheats`` looks for
policies that pass exercises with errors, ``--seconds`` in each, or in each that ``--of`` names.
``blind`` answers *Who is who* by rules, and ``faults`` measures how well errors are found, in half
an hour. These three are done when named only.
"""

import argparse
import json
import platform
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import numpy as np
from rich.console import Console
from rich.table import Table

from app.anatomy.figure import figure_kind
from app.command_line.load import shipped_organ
from benchmarks.bed_step import measure_bed
from benchmarks.blind_answers import measure_blind_answers
from benchmarks.cheats import EXERCISES, measure_cheats
from benchmarks.cubic_beam import cubic_array_rate, cubic_engine
from benchmarks.dissection_exercises import measure_exercises
from benchmarks.duct import DUCT, FORCE
from benchmarks.engine import Engine
from benchmarks.evidence import measure_evidence
from benchmarks.exact_beam import exact_engines
from benchmarks.faults import measure_faults
from benchmarks.finder_cost import measure_finder
from benchmarks.geometry import measure_geometry, plain_table
from benchmarks.haptic_servo import measure_haptics
from benchmarks.network_step import measure_network
from benchmarks.peers import peer_engines
from benchmarks.policy_speed import measure_policies
from benchmarks.session_step import step_figures
from benchmarks.skinning import export_figures, skinning_figures
from benchmarks.spring_chain import spring_chain_engine
from benchmarks.study_rate import measure_study
from benchmarks.trainer_clients import CLIENTS, client_figures

FIGURES = Path(__file__).parents[1] / "build" / "bench.json"
# What the others are compared with: ours inside compiled code, and as a Python call.
COMPILED, CALLED = "exact_centre_warm", "exact_python_call"


def machine() -> dict[str, str | int]:
    """Return a description of the machine."""
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "processor": str(llvmlite.binding.get_host_cpu_name()),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
    }


def physics_table(engines: list[Engine]) -> Table:
    """Return times, errors and ratios as a table."""
    times = {engine.key: engine.time for engine in engines}
    table = plain_table(f"A duct of {DUCT.span:g} mm under {FORCE:.3f} N; warm: 1 % load steps")
    table.add_column("")
    for heading in ("us a solve", "off by %", "/ first", "/ call"):
        table.add_column(heading, justify="right", no_wrap=True)
    for engine in engines:
        ratios = ["", ""]
        if engine.time is not None and not engine.key.startswith("exact"):
            ours = (times[COMPILED], times[CALLED])
            ratios = [f"{engine.time / time:.3g}" if time else "" for time in ours]
        table.add_row(
            engine.title,
            "-" if engine.time is None else f"{engine.time:.3g}",
            "" if engine.error is None else f"{100.0 * engine.error:+.4f}",
            *ratios,
        )
    return table


def measure_physics(console: Console) -> dict[str, object]:
    """Print and return the figures of the physics."""
    with console.status("Compiling and timing beams ..."):
        engines = [*exact_engines(), cubic_engine(), spring_chain_engine(), *peer_engines()]
        rate = cubic_array_rate()
    console.print(physics_table(engines))
    console.print("A call is one from Python. / first, / call: over the first row, over its call.")
    notes = {engine.key: engine.note for engine in engines if engine.note}
    for note in notes.values():
        console.print(note, highlight=False, markup=False, soft_wrap=True)
    console.print(f"cubic, array of forces: {rate / 1e6:.0f} million a second", highlight=False)
    return {
        **{f"{engine.key}_us": engine.time for engine in engines},
        "cubic_array_per_s": rate,
        "errors": {engine.key: engine.error for engine in engines},
        "notes": notes,
    }


def measure_trainer(console: Console) -> dict[str, float]:
    """Print and return the figures of the trainer."""
    with console.status("Timing the trainer ..."):
        figures = step_figures() | client_figures()
    lines = [
        "",
        f"Trainer: a step (beam, criterion, skin) {figures['step_us']:.0f} us, its skin "
        f"({figures['vertices']:.0f} vertices) {figures['skin_us']:.0f} us",
        f"  by hand {figures['hand_us']:.0f} us, with a ghost {figures['ghost_us']:.0f} us, with "
        f"the chain {figures['chain_us']:.0f} us, idle {figures['idle_us']:.0f} us, stress "
        f"{figures['stress_us']:.0f} us",
    ]
    lines += [
        f"{clients} client{'s' if clients > 1 else ''}: "
        f"{figures[f'steps_per_second_{clients}']:.1f} steps a second, "
        f"{figures[f'missed_percent_{clients}']:.1f} % missed; "
        f"{figures[f'drawn_per_second_{clients}']:.1f} frames a second drawn and "
        f"{figures[f'frames_per_second_{clients}']:.1f} received, "
        f"{figures[f'longest_gap_ms_{clients}']:.0f} ms between two at most; "
        f"{figures[f'processor_percent_{clients}']:.0f} % of one core, "
        f"{figures[f'resident_mb_{clients}']:.0f} MB"
        for clients in CLIENTS
    ]
    lines.append(f"slider to vertices: {figures['answer_ms_95']:.0f} ms at the 95th percentile")
    lines.append(
        f"the machine meanwhile: a million additions in plain Python "
        f"{figures['plain_loop_ms']:.0f} ms, a warm call of the exact beam "
        f"{figures['exact_beam_us']:.1f} us"
    )
    for line in lines:
        console.print(line, highlight=False)
    return figures


def measure_export(console: Console) -> dict[str, float]:
    """Print and return the figures of the skin and of a rigged organ."""
    with console.status("Timing the skin and the export ..."):
        organ = shipped_organ()
        figures = skinning_figures(organ) | export_figures(organ)
    for line in (
        f"Skin of {figures['skinned_vertices']:,.0f} vertices: moved in {figures['deform_us']:.0f} "
        f"us, with its driving points in {figures['deform_with_points_us']:.0f} us; a copy within "
        f"the cache takes {figures['copy_us']:.1f} us",
        f"Rigged organ, two animations with {figures['export_keys']:.0f} keys of a pull: "
        f"{figures['export_ms']:.0f} ms, {figures['export_bytes'] / 1e6:.2f} MB, "
        f"{figures['bytes_a_key']:,.0f} bytes a key",
    ):
        console.print(line, highlight=False)
    return figures


BENCHMARKS: dict[str, Callable[[Console], dict[str, Any]]] = {
    "physics": measure_physics,
    "trainer": measure_trainer,
    "geometry": measure_geometry,
    "export": measure_export,
    "haptics": measure_haptics,
    "bed": measure_bed,
    "network": measure_network,
    "exercises": measure_exercises,
    "finder": measure_finder,
    "study": measure_study,
    "policies": measure_policies,
    "evidence": measure_evidence,
}


def main() -> None:
    """Measure, print, and write the figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks")
    names = ", ".join((*BENCHMARKS, "cheats", "blind", "faults"))
    parser.add_argument("parts", nargs="*", metavar="PART", help=names)
    parser.add_argument("--seconds", type=float, default=600.0, help="of cheats, each exercise")
    parser.add_argument(
        "--of", choices=EXERCISES, action="append", help="of cheats, an exercise; all if not given"
    )
    parser.add_argument("--figure", type=Path, help="of network: how a step's time grows")
    given = parser.parse_args()
    if given.figure is not None:
        try:
            figure_kind(given.figure)
        except ValueError as error:
            parser.error(str(error))
    measured = BENCHMARKS | {
        "network": partial(measure_network, figure=given.figure),
        "cheats": partial(measure_cheats, seconds=given.seconds, names=given.of or EXERCISES),
        "blind": measure_blind_answers,
        "faults": measure_faults,
    }
    unknown = [name for name in given.parts if name not in measured]
    if unknown:
        parser.error(f"there are {', '.join(measured)}, not {', '.join(unknown)}")
    console = Console()
    figures: dict[str, Any] = {"machine": machine()}
    for name in given.parts or BENCHMARKS:
        figures[name] = measured[name](console)
    FIGURES.parent.mkdir(exist_ok=True)
    FIGURES.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    console.print("\nFigures: build/bench.json", highlight=False)


if __name__ == "__main__":
    main()
