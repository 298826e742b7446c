"""All private names of viser that the trainer needs, each behind a function of its own."""

import asyncio
import contextlib
import io
import warnings
from collections.abc import Iterable
from typing import Any

import viser
from viser import _messages  # pyright: ignore[reportPrivateUsage]
from viser._icons import svg_from_icon  # pyright: ignore[reportPrivateUsage]

__all__ = [
    "close_idle_connections",
    "page_number",
    "queue_script",
    "read_icons",
    "start_server",
    "stop_server",
]


def start_server(host: str, port: int) -> viser.ViserServer:
    """Start viser's server without its printed address, and without its public tunnels."""
    # No warning for a tab that closes while it is drawn: its session ends in a moment.
    warnings.filterwarnings("ignore", r"Queued a \w+ on a closed connection", UserWarning)
    # viser prints its own address whatever `verbose` says.
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=host, port=port, verbose=False)
    # Any client could ask for a tunnel that makes this server public.
    for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(message)  # pyright: ignore[reportPrivateUsage, reportUnknownMemberType]
    return server


def stop_server(server: viser.ViserServer) -> None:
    """Stop viser's server without what it prints."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


def close_idle_connections(server: viser.ViserServer, suspects: set[int]) -> set[int]:
    """Close connections that were silent at the last call and still are; return new suspects."""
    # viser counts a client from its first message on, which a page sends at once. Until then it has
    # no session, but a socket and three tasks of the server, and viser lists it nowhere.
    websockets = server._websock_server  # pyright: ignore[reportPrivateUsage]
    loop = server.get_event_loop()
    connections = dict(websockets._live_connections)  # pyright: ignore[reportPrivateUsage]
    silent = connections.keys() - server.get_clients().keys()
    for number in silent & suspects:
        asyncio.run_coroutine_threadsafe(connections[number].close(), loop)
    return silent - suspects


def read_icons(icons: Iterable[viser.IconName]) -> None:
    """Read icons ahead of use: viser reads a list of six thousand for each new one."""
    for icon in icons:
        svg_from_icon(icon)


def page_number(handle: viser.CommandHandle | viser.GuiSliderHandle[Any]) -> str:
    """Return the identifier of a command or a widget in the page."""
    return handle._impl.uuid  # pyright: ignore[reportPrivateUsage, reportUnknownMemberType]


def queue_script(channel: viser.SceneApi | viser.GuiApi, source: str) -> None:
    """Send a script, which each page of the channel runs in turn with its other messages."""
    channel._websock_interface.queue_message(  # pyright: ignore[reportPrivateUsage]
        _messages.RunJavascriptMessage(source=source)
    )
