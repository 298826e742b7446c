"""A servo beside a page in Chromium that pulls and dissects, and a bare loop beside the same page.

``python -m benchmarks.haptic_page MINUTES`` takes so many minutes for each of four parts; it needs
Chromium and playwright, and for the servo's scheduling a privilege (docs/haptics.md). In *Pull* and
in *Dissect* a page is led by the trainer's device, a simulated hand behind Haply's protocol. Before
that the same movements lead the page without a device or a force, beside a loop that does nothing:
each figure of the servo and of the page has the machine's own share beside it.
"""

import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal, cast

import msgspec
import numpy as np
from rich.console import Console

from app.command_line.load import shipped_organ
from app.haptics.device import DeviceOptions
from app.haptics.servo_loop import LoopSettings
from app.haptics.servo_process import (
    BedSetting,
    HapticSetting,
    HookSnapshot,
    ServoProcess,
    Snapshot,
)
from app.haptics.servo_report import ServoReport
from app.simulation import HandContact
from app.trainer.server.trainer import Trainer
from benchmarks.browser_page import PICTURES, browser_page
from benchmarks.haptic_servo import virtual_service

Where = Literal["pull", "dissect"]
CYCLE, LIFT, LIFTED = 4.0, 9.0, 6.0
"""Of the movement: its time, s, its height, mm, and about how high the hook comes in a bed."""
ASIDE = (-12.0, 0.0, 12.0)
"""Where along the duct it lifts, one after the other, mm from the middle."""
NEW_DUCT = 3 * CYCLE
HAND = "repeats = true\n[hand]\nstiffness_N_per_m = 700\ndamping_N_s_per_m = 8\ntremor_mm = 0.05\n"
LIMITS = {"step, 99.9 %, us": 60.0, "over 1.5 ms, %": 0.5, "state to force, 99 %, us": 1500.0}


TAKES = (0.05, 0.0, "[]"), (0.15, 0.0, '["a"]'), (0.5, LIFT, '["a"]'), (0.85, 0.0, '["a"]')
LIFTS: dict[Where, tuple[tuple[float, float, str], ...]] = {
    "pull": ((0.05, 0.0, "[]"), (0.5, LIFT, "[]"), (1.0, 0.0, "[]")),
    "dissect": (*TAKES, (0.95, 0.0, "[]")),
}
"""Parts of a cycle, heights, mm, and buttons."""


def hand(where: Where) -> str:
    """Return the TOML of a hand that lifts the duct, in its bed at one place after the other."""
    text, time_s = HAND, 0.0
    for aside in ASIDE:
        for phase, up, button in LIFTS[where]:
            text += (f"[[path]]\ntime_s = {time_s + phase * CYCLE}\n"
                     f"offset_mm = [{aside}, 0, {up}]\nbuttons = {button}\n")  # fmt: skip
        time_s += CYCLE
    return text


class Led:
    """The same movement in place of a servo: without a device, a process or a force."""

    device, hands = "a movement without a device", 1
    ended = not_rendered = report = None

    def __init__(self) -> None:
        self._generation, self._start = 0, time.monotonic()
        self._rest = np.zeros(3)

    def render(self, setting: HapticSetting | None) -> int:
        """Begin at the duct's hook."""
        if isinstance(setting, BedSetting):
            places = setting.beam.rest_places
            self._rest = places[len(places) // 2]
        self._generation += 1
        return self._generation

    def lead(self, touch: HandContact | None, holds: object) -> None:
        """Feel nothing of another hand."""

    def snapshot(self) -> Snapshot:
        """Return where the hook is now."""
        turn = (time.monotonic() - self._start) / CYCLE
        phase, aside = turn % 1.0, ASIDE[int(turn) % len(ASIDE)]
        bedded = bool(self._rest.any())
        high = LIFTED if bedded else LIFT
        up = high * math.sin(math.pi * min(max((phase - 0.15) / 0.7, 0.0), 1.0)) ** 2
        tip = self._rest + np.array([aside if bedded else 0.0, 0.0, up])
        held = bedded and 0.1 < phase < 0.9
        hook = HookSnapshot(tip, np.zeros(3), float(tip[2]), float(tip[0]) if held else None, 0)
        return Snapshot(self._generation, False, (hook,))

    def stop(self) -> None:
        """End nothing."""


def serve(where: Where, address: str | None) -> None:
    """Serve a trainer; print its ticks at each line on stdin, the servo's report at the end."""
    settings = LoopSettings(hold=where == "pull")

    def servo(setting: HapticSetting) -> ServoProcess:
        if address is None:
            return cast(ServoProcess, Led())
        return ServoProcess([("haply", DeviceOptions(address, settings.period))], settings, setting)

    made: list[ServoProcess] = []

    def kept(setting: HapticSetting) -> ServoProcess:
        made.append(servo(setting))
        return made[-1]

    trainer = Trainer(
        shipped_organ(), port=0, scene="free" if where == "pull" else "bed", haptics=kept
    )
    trainer.warm_up.done.wait()
    print(trainer.address, flush=True)
    for _ in sys.stdin:
        drawn = max(trainer.frames.values(), default=0)
        facts = {"ticks": trainer.timer.ticks, "missed": trainer.timer.missed, "drawn": drawn}
        print(msgspec.json.encode(facts).decode(), flush=True)
    trainer.stop()
    print(msgspec.json.encode(made[0].report).decode(), flush=True)


def beside_page(
    where: Where, seconds: float, address: str | None, beside: Callable[[], Any]
) -> dict[str, Any]:
    """Return the figures of a page that a device leads, or the same movement without one."""
    command = [sys.executable, "-W", "ignore::UserWarning", "-m", __spec__.name, "serve", where]
    with (
        subprocess.Popen([*command, *([address] if address else [])], text=True,
                         stdin=subprocess.PIPE, stdout=subprocess.PIPE) as trainer,
        browser_page() as page,
    ):  # fmt: skip
        assert trainer.stdin is not None
        assert trainer.stdout is not None

        def ask() -> tuple[float, dict[str, int]]:
            print(file=trainer.stdin, flush=True)
            return time.monotonic(), msgspec.json.decode(facts.readline())

        facts = trainer.stdout
        try:
            page.goto(f"{facts.readline().strip()}/?fixedDpr=1")
            page.get_by_role("dialog").get_by_role("button", name="Start").click()
            asked = [ask()]
            start, anew = asked[0][0], NEW_DUCT
            page.evaluate(f"() => {{ window.bdPictures = ({PICTURES})({seconds}); }}")
            peer = beside()
            while (now := asked[-1][0] - start) < seconds:
                if now > anew:
                    page.keyboard.press("r")  # a new duct, held by all of its strands
                    anew += NEW_DUCT
                page.wait_for_timeout(1e3)
                asked.append(ask())
            pictures = float(page.evaluate("() => window.bdPictures"))
            trainer.stdin.close()
            report = msgspec.json.decode(facts.readline(), type=ServoReport | None)
        finally:
            trainer.terminate()
    times = np.array([when for when, _ in asked])
    ticks, drawn = np.array([[facts["ticks"], facts["drawn"]] for _, facts in asked]).T
    sent = np.diff(drawn) / np.diff(times)
    figures: dict[str, Any] = {
        "pictures the page drew a second": pictures,
        # Nothing is sent while nothing moves, as when the hand rests between two lifts.
        "pictures sent a second": float(sent.mean()),
        "in the busiest quarter of them": float(np.percentile(sent, 75)),
        "ticks a second": float((ticks[-1] - ticks[0]) / (times[-1] - times[0])),
    }
    if report is None:
        bare = peer()
        return {**figures, "over 1.5 ms, %": bare["missed_percent"],
                "period, 99.9 %, us": bare["period_p99_9_us"],
                "the same call, median, us": bare["step_median_us"],
                "the same call, 99.9 %, us": bare["step_p99_9_us"]}  # fmt: skip
    return {
        "step, median, us": report.step_us.median,
        "step, 99.9 %, us": report.step_us.p99_9,
        "with work ahead, median, us": report.whole_step_us.median,
        "with work ahead, 99.9 %, us": report.whole_step_us.p99_9,
        "over 1.5 ms, %": 100.0 * report.missed_fraction,
        "period, 99.9 %, us": report.period_us.p99_9,
        "state to force, 99 %, us": report.state_to_force_us.p99,
        "energy balance closes to": report.energy_mJ.residual_of_peak,
        "periods": report.periods,
        "scheduled": report.scheduling,
        **figures,
    }


def figures_beside_page(seconds: float) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the figures of each part, which takes so many seconds."""

    def bare() -> Callable[[], Any]:
        process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.haptic_servo", str(seconds)],
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        return lambda: msgspec.json.decode(process.communicate()[0])

    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "hand.toml"
        for where in ("pull", "dissect"):
            script.write_text(hand(where))
            yield f"{where}, bare loop", beside_page(where, seconds, None, bare)
            with virtual_service(script) as address:
                yield f"{where}, servo", beside_page(where, seconds, address, lambda: None)


def main() -> None:
    """Measure, and print the figures with those that are to be reached."""
    console, seconds = Console(), 60.0 * float(sys.argv[1])
    for setup, figures in figures_beside_page(seconds):
        console.print(f"\n{setup}, {seconds:g} s", highlight=False)
        for name, value in figures.items():
            limit = LIMITS.get(name) if "servo" in setup else None
            words = f"{value:.4g}" if isinstance(value, float) else str(value)
            wanted = "" if limit is None else f"   (wanted: {limit:g} or less)"
            console.print(f"  {name:<36} {words}{wanted}", highlight=False)


if __name__ == "__main__":
    if sys.argv[1] == "serve":
        serve(cast(Where, sys.argv[2]), sys.argv[3] if len(sys.argv) > 3 else None)
    else:
        main()
