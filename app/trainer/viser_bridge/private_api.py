"""All private names of viser that the trainer needs, each behind a function of its own."""

import asyncio
import contextlib
import io
import logging
import threading
import warnings
from collections.abc import Callable, Generator, Iterable
from typing import Any

import viser
import websockets.asyncio.server
from viser import _messages  # pyright: ignore[reportPrivateUsage]
from viser._icons import svg_from_icon  # pyright: ignore[reportPrivateUsage]
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

__all__ = [
    "close_idle_connections",
    "page_number",
    "queue_script",
    "read_icons",
    "start_server",
    "stop_server",
]


def start_server(
    host: str, port: int, guard: Callable[[ServerConnection, Request], Response | None]
) -> viser.ViserServer:
    """Start viser's server without its printed address and its public tunnels.

    Parameters
    ----------
    host, port
        What to serve; port 0 takes a free one.
    guard
        Asked about each request before viser sees it; answers those that it refuses.

    Returns
    -------
    viser.ViserServer
        The running server.

    Raises
    ------
    RuntimeError
        If this viser opens its socket where no guard can stand.
    """
    # No warning for a tab that closes while it is drawn: its session ends in a moment.
    warnings.filterwarnings("ignore", r"Queued a \w+ on a closed connection", UserWarning)
    # At DEBUG each request would be logged, with the token in it.
    log = logging.getLogger("websockets.server")
    log.setLevel(max(logging.INFO, log.getEffectiveLevel()))
    # viser prints its own address whatever `verbose` says.
    with contextlib.redirect_stdout(io.StringIO()), _guarded(guard) as opened:
        server = viser.ViserServer(host=host, port=port, verbose=False)
    if not opened.is_set():
        stop_server(server)
        raise RuntimeError(
            f"viser {viser.__version__} opens its socket where no guard can stand; "
            "install the viser that this trainer names"
        )
    for message in (
        # Any client could ask for a tunnel that makes this server public.
        _messages.ShareUrlRequest,
        _messages.ShareUrlDisconnect,
        # What any client sends with these is kept for ever and sent to all others.
        _messages.GuiFormDirtyMessage,
        _messages.GuiFormSubmitMessage,
    ):
        server._websock_server.unregister_handler(message)  # pyright: ignore[reportPrivateUsage, reportUnknownMemberType]
    return server


_opening = threading.Lock()


@contextlib.contextmanager
def _guarded(
    guard: Callable[[ServerConnection, Request], Response | None],
) -> Generator[threading.Event]:
    """Put a guard in the socket that viser opens meanwhile, and give an event that says it is in.

    viser fixes all options of websockets' `serve`, but looks that name up when it starts.
    """
    opened = threading.Event()

    def guarded_serve(
        *arguments: Any,
        process_request: Callable[[ServerConnection, Request], Response | None] | None = None,
        **options: Any,
    ) -> websockets.asyncio.server.serve:
        def answer(connection: ServerConnection, request: Request) -> Response | None:
            refusal = guard(connection, request)
            if refusal is not None or process_request is None:
                return refusal
            return process_request(connection, request)

        opened.set()
        return serve(*arguments, process_request=answer, **options)

    with _opening:
        serve = websockets.asyncio.server.serve
        websockets.asyncio.server.serve = guarded_serve
        try:
            yield opened
        finally:
            websockets.asyncio.server.serve = serve


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
