"""`bluntdissect haptics`, and what its page in the docs says."""

import json
import re
import signal
import subprocess
import threading
from pathlib import Path
from typing import Any

import haply_pages as pages
import msgspec
import numpy as np
import pytest
from program import LONGEST, command, refused, run, run_process
from websockets.sync.server import ServerConnection, serve

from app.anatomy import anatomy_named
from app.haptics.device import DeviceLimits, DeviceOptions
from app.haptics.device_run import Recorder
from app.haptics.duct_choice import DuctChoice, passive_coupling
from app.haptics.hand import read_hand
from app.haptics.servo import Servo
from app.haptics.servo_loop import FRESH, LIVE, LoopSettings, ServoLoop
from app.haptics.servo_process import DuctSetting
from app.simulation import Specimen, preset_named
from physics import Cubic

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "haptics.md").read_text()


def block(kind: str, holding: str) -> str:
    found = re.findall(rf"^```{kind}\n(.*?)^```", PAGE, flags=re.MULTILINE | re.DOTALL)
    return next(each for each in found if holding in each)


def test_a_virtual_run_reports_records_and_is_made_again(tmp_path: Path) -> None:
    hand = tmp_path / "hand.toml"
    hand.write_text(block("toml", "[hand]"))
    assert read_hand(hand).repeats
    report, record = tmp_path / "r.json", tmp_path / "run.json"
    message = run_process(
        *("haptics", "--device", "virtual", "--hand", hand, "--hold", "--seconds", 3),
        *("--report", report, "--record", record),
    ).stdout
    made: dict[str, Any] = json.loads(report.read_text())
    assert "ended by           its time is over" in message
    assert made["force_check"]["largest_error"] < 1e-6
    assert made["energy_mJ"]["residual_of_peak"] < 1e-6
    assert made["stale_periods"] == 0
    again = json.loads(run_process("haptics", "--replay", str(record), "--json").stdout)
    assert again["as_recorded"] is True
    assert 0.0 < again["work_closes_to"] < 1e-6
    assert again["periods"] == made["periods"]
    assert again["bytes"] == record.stat().st_size


def test_a_tube_of_an_anatomy_is_felt_until_one_tears(tmp_path: Path) -> None:
    """A loop without a clock, and the same run again from its file: to the bit."""
    anatomy = anatomy_named("normal")
    choice = DuctChoice.of(Specimen.of_anatomy(anatomy), 12.0, None, "artery")
    settings, limits = LoopSettings(), DeviceLimits(8.0, 200.0, 0.0)
    loop, recorder = ServoLoop(choice.haptic_model(1.0), settings, limits), Recorder(1)
    largest = 0.0
    for period in range(1200):
        places, bits = np.array([[0, 0, 80 * period]]), [FRESH | LIVE]
        loop.step(places, bits)
        recorder.keep(places, bits, loop.given)
        largest = max(largest, float(loop.model.forces[0, 2]))
    assert loop.model.torn
    assert 0.2 < largest < 2.0
    run = choice.run(recorder, settings, limits, coupling=1.0, assist=0.0)
    assert run.anatomy == "normal"
    record = tmp_path / "run.json"
    record.write_bytes(msgspec.json.encode(run))
    again = json.loads(run_process("haptics", "--replay", str(record), "--json").stdout)
    assert again["as_recorded"] is True
    assert again["torn"] is True
    assert again["work_closes_to"] < 1e-4


def test_the_driver_of_haply_feels_the_virtual_device_until_a_signal() -> None:
    served = command("haptics", "--serve-virtual", "--address", "ws://127.0.0.1:0")
    with subprocess.Popen(served, stdout=subprocess.PIPE, text=True) as serving:
        try:
            assert serving.stdout is not None
            address = serving.stdout.readline().split()[-1]
            render = command(
                "haptics", "--device", "haply", "--address", address, "--hold", "--json"
            )
            with subprocess.Popen(
                render, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True
            ) as feeling:
                assert serving.stdout.readline() == "client 1 has come\n"
                feeling.send_signal(signal.SIGTERM)  # whether it compiles or feels
                made = json.loads(feeling.communicate(timeout=LONGEST)[0])
            assert made["ended_by"] == "signal SIGTERM"
            assert made["device"] == "Haply inverse3 049D, messages of 3.5"
            assert serving.stdout.readline() == "client 1 has gone\n"
        finally:
            serving.terminate()


def test_a_service_that_goes_away_is_an_error_with_a_report(tmp_path: Path) -> None:
    def attend(connection: ServerConnection) -> None:
        connection.send(pages.INVENTORY_35)
        connection.recv()

    report = tmp_path / "r.json"
    with serve(attend, "127.0.0.1", 0) as service:
        threading.Thread(target=service.serve_forever, daemon=True).start()
        address = f"ws://127.0.0.1:{service.socket.getsockname()[1]}"
        words = ["--device", "haply", "--address", address, "--hold", "--report", str(report)]
        done = run("haptics", *words)
    assert done.returncode == 2
    assert done.stderr.endswith("has gone: it closed the connection, 1000 (ok)\n")
    made: dict[str, Any] = json.loads(report.read_text())
    assert made["device_failed"]
    assert "has gone" in made["ended_by"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "one of --serve-virtual, --device and --replay"),
        (["--device", "spoon"], "there are: "),
        (["--device", "virtual", "--theory", "fem"], "cannot be felt"),
        (["--device", "virtual", "--anatomy", "normal"], "which tube is felt? none is named: "),
        (["--device", "virtual", "--anatomy", "normal", "--tube", "a"], "there is no 'a': common"),
        (["--device", "virtual", "--tube", "artery"], "give --anatomy"),
        (
            ["--device", "virtual", "--anatomy", "normal", "--tube", "cystic", "--grasp", "50"],
            "a hook at 50 mm is not on cystic, of 0 to 23 mm",
        ),
        (
            ["--device", "virtual", "--anatomy", "normal", "--tube", "cystic", "--bed", "firm"],
            "an anatomy has its own tissue",
        ),
        (["--device", "virtual", "--second-at", "3"], "give --second"),
        (["--device", "virtual", "--second", "9", "--second-at", "nan"], "says how far"),
        (["--device", "haply", "--address", "http://a"], "ws://127.0.0.1:10001"),
        (["--serve-virtual", "--seconds", "3"], "of a run with --device"),
        (["--replay", "none.json"], "cannot read none.json"),
        (["--device", "virtual", "--report", "no/folder/r.json"], "no folder"),
    ],
)
def test_what_is_wrong_is_said(words: list[str], says: str) -> None:
    assert says in refused(["haptics", *words])


def test_a_device_without_friction_needs_a_coupling(tmp_path: Path) -> None:
    hand = tmp_path / "hand.toml"
    hand.write_text("[device]\ndamping_N_s_per_m = 0.0\n")
    assert "give it damping" in refused(["haptics", "--device", "virtual", "--hand", str(hand)])


def test_a_driver_is_written_in_forty_lines() -> None:
    source = block("python", "class SpringBox")
    assert len(source.splitlines()) <= 40
    names: dict[str, Any] = {}
    exec(source, names)
    device = names["open_box"](DeviceOptions("", 0.001))
    setting = DuctSetting(Cubic(), preset_named("thesis-bile-duct").round_beam(), 25.4, 0.2115)
    model = setting.model(passive_coupling(device.limits, LoopSettings()), 0.001, 1)
    loop = ServoLoop(model, LoopSettings(), device.limits)
    periods = iter(range(2000))
    report = Servo([device], loop).run(
        None, lambda: None if next(periods, None) is not None else "enough"
    )
    assert report.ended_by == "enough"
    assert loop.model.forces[0, 2] == pytest.approx(2.0, rel=0.05)  # it pulls with 2 N
    # A fault of the driver ends the run, and is named with its place.
    device.left, device.place = 10, None
    report = Servo([device], loop).run(None, lambda: None)
    assert re.match(
        r"the driver of spring box failed: TypeError: .+ \(<string>, line \d+\)", report.ended_by
    )


def test_the_published_commands_have_our_options() -> None:
    message = run_process("haptics", "--help").stdout
    commands = block("sh", "--serve-virtual")
    for option in set(re.findall(r"--[a-z-]+", commands)) - {"--haptics"}:
        assert option in message
