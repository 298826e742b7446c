"""`bluntdissect trainer`: the trainer in a browser tab."""

import os
import signal
import sys
import threading
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.command_line.client_bounds import client_bounds, options_of
from app.command_line.image_options import chosen
from app.command_line.load import PRESET_HELP, organ_from

if TYPE_CHECKING:
    import ssl
    from collections.abc import Callable, Sequence

    from app.haptics.servo_process import FeltSetting, ServoProcess
    from app.trainer.server.log import LogFormat
    from app.trainer.server.trainer import Trainer

__all__ = [
    "NET",
    "Certificate",
    "Key",
    "LogFormatName",
    "Look",
    "Metrics",
    "OrganFile",
    "Port",
    "TrustProxy",
    "draw_link",
    "ready_for_signals",
    "serve",
    "tls_context",
    "trainer",
]

NET = "Other machines"

# Options that a class has, too.
Port = Annotated[int, typer.Option(help="Port to serve; 0 takes a free one.")]
OrganFile = Annotated[
    Path | None, typer.Option(help="An .organ file; the shipped bile duct if not given.")
]
Look = Annotated[str, typer.Option(help="full, plain, or auto: plain for pages that are slow.")]
Certificate = Annotated[
    Path | None, typer.Option(help="PEM file of the certificate for TLS.", rich_help_panel=NET)
]
Key = Annotated[
    Path | None,
    typer.Option(help="PEM file of its key.", show_default="in --certificate", rich_help_panel=NET),
]
TrustProxy = Annotated[
    str | None,
    typer.Option(help="The proxy's address; its X-Forwarded-For is believed.", rich_help_panel=NET),
]
Metrics = Annotated[
    bool, typer.Option("--metrics", help="Serve figures for Prometheus at /metrics.")
]
LogFormatName = Annotated[str, typer.Option(help="Log on stderr: text or json.")]


@options_of(client_bounds)
def trainer(
    host: Annotated[
        str,
        typer.Option(help="Address to serve; any but loopback asks for a token."),
    ] = "127.0.0.1",
    port: Port = 8080,
    token_file: Annotated[
        Path | None,
        typer.Option(
            help="File with the token that the link must have.",
            show_default="of BLUNTDISSECT_TOKEN; else made where --host needs one",
        ),
    ] = None,
    certificate: Certificate = None,
    key: Key = None,
    public_url: Annotated[
        str | None,
        typer.Option(help="Where a reverse proxy serves the trainer.", rich_help_panel=NET),
    ] = None,
    trust_proxy: TrustProxy = None,
    organ: OrganFile = None,
    preset: Annotated[
        str | None,
        typer.Option(
            help=f"Material and beam to open on: {PRESET_HELP}",
            show_default="of the shipped duct the first, of any other organ assumed-duct",
        ),
    ] = None,
    mode: Annotated[
        str | None,
        typer.Option(
            help="What the page opens on: dissect, a duct in its bed, or pull, one without.",
        ),
    ] = None,
    look: Look = "auto",
    metrics: Metrics = False,
    log_format: LogFormatName = "text",
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
    **bounds: Any,
) -> None:
    """Serve the trainer; open the address that it prints in a browser.

    Example: bluntdissect trainer --port 0 --organ duct.organ

    With --host 0.0.0.0 other machines get in too, by the link with a token that it prints.
    """
    if mode not in (None, "dissect", "pull"):
        raise ValueError(f"--mode must be dissect or pull, not {mode}")
    if look not in ("auto", "full", "plain"):
        raise ValueError(f"--look must be auto, full or plain, not {look}")
    if exercise_inputs not in ("hand", "any"):
        raise ValueError(f"--exercise-inputs must be hand or any, not {exercise_inputs}")
    if not 0 <= port <= 65535:
        raise ValueError(f"--port must be from 0 to 65535, not {port}")
    if trust_proxy is not None and public_url is None:
        raise ValueError("--trust-proxy needs --public-url, the address that the proxy serves")
    log: LogFormat = chosen("--log-format", log_format, ("text", "json"))
    token, tls = _given_token(token_file), tls_context(certificate, key)
    ready_for_signals()
    within = client_bounds(**bounds)
    from app.simulation import chosen_preset

    tissue = organ_from(organ, within.builds.bounds.organ_mm)
    material = None if preset is None else chosen_preset(preset)
    devices = [(haptics, haptics_address)]
    if second_haptics is not None:
        if haptics is None:
            raise ValueError("--second-haptics is of a second device: give --haptics")
        devices.append((second_haptics, second_haptics_address or haptics_address))
    servo = None if haptics is None else _servo(devices, haptics_hand)

    def start() -> "Trainer":
        from app.trainer.server.log import set_up_log
        from app.trainer.server.trainer import Trainer

        set_up_log(log, within.log_length)
        return Trainer(
            tissue, material, host=host, token=token, port=port, mode=mode, look=look,
            bounds=within.connections, build_process=within.builds,
            export_vertices=within.export_vertices, metrics=metrics, tls=tls,
            public_url=public_url, trusted_proxy=trust_proxy, exercise_inputs=exercise_inputs,
            haptics=servo,
        )  # fmt: skip

    def say(running: "Trainer") -> None:
        print(f"The trainer is ready: {running.link}", flush=True)
        if running.link != running.address:
            plain = "" if running.link.startswith("https") else " Nothing is encrypted on its way."
            print(f"Who has this link gets in.{plain}", flush=True)
            draw_link(running.link)

    serve(start, say)


def ready_for_signals() -> None:
    """Let an interrupt end the program at once, until it serves."""
    # Within what is compiled on a first start Python could lose an interrupt.
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def serve(start: "Callable[[], Trainer]", say: "Callable[[Trainer], object]") -> None:
    """Start a trainer, say where it is, and end the process when it is told to stop."""
    from organ_geometry import remove_left_behind

    remove_left_behind()
    # Stdout has the address first, for who reads it by program.
    if sys.stderr.isatty():
        print(
            "Preparing the trainer; after a first start a page waits a minute for its duct ...",
            file=sys.stderr,
        )
    running = start()
    # From here on both signals end the wait below, so that server and clock stop in order.
    stop = threading.Event()

    def end(_signal: int, _frame: FrameType | None) -> None:
        stop.set()

    signal.signal(signal.SIGINT, end)
    signal.signal(signal.SIGTERM, end)
    try:
        say(running)
        print("Not clinically validated, not a medical device. Ctrl+C ends it.", flush=True)
        stop.wait()
    finally:
        running.stop()
    # The warming may be at work yet, for seconds. Nobody waits for it, and where it is inside some
    # C++ code Python's own end would abort: threads that are left cannot be unwound from there.
    os._exit(0)


def _given_token(file: Path | None) -> str | None:
    """Return the token of a file or the environment: a command line can be seen by all."""
    from app.trainer.connections.guard import TOKEN_VARIABLE

    if file is None:
        return os.environ.get(TOKEN_VARIABLE) or None
    return file.read_text(encoding="utf-8", errors="replace").strip()


def tls_context(certificate: Path | None, key: Path | None) -> "ssl.SSLContext | None":
    """Return how TLS is spoken with a certificate, if there is one."""
    if certificate is None:
        if key is not None:
            raise ValueError("--key needs --certificate, whose key it is")
        return None
    import ssl

    for file in (certificate, key):
        if file is not None:
            file.read_bytes()  # what ssl raises names no file
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        # Without the empty password OpenSSL would ask for one on the terminal.
        context.load_cert_chain(certificate, key, password="")
    except ssl.SSLError as error:
        named = certificate if key is None else f"{certificate} and {key}"
        raise ValueError(
            f"{named} must be a certificate with its own key, both PEM and without a password: "
            f"{(error.reason or str(error)).lower().replace('_', ' ')}"
        ) from error
    return context


def draw_link(link: str) -> None:
    """Draw a link as a QR code for phones and tablets, in a terminal that has its characters."""
    import segno

    if sys.stdout.isatty() and sys.stdout.encoding.lower().startswith("utf"):
        segno.make(link, micro=False).terminal(compact=True)


def _servo(
    devices: "Sequence[tuple[str | None, str]]", hand: Path | None
) -> "Callable[[FeltSetting], ServoProcess]":
    """Return a function that starts the servo of devices, with their addresses."""
    from app.haptics.device import DeviceOptions
    from app.haptics.hand import HandScript, read_hand
    from app.haptics.servo_loop import LoopSettings
    from app.haptics.servo_process import ServoProcess

    settings = LoopSettings()
    script = HandScript() if hand is None else read_hand(hand)
    opened = [
        (name, DeviceOptions(address, settings.period, script))
        for name, address in devices
        if name is not None
    ]
    return lambda setting: ServoProcess(opened, settings, setting)
