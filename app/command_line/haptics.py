"""`bluntdissect haptics`: force feedback, and a simulated device to try it with."""

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["haptics"]

ADDRESS = "ws://127.0.0.1:10001"


def haptics(
    serve_virtual: Annotated[
        bool, typer.Option("--serve-virtual", help="Serve Haply's protocol for a simulated device.")
    ] = False,
    address: Annotated[str, typer.Option(help="Where the service is, or shall be.")] = ADDRESS,
    hand: Annotated[
        Path | None, typer.Option(help="TOML file of the simulated hand and device.")
    ] = None,
) -> None:
    """Feel the duct with a haptic device.

    With --serve-virtual: a simulated device in a scripted hand, for any client of Haply's.
    """
    from app.haptics.hand import HandScript, read_hand
    from app.haptics.haply_server import HaplyServer, websocket_address

    host, port = websocket_address(address)
    script = HandScript() if hand is None else read_hand(hand)
    if not serve_virtual:
        raise ValueError("give --serve-virtual")

    def ready(taken: int) -> None:
        print(f"The virtual device is ready: ws://{host}:{taken}", flush=True)

    try:
        HaplyServer(script, lambda line: print(line, flush=True)).run(host, port, ready)
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise ValueError(f"cannot serve {address}: {why}") from error
