"""`bluntdissect haptics`: force feedback, a simulated device to try it with, runs made again."""

import contextlib
import math
import signal
import sys
import threading
from collections.abc import Callable, Generator
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from app.command_line.answer import AsJson, answer, print_lines
from app.command_line.load import (
    PRESET_NAMES,
    anatomy_from,
    chosen_theory,
    organ_from,
    with_law,
)

ADDRESS = "ws://127.0.0.1:10001"


def haptics(
    serve_virtual: Annotated[
        bool,
        typer.Option("--serve-virtual", help="Serve Haply's protocol for a simulated device."),
    ] = False,
    device: Annotated[
        str | None, typer.Option(help="haply, force-dimension, virtual, or one that is installed.")
    ] = None,
    address: Annotated[str, typer.Option(help="Where Haply's service is, or shall be.")] = ADDRESS,
    hand: Annotated[
        Path | None, typer.Option(help="TOML file of the simulated hand and its device.")
    ] = None,
    preset: Annotated[
        str, typer.Option(help=f"{PRESET_NAMES}.", show_default=True)
    ] = "thesis-bile-duct",
    organ: Annotated[
        Path | None, typer.Option(help="An .organ file, for presets with the organ's own sections.")
    ] = None,
    bed: Annotated[
        str | None, typer.Option(help="The tissue that the duct lies in: normal, loose, firm, ...")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the bed's scatter.")] = 1,
    anatomy: Annotated[
        str | None,
        typer.Option(help="Instead: a shipped anatomy's name or an anatomy file, with --tube."),
    ] = None,
    tube: Annotated[str | None, typer.Option(help="Which tube of the anatomy is felt.")] = None,
    theory: Annotated[
        str | None, typer.Option(help="cubic or exact.", show_default="cubic; exact in a bed")
    ] = None,
    shear: Annotated[bool, typer.Option("--shear", help="exact: sections shear.")] = False,
    law: Annotated[str | None, typer.Option(help="exact, or --bed: linear or neo-hooke.")] = None,
    grasp: Annotated[
        float | None,
        typer.Option(help="Where the hook is, mm from the first clamp.", show_default="the middle"),
    ] = None,
    second: Annotated[
        float | None, typer.Option(help="exact: where a second hook is, mm from the first clamp.")
    ] = None,
    second_at: Annotated[
        float, typer.Option(help="How far a second hook without a device is led, mm.")
    ] = 0.0,
    second_device: Annotated[
        str | None, typer.Option(help="Device of the second hook; without one it stays.")
    ] = None,
    second_address: Annotated[
        str | None, typer.Option(help="Its service's address.", show_default="as --address")
    ] = None,
    hold: Annotated[
        bool,
        typer.Option("--hold", help="The hook has the duct at once; otherwise while button a is."),
    ] = False,
    rate: Annotated[int, typer.Option(help="Periods a second, from 100 to 4000.")] = 1000,
    scale: Annotated[float, typer.Option(help="Way of the hook by way of the device.")] = 1.0,
    coupling: Annotated[
        float | None,
        typer.Option(
            help="Virtual coupling, N/mm.",
            show_default="what the device's friction bears at its delay, at most 5",
        ),
    ] = None,
    delay: Annotated[
        float | None,
        typer.Option(
            help="Delay of the device, ms, from a state to the force that answers it, as measured.",
            show_default="what its driver states",
        ),
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="For how long.")] = None,
    report: Annotated[Path | None, typer.Option(help="JSON file for the report.")] = None,
    record: Annotated[Path | None, typer.Option(help="File for the run, to be made again.")] = None,
    replay: Annotated[Path | None, typer.Option(help="Make a recorded run again.")] = None,
    as_json: AsJson = False,
) -> None:
    """Feel the duct with a haptic device; Enter ends it, and then there is no force.

    Examples: bluntdissect haptics --serve-virtual --hand hand.toml;
    bluntdissect haptics --device haply --hold --seconds 10 --report r.json
    """
    if sum((serve_virtual, device is not None, replay is not None)) != 1:
        raise ValueError("give one of --serve-virtual, --device and --replay")
    if device is None and not (seconds is None and report is None and record is None):
        raise ValueError("--seconds, --report and --record are of a run with --device")
    if serve_virtual:
        _serve(address, hand)
        return
    import msgspec

    from app.haptics.haptic_run import run_haptics
    from organ_geometry import check_target, write_atomic

    for target in (report, record):
        if target is not None:
            check_target(target)
    if replay is not None:
        _replay(replay, organ, as_json=as_json)
        return
    assert device is not None  # noqa: S101
    if not 100 <= rate <= 4000:
        raise ValueError(f"--rate must be from 100 to 4000, not {rate}")
    if not 0.01 <= scale <= 10.0:
        raise ValueError(f"--scale must be from 0.01 to 10, not {scale:g}")
    if delay is not None and not 0.0 <= delay <= 1000.0:
        raise ValueError(f"--delay must be from 0 to 1000 ms, not {delay:g}")
    if seconds is not None and not 0.0 < seconds < math.inf:
        raise ValueError(f"--seconds must be above 0, not {seconds:g}")
    if second is None and (second_device is not None or second_at):
        raise ValueError("--second-device and --second-at are of a second hook: give --second")
    if second is not None and second_device is None and not 0.0 < second_at < math.inf:
        raise ValueError("a second hook is led by --second-device, or --second-at says how far")
    from app.haptics.device import DeviceError, DeviceOptions
    from app.haptics.duct_choice import DuctChoice
    from app.haptics.hand import read_hand
    from app.haptics.servo import real_time
    from app.haptics.servo_loop import LoopSettings
    from app.simulation import Specimen, bed_named, chosen_preset

    if bed is not None and (theory is not None or shear):
        raise ValueError(
            "a duct in a bed is solved by the exact beam in space, with shear: leave out --theory "
            "and --shear"
        )
    own = bed is not None or organ is not None or theory is not None or shear or law is not None
    if anatomy is not None and own:
        raise ValueError(
            "an anatomy has its own tissue and is solved by the exact beam in space: leave out "
            "--bed, --organ, --theory, --shear and --law"
        )
    if anatomy is None and tube is not None:
        raise ValueError("--tube is of an anatomy: give --anatomy")
    specimen = (
        Specimen.of_anatomy(anatomy_from(anatomy))
        if anatomy is not None
        else Specimen.of_sections(
            with_law(chosen_preset(preset), law),
            None if organ is None else organ_from(organ),
            None if bed is None else bed_named(bed),
            bed_seed=seed,
            theory=None
            if bed is not None
            else chosen_theory(theory or "cubic", q=None, shear=shear, law=law),
        )
    )
    choice = DuctChoice.of(specimen, grasp, second, tube)
    settings = LoopSettings(rate, scale, hold)
    script = read_hand(hand)
    opened = [(device, DeviceOptions(address, settings.period, script))]
    if second_device is not None:
        opened.append(
            (second_device, DeviceOptions(second_address or address, settings.period, script))
        )
    with _ending() as why:
        made, run = run_haptics(
            choice, opened, settings, why,
            coupling=coupling, delay=None if delay is None else 1e-3 * delay,
            assist=second_at, seconds=seconds, scheduling=real_time(),
        )  # fmt: skip
    if record is not None:
        write_atomic(record, msgspec.json.encode(run))
    if report is not None:
        write_atomic(report, msgspec.json.format(msgspec.json.encode(made)))
    if as_json:
        print(msgspec.json.encode(made).decode())
    else:
        print_lines(made.lines())
    if made.device_failed:
        raise DeviceError(made.ended_by)


def _serve(address: str, hand: Path | None) -> None:
    from app.haptics.hand import read_hand
    from app.haptics.haply_messages import websocket_address
    from app.haptics.haply_server import HaplyServer
    from app.haptics.servo import real_time

    host, port = websocket_address(address)
    script = read_hand(hand)

    real_time()  # as even as a device's own clock, where that is allowed

    def ready(taken: int) -> None:
        print(f"The virtual device is ready: ws://{host}:{taken}", flush=True)

    try:
        HaplyServer(script, lambda line: print(line, flush=True)).run(host, port, ready)
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise ValueError(f"cannot serve {address}: {why}") from error


def _replay(file: Path, organ: Path | None, *, as_json: bool) -> None:
    """Make a run again and say whether its forces are the same to the bit."""
    import dataclasses

    from msgspec.structs import replace

    from app.anatomy import anatomy_named
    from app.bounded_file import read_bounded
    from app.haptics.device_run import MOST_BYTES, read_device_run
    from app.haptics.duct_choice import DuctChoice, played_again
    from app.simulation import Specimen, bed_named, chosen_preset

    content = read_bounded(file, MOST_BYTES, "device run")
    run = read_device_run(content)
    tissue = None if run.organ_sha256 is None else organ_from(organ)
    if run.anatomy is not None:
        specimen = dataclasses.replace(
            Specimen.of_anatomy(anatomy_named(run.anatomy)), clear_strands=run.clear_strands
        )
    else:
        preset = with_law(chosen_preset(run.preset), run.theory.law, run.theory.stiffening)
        specimen = Specimen.of_sections(
            replace(preset, tear_mm_per_s=run.tear_mm_per_s),
            tissue,
            None if run.bed is None else bed_named(run.bed),
            bed_seed=run.bed_seed,
            theory=run.theory.theory() if run.bed is None else None,
        )
    first, *second = run.grasps_mm
    choice = DuctChoice.of(specimen, first, second[0] if second else None, run.tube)
    loop, again, closes_to = played_again(run, choice)
    same = again.forces_sha256 == run.forces_sha256
    facts = {
        "periods": run.periods,
        "seconds": run.periods / run.rate,
        "torn": loop.model.torn,
        "work_of_hands_mJ": float(loop.regulator.energies[0]),
        "work_closes_to": closes_to,
        "as_recorded": same,
        "bytes": len(content),
    }
    answer(facts, facts.items(), as_json=as_json)


@contextlib.contextmanager
def _ending() -> Generator[Callable[[], str | None]]:
    """Return a function that gives the reason to end: a signal, or a key on the terminal."""
    ended: list[str] = []

    def end(number: int, _frame: FrameType | None) -> None:
        ended.append(f"signal {signal.Signals(number).name}")

    def listen() -> None:
        with contextlib.suppress(OSError, ValueError):
            if sys.stdin.readline():
                ended.append("a key")

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    if sys.stdin is not None and sys.stdin.isatty():
        print("Enter ends it; then there is no force.", file=sys.stderr)
        threading.Thread(target=listen, daemon=True).start()
    try:
        yield lambda: ended[0] if ended else None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
