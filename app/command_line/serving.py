"""Options that `trainer` and `class` share, and serving pages until the program is to stop."""

import os
import signal
import sys
import threading
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.command_line.client_bounds import client_bounds
from app.command_line.image_options import chosen
from app.command_line.load import PRESET_HELP, organ_from
from app.command_line.shared_options import options_of

if TYPE_CHECKING:
    import ssl
    from collections.abc import Callable

    from app.simulation import Preset
    from app.trainer.server.log import LogFormat
    from app.trainer.server.trainer import Trainer
    from organ_geometry import Organ

_net = partial(typer.Option, rich_help_panel="Other machines")


@dataclass(frozen=True)
class Serving:
    """What is served, and how."""

    host: str
    organ: "Organ"
    preset: "Preset | None"
    log: "LogFormat"
    log_length: int
    options: dict[str, Any]  # of `Trainer`

    def start(self, **more: Any) -> "Trainer":
        """Start a trainer, with more of its options."""
        from app.trainer.server.log import set_up_log
        from app.trainer.server.trainer import Trainer

        set_up_log(self.log, self.log_length)
        return Trainer(self.organ, self.preset, host=self.host, **self.options, **more)


@options_of(client_bounds)
def serving(
    *,
    host: Annotated[
        str,
        typer.Option(
            help="Address to serve; any but loopback, as 0.0.0.0, lets other machines in, by links "
            "with a token."
        ),
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port to serve; 0 takes a free one.")] = 8080,
    organ: Annotated[
        Path | None, typer.Option(help="An .organ file; the shipped bile duct if not given.")
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            help=f"Material and beam of the duct: {PRESET_HELP}",
            show_default="of the shipped duct the first, of any other organ assumed-duct",
        ),
    ] = None,
    look: Annotated[
        str, typer.Option(help="full, plain, or auto: plain for pages that are slow.")
    ] = "auto",
    certificate: Annotated[Path | None, _net(help="PEM file of the certificate for TLS.")] = None,
    key: Annotated[
        Path | None, _net(help="PEM file of its key.", show_default="in --certificate")
    ] = None,
    public_url: Annotated[str | None, _net(help="Where a reverse proxy serves the pages.")] = None,
    trust_proxy: Annotated[
        str | None, _net(help="The proxy's address; its X-Forwarded-For is believed.")
    ] = None,
    metrics: Annotated[
        bool, typer.Option("--metrics", help="Serve figures for Prometheus at /metrics.")
    ] = False,
    log_format: Annotated[str, typer.Option(help="Log on stderr: text or json.")] = "text",
    **bounds: Any,
) -> Serving:
    """Check the options, and return what they ask for."""
    if not host:
        raise ValueError("--host must be an address")
    if not 0 <= port <= 65535:
        raise ValueError(f"--port must be from 0 to 65535, not {port}")
    if trust_proxy is not None and public_url is None:
        raise ValueError("--trust-proxy needs --public-url, the address that the proxy serves")
    look = chosen("--look", look, ("auto", "full", "plain"))
    log: LogFormat = chosen("--log-format", log_format, ("text", "json"))
    tls = tls_context(certificate, key)
    # Let an interrupt end the program at once, until it serves: within what is compiled on a first
    # start Python could lose one.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    within = client_bounds(**bounds)
    from app.simulation import chosen_preset

    return Serving(
        host,
        organ_from(organ, within.builds.bounds.organ_mm),
        None if preset is None else chosen_preset(preset),
        log,
        within.log_length,
        {
            "port": port,
            "look": look,
            "bounds": within.connections,
            "build_process": within.builds,
            "export_vertices": within.export_vertices,
            "metrics": metrics,
            "tls": tls,
            "public_url": public_url,
            "trusted_proxy": trust_proxy,
        },
    )


def serve(start: "Callable[[], Trainer]", say: "Callable[[Trainer], object]") -> None:
    """Start a trainer, say where it is, and end the process when it is told to stop."""
    from organ_geometry import remove_left_behind

    remove_left_behind()
    # Stdout has the address first, for who reads it by program.
    if sys.stderr.isatty():
        print(
            "Preparing the trainer; on a first start a page waits some minutes for its duct ...",
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
        # A signal that comes just before this thread sleeps, or to another thread, sets no event
        # until Python next runs here: a wait without an end would miss it.
        while not stop.wait(0.5):
            pass
    finally:
        running.stop()
    # The warming may be at work yet, for seconds. Nobody waits for it, and where it is inside some
    # C++ code Python's own end would abort: threads that are left cannot be unwound from there.
    os._exit(0)


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

    from app.trainer.connections.guard import opens_elsewhere

    if not opens_elsewhere(link):
        print("Other devices cannot open this link; --host 0.0.0.0 gives one that they can.")
    elif sys.stdout.isatty() and sys.stdout.encoding.lower().startswith("utf"):
        segno.make(link, micro=False).terminal(compact=True)
