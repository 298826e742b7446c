"""All private names of viser that the trainer needs, each behind a function of its own."""

import asyncio
import contextlib
import functools
import gzip
import io
import logging
import threading
from collections.abc import Awaitable, Callable, Generator, Iterable, Mapping
from typing import Any

import viser
import websockets.asyncio.server
from viser import _messages  # pyright: ignore[reportPrivateUsage]
from viser._icons import svg_from_icon  # pyright: ignore[reportPrivateUsage]
from viser.infra._async_message_buffer import (  # pyright: ignore[reportPrivateUsage]
    AsyncMessageBuffer,
)
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import WebSocketException
from websockets.frames import CloseCode
from websockets.http11 import Request, Response

PAGE_MESSAGES = (
    _messages.ViewerCameraMessage,
    _messages.GuiUpdateMessage,
    _messages.GuiButtonHoldMessage,
    _messages.CommandTriggerMessage,
    _messages.SceneNodeClickMessage,
    _messages.SceneNodeDragMessage,
    _messages.ScenePointerMessage,
    _messages.TransformControlsUpdateMessage,
    _messages.TransformControlsDragStartMessage,
    _messages.TransformControlsDragEndMessage,
    _messages.FileTransferStartUpload,
    _messages.FileTransferPart,
    _messages.FileTransferPartAck,
    _messages.LocalStorageGetItemResponseMessage,
)
"""viser's declarations of what a page of this trainer may send; its other kinds are refused."""

# viser warns once of what is sent to a page that has left; here each is taken to have warned. A tab
# may close while it is drawn, and its session ends in a moment. A filter would not last: whatever
# puts the process's filters back, as numba does while it compiles, takes it away.
AsyncMessageBuffer.__init__ = functools.partialmethod(  # pyright: ignore[reportAttributeAccessIssue]
    AsyncMessageBuffer.__init__, _warned_push_after_done=True
)

COVER = """
@keyframes bd-show { to { visibility: visible } }
html:not(.bd-ready) { background: #17181b }
html:not(.bd-ready) body > * { visibility: hidden; animation: bd-show 0s 15s forwards }
html:not(.bd-ready) body::before { content: "Opening the trainer …"; position: fixed; inset: 0;
  display: grid; place-items: center; background: #17181b; color: #c9ccd1;
  font: 16px system-ui, sans-serif }
"""
"""Style of a page whose script has not come yet, which covers it then; without one viser's page is
shown after 15 s."""
Answer = Response | Awaitable[Response | None] | None
Guard = Callable[[ServerConnection, Request], Answer]
Handler = Callable[[ServerConnection], Awaitable[None]]


def start_server(
    host: str,
    port: int,
    guard: Guard,
    options: Mapping[str, Any] | None = None,
    apart: Callable[[ServerConnection], Awaitable[None] | None] = lambda _: None,
) -> viser.ViserServer:
    """Start viser's server without its printed address and its public tunnels.

    Parameters
    ----------
    host, port, options
        What to serve, port 0 takes a free one; options of websockets' `serve` in place of viser's.
    guard
        Asked about each request before viser sees it; answers those that it refuses.
    apart
        Serves a websocket that is not of viser's page; None leaves it to viser.

    Returns
    -------
    viser.ViserServer
        The running server.

    Raises
    ------
    RuntimeError
        If this viser opens its socket where no guard can stand.
    """
    # At DEBUG each request would be logged, with the token in it.
    log = logging.getLogger("websockets.server")
    log.setLevel(max(logging.INFO, log.getEffectiveLevel()))
    log.addFilter(_is_of_this_side)
    # viser prints its own address whatever `verbose` says.
    with contextlib.redirect_stdout(io.StringIO()), _guarded(guard, options or {}, apart) as opened:
        server = viser.ViserServer(host=host, port=port, verbose=False)
    if not opened.is_set():
        stop_server(server)
        raise RuntimeError(
            f"viser {viser.__version__} opens its socket where no guard can stand; "
            "install the viser that this trainer names"
        )
    # Else each page unpacks viser's own environment map: seconds of drawing in software.
    server.scene.configure_environment_map(None)
    server.scene.configure_default_lights(False)
    loop = server.get_event_loop()
    loop.call_soon_threadsafe(loop.set_exception_handler, _handle_fault)
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


def _is_of_this_side(record: logging.LogRecord) -> bool:
    """Return whether a record is not of a request that is none, or that ended too soon."""
    if record.getMessage() != "opening handshake failed" or record.exc_info is None:
        return True
    return not isinstance(record.exc_info[1], (WebSocketException, EOFError, OSError))


def _handle_fault(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Log a fault of the server's loop, but not a value that a widget cannot be made of."""
    error = context.get("exception")
    trace = None if error is None else error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    update = viser.GuiApi._handle_gui_updates  # pyright: ignore[reportPrivateUsage]
    if trace is None or trace.tb_frame.f_code is not update.__code__:
        loop.default_exception_handler(context)


_opening = threading.Lock()


@contextlib.contextmanager
def _guarded(
    guard: Guard,
    chosen: Mapping[str, Any],
    apart: Callable[[ServerConnection], Awaitable[None] | None],
) -> Generator[threading.Event]:
    """Put a guard in the socket that viser opens meanwhile, and give an event that says it is in.

    viser fixes all options of websockets' `serve`, but looks that name up when it starts.
    """
    opened = threading.Event()

    def guarded_serve(
        handler: Handler,
        *arguments: Any,
        process_request: Guard | None = None,
        **options: Any,
    ) -> websockets.asyncio.server.serve:
        def answer(connection: ServerConnection, request: Request) -> Answer:
            refusal = guard(connection, request)
            if refusal is not None or process_request is None:
                return refusal
            return _covered(process_request(connection, request))

        async def handle(connection: ServerConnection) -> None:
            await (apart(connection) or handler(connection))

        opened.set()
        return serve(handle, *arguments, process_request=answer, **(options | dict(chosen)))

    with _opening:
        serve = websockets.asyncio.server.serve
        websockets.asyncio.server.serve = guarded_serve
        try:
            yield opened
        finally:
            websockets.asyncio.server.serve = serve


async def _covered(answer: Answer) -> Response | None:
    """Return viser's answer; its page is covered until the trainer's is there."""
    response = await answer if isinstance(answer, Awaitable) else answer
    if response is None or not response.headers.get("Content-Type", "").startswith("text/html"):
        return response
    packed = response.headers.get("Content-Encoding") == "gzip"
    response.body = _with_cover(bytes(response.body), packed=packed)
    del response.headers["Content-Length"]
    response.headers["Content-Length"] = str(len(response.body))
    return response


@functools.lru_cache(maxsize=2)
def _with_cover(body: bytes, *, packed: bool) -> bytes:
    """Return viser's page, which is the same at each call, with the cover."""
    page = gzip.decompress(body) if packed else body
    page = page.replace(b"</head>", f"<style>{COVER}</style></head>".encode(), 1)
    return gzip.compress(page) if packed else page


def stop_server(server: viser.ViserServer) -> None:
    """Stop viser's server without what it prints."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


def connection_of(server: viser.ViserServer, number: int) -> ServerConnection | None:
    """Return the connection of a page, by its client's number."""
    return server._websock_server._live_connections.get(number)  # pyright: ignore[reportPrivateUsage]


def page_of(server: viser.ViserServer, connection: ServerConnection) -> viser.ClientHandle | None:
    """Return the page that a connection is of, if it has spoken."""
    live = dict(server._websock_server._live_connections)  # pyright: ignore[reportPrivateUsage]
    numbers = (number for number, each in live.items() if each is connection)
    return server.get_clients().get(next(numbers, -1))


def close_page(server: viser.ViserServer, number: int, reason: str) -> None:
    """Close a page's connection and say why."""
    connection = connection_of(server, number)
    if connection is not None:
        closing = connection.close(CloseCode.POLICY_VIOLATION, reason)
        asyncio.run_coroutine_threadsafe(closing, server.get_event_loop())


def read_icons(icons: Iterable[viser.IconName]) -> None:
    """Read icons ahead of use: viser reads a list of six thousand for each new one."""
    for icon in icons:
        svg_from_icon(icon)


def page_number(
    handle: viser.CommandHandle | viser.GuiSliderHandle[Any] | viser.GuiTextHandle,
) -> str:
    """Return the identifier of a command or a widget in the page."""
    return handle._impl.uuid  # pyright: ignore[reportPrivateUsage, reportUnknownMemberType]


def queue_script(channel: viser.SceneApi | viser.GuiApi, source: str) -> None:
    """Send a script, which each page of the channel runs in turn with its other messages."""
    channel._websock_interface.queue_message(  # pyright: ignore[reportPrivateUsage]
        _messages.RunJavascriptMessage(source=source)
    )
