"""`bluntdissect trainer`: the trainer in a browser tab."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.command_line.image_options import chosen
from app.command_line.load import anatomy_from
from app.command_line.serving import draw_link, serve, serving
from app.command_line.shared_options import options_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from app.haptics.servo_process import HapticSetting, ServoProcess
    from app.simulation import RunFile
    from app.trainer.client.beside import StartCompanion
    from app.trainer.server.trainer import Trainer
    from organ_geometry import Organ


@options_of(serving)
def trainer(
    token_file: Annotated[
        Path | None,
        typer.Option(
            help="File with the token that the link must have.",
            show_default="of BLUNTDISSECT_TOKEN; else made where --host needs one",
        ),
    ] = None,
    scene: Annotated[
        str | None,
        typer.Option(
            help="What the page opens on: calot, Calot's triangle through a laparoscope, bed, a "
            "duct in its bed, or free, one without.",
            show_default="calot; bed with an organ, a preset, a device or a policy",
        ),
    ] = None,
    anatomy: Annotated[
        str | None,
        typer.Option(
            help="An anatomy file, or a shipped anatomy's name, for --scene calot.",
            show_default="normal",
        ),
    ] = None,
    replay: Annotated[
        Path | None,
        typer.Option(help="A run that pages open on, as the trainer's JSON download."),
    ] = None,
    policy: Annotated[
        Path | None,
        typer.Option(help="ONNX file of a policy that may act beside a trainee (docs/rl.md)."),
    ] = None,
    mode: Annotated[
        str | None,
        typer.Option(help="Older: dissect for --scene bed, pull for --scene free.", hidden=True),
    ] = None,
    exercise_inputs: Annotated[
        str,
        typer.Option(help="What counts in exercises: hand, or any for sliders and keys as well."),
    ] = "hand",
    haptics: Annotated[
        str | None,
        typer.Option(help="Haptic device that has the hook: haply, force-dimension or virtual."),
    ] = None,
    haptics_address: Annotated[
        str, typer.Option(help="Where Haply's service is.")
    ] = "ws://127.0.0.1:10001",
    second_haptics: Annotated[
        str | None, typer.Option(help="Device of the other hand; without one the mouse has it.")
    ] = None,
    second_haptics_address: Annotated[
        str | None,
        typer.Option(help="Its service's address.", show_default="as --haptics-address"),
    ] = None,
    haptics_hand: Annotated[
        Path | None, typer.Option(help="TOML file of the virtual device's hand.")
    ] = None,
    **options: Any,
) -> None:
    """Serve the trainer; open the address that it prints in a browser.

    Example: bluntdissect trainer --port 0 --organ duct.organ

    With --host 0.0.0.0 other machines get in too, by the link with a token that it prints.
    """
    if scene is not None:
        chosen("--scene", scene, ("calot", "bed", "free"))
    if mode is not None:
        scene = (
            scene or {"dissect": "bed", "pull": "free"}[chosen("--mode", mode, ("dissect", "pull"))]
        )
    if anatomy is not None and (scene not in {None, "calot"} or replay is not None):
        raise ValueError("--anatomy goes with --scene calot")
    chosen("--exercise-inputs", exercise_inputs, ("hand", "any"))
    token = _given_token(token_file)
    served = serving(**options)
    devices = [(haptics, haptics_address)]
    if second_haptics is not None:
        if haptics is None:
            raise ValueError("--second-haptics is of a second device: give --haptics")
        devices.append((second_haptics, second_haptics_address or haptics_address))
    servo = None if haptics is None else _servo(devices, haptics_hand)
    beside = None if policy is None else _beside(policy)
    own = None if anatomy is None else anatomy_from(anatomy)
    scene = "calot" if own is not None else scene
    run = None if replay is None else _replayed(replay, served.organ)
    if run is not None:
        begins = run.log.start
        of = "calot" if begins.anatomy is not None else "bed" if begins.in_bed else "free"
        if "calot" in {scene, of} and scene not in {None, of}:
            raise ValueError(f"--replay {replay}: this run needs --scene {of}")
        scene = scene or of
    if scene is None and not any((options["organ"], options["preset"], haptics, policy)):
        scene = "calot"

    def start() -> "Trainer":
        return served.start(
            token=token,
            scene=scene,
            anatomy=own,
            replay=run,
            exercise_inputs=exercise_inputs,
            policy=beside,
            haptics=servo,
        )

    def say(running: "Trainer") -> None:
        print(f"The trainer is ready: {running.link}", flush=True)
        if running.link != running.address:
            plain = "" if running.link.startswith("https") else " Nothing is encrypted on its way."
            print(f"Whoever has this link gets in.{plain}", flush=True)
            draw_link(running.link)

    serve(start, say)


def _given_token(file: Path | None) -> str | None:
    """Return the token of a file or the environment: a command line can be seen by all."""
    from app.trainer.connections.guard import TOKEN_VARIABLE

    if file is None:
        return os.environ.get(TOKEN_VARIABLE) or None
    return file.read_text(encoding="utf-8", errors="replace").strip()


def _beside(file: Path) -> "StartCompanion":
    """Return what starts a policy beside a trainee."""
    try:
        from app.rl.companion import Companion
        from app.rl.policy import Policy
    except ImportError as error:
        raise ValueError(f"this needs {error.name}: pip install 'bluntdissect[policy]'") from None
    policy = Policy(file)
    return lambda session, ghost: Companion(policy, session, ghost=ghost)


def _replayed(file: Path, organ: "Organ") -> "RunFile":
    """Return a run, after a look whether it can be replayed on the organ that is served."""
    from app.bounded_file import read_bounded
    from app.simulation import MOST_BYTES, Replay, read_run

    run = read_run(read_bounded(file, MOST_BYTES, "run"))
    try:
        Replay(run.log, organ)
    except ValueError as error:
        raise ValueError(f"--replay {file}: {error}") from None
    return run


def _servo(
    devices: "Sequence[tuple[str | None, str]]", hand: Path | None
) -> "Callable[[HapticSetting], ServoProcess]":
    """Return a function that starts the servo of devices, with their addresses."""
    from app.haptics.device import DeviceOptions
    from app.haptics.hand import read_hand
    from app.haptics.servo_loop import LoopSettings
    from app.haptics.servo_process import ServoProcess

    settings = LoopSettings()
    script = read_hand(hand)
    opened = [
        (name, DeviceOptions(address, settings.period, script))
        for name, address in devices
        if name is not None
    ]
    return lambda setting: ServoProcess(opened, settings, setting)
