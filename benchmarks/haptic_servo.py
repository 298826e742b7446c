"""The servo at 1 kHz, in process and through a websocket, beside a loop that does nothing."""

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from rich.console import Console

from app.haptics.servo import real_time
from app.haptics.servo_report import TimeHistogram
from benchmarks.stopwatch import wait_until
from physics.cubic_kernels import fill_cubic_deflections

SECONDS = 15.0
PERIOD = 1e-3
FORCES = 4000
ENTRY = "import sys; from app.command_line import main; sys.argv[0] = 'bluntdissect'; main()"
HAND = """
repeats = true
[hand]
stiffness_N_per_m = 700
damping_N_s_per_m = 8
tremor_mm = 0.05
[[path]]
time_s = 0.5
offset_mm = [0, 0, 0]
[[path]]
time_s = 2.5
offset_mm = [0, 0, 10]
[[path]]
time_s = 4.5
offset_mm = [0, 0, 0]
"""


def bare_loop(seconds: float) -> dict[str, float]:
    """Return the periods of a loop that waits as the servo does, and the times of one call."""
    # The call is always the same one, of some 10 us: what it takes longer is the machine's share.
    clock, histogram, calls = time.perf_counter, TimeHistogram(), TimeHistogram()
    forces, deflections = np.linspace(0.0, 3.0, FORCES), np.zeros(FORCES)
    fill_cubic_deflections(0.14, 1e-3, forces, deflections)
    start = due = last = clock()
    count = missed = 0
    while last - start < seconds:
        now = wait_until(due)
        histogram.add(now - last)
        missed += now - last > 1.5 * PERIOD
        calling = clock()
        fill_cubic_deflections(0.14, 1e-3, forces, deflections)
        calls.add(clock() - calling)
        count, last, due = count + 1, now, due + PERIOD
        if clock() - due > 5 * PERIOD:
            due = clock()
    times, steps = histogram.percentiles(), calls.percentiles()
    return {"period_p99_us": times.p99, "period_p99_9_us": times.p99_9,
            "missed_percent": 100.0 * missed / count, "step_median_us": steps.median,
            "step_p99_9_us": steps.p99_9}  # fmt: skip


@contextmanager
def virtual_service(hand: Path) -> Iterator[str]:
    """Serve the virtual device in a process of its own; give its address."""
    words = ["haptics", "--serve-virtual", "--address", "ws://127.0.0.1:0", "--hand", str(hand)]
    process = subprocess.Popen([sys.executable, "-c", ENTRY, *words],
                               stdout=subprocess.PIPE, text=True)  # fmt: skip
    try:
        assert process.stdout is not None
        yield process.stdout.readline().split()[-1]
    finally:
        process.terminate()
        process.wait(10.0)


def servo_report(words: list[str], hand: Path) -> dict[str, Any]:
    """Return the report of a servo in a process of its own."""
    options = ["haptics", "--hold", "--json", "--seconds", str(SECONDS), "--hand", str(hand)]
    done = subprocess.run([sys.executable, "-c", ENTRY, *options, *words],
                          capture_output=True, text=True, check=True)  # fmt: skip
    return msgspec.json.decode(done.stdout)


def haptic_figures() -> dict[str, dict[str, float]]:
    """Return the figures of the bare loop and of servos."""
    with tempfile.TemporaryDirectory() as folder:
        hand = Path(folder) / "hand.toml"
        hand.write_text(HAND)
        bare = subprocess.run(
            [sys.executable, "-m", "benchmarks.haptic_servo", str(SECONDS)],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        figures: dict[str, dict[str, float]] = {"bare loop": msgspec.json.decode(bare.stdout)}
        with virtual_service(hand) as address:
            for name, words in (
                ("cubic, in process", ["--device", "virtual"]),
                ("exact, in process", ["--device", "virtual", "--theory", "exact"]),
                ("cubic, websocket", ["--device", "haply", "--address", address]),
                ("exact, websocket", ["--device", "haply", "--address", address,
                                      "--theory", "exact"]),
            ):  # fmt: skip
                made = servo_report(words, hand)
                figures[name] = {
                    "period_p99_us": made["period_us"]["p99"],
                    "period_p99_9_us": made["period_us"]["p99_9"],
                    "missed_percent": 100.0 * made["missed_fraction"],
                    "step_median_us": made["step_us"]["median"],
                    "step_p99_9_us": made["step_us"]["p99_9"],
                    "state_to_force_p99_us": made["state_to_force_us"]["p99"],
                    "books_residual": made["energy_mJ"]["residual_of_peak"],
                    "force_error": made["force_check"]["largest_error"],
                }
    return figures


def measure_haptics(console: Console) -> dict[str, dict[str, float]]:
    """Print and return the figures of the servo."""
    with console.status(f"Running servos for {SECONDS:g} s each ..."):
        figures = haptic_figures()
    console.print(f"\nServo at {1.0 / PERIOD:g} Hz, {SECONDS:g} s each", highlight=False)
    for name, found in figures.items():
        line = (f"{name:<18} period 99 % {found['period_p99_us']:.0f}, 99.9 % "
                f"{found['period_p99_9_us']:.0f} us; over 1.5 ms "
                f"{found['missed_percent']:.3f} %")  # fmt: skip
        if "step_median_us" in found:
            line += (f"; step median {found['step_median_us']:.0f}, 99.9 % "
                     f"{found['step_p99_9_us']:.0f} us")  # fmt: skip
        if "state_to_force_p99_us" in found:
            line += f"; state to force 99 % {found['state_to_force_p99_us']:.0f} us"
        console.print(line, highlight=False, soft_wrap=True)
    return figures


if __name__ == "__main__":
    real_time()
    print(msgspec.json.encode(bare_loop(float(sys.argv[1]))).decode())
