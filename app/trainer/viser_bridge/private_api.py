"""All private names of viser that the trainer needs, each behind a function of its own."""

import asyncio
import contextlib
import io
import logging
import threading
import time
import warnings
from collections.abc import Awaitable, Callable, Generator, Iterable, Mapping, Sequence
from functools import cache
from itertools import islice
from typing import Any, cast, get_args, get_origin

import msgspec
import numpy as np
import viser
import websockets.asyncio.server
import zstandard
from numpy.typing import NDArray
from viser import _messages, infra  # pyright: ignore[reportPrivateUsage]
from viser._icons import svg_from_icon  # pyright: ignore[reportPrivateUsage]
from viser.infra import _infra  # pyright: ignore[reportPrivateUsage]
from viser.infra._async_message_buffer import (  # pyright: ignore[reportPrivateUsage]
    AsyncMessageBuffer,
)
from viser.infra._messages import (  # pyright: ignore[reportPrivateUsage]
    _prepare_for_serialization as prepared,  # pyright: ignore[reportPrivateUsage, reportUnknownVariableType]
)
from viser.infra._messages import (  # pyright: ignore[reportPrivateUsage]
    get_type_hints_cached,
    wire_field_names,
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

Answer = Response | Awaitable[Response] | None
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
    # No warning for a tab that closes while it is drawn: its session ends in a moment.
    warnings.filterwarnings("ignore", r"Queued a \w+ on a closed connection", UserWarning)
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
            return process_request(connection, request)

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


class _LoopEvent(asyncio.Event):
    """An event that only its loop's thread sets.

    viser sets its events in any thread and again on the loop. Where the first comes between a
    `wait`'s look at the event and its sleep, the second does nothing, and the page waits for ever.
    """

    def __init__(self) -> None:
        super().__init__()
        self._thread = threading.get_ident()

    def set(self) -> None:
        """Set the event, in the loop's thread."""
        if threading.get_ident() == self._thread:
            super().set()


async def _send_messages(
    connection: ServerConnection,
    buffer: AsyncMessageBuffer,
    client_id: int,
    backlog_done_message: _messages.Message | None = None,
) -> None:
    """Send the messages of one page, in viser's format, with a third of the work a picture."""
    if buffer.persistent_messages:
        await _send_to_all(connection, buffer, client_id, backlog_done_message)
        return
    compress = zstandard.ZstdCompressor(level=1).compress
    buffer.message_event = _LoopEvent()
    buffer.event_loop = cast(asyncio.AbstractEventLoop, _Waker(buffer.event_loop))
    while not buffer.done:
        window = _taken(buffer)
        if not window:
            await buffer.message_event.wait()
            buffer.message_event.clear()
            continue
        sent = [each for each in window if each.excluded_self_client != client_id]
        await connection.send(_packed(sent, compress))
        if not buffer.message_from_id:  # else as fast as the page takes them
            await asyncio.sleep(buffer.window_duration_sec)


async def _take_messages(
    connection: ServerConnection,
    handle: Callable[[Any], None],
    kind: type[infra.Message],
) -> None:
    """Hand over the messages of one page, which its connection may have decoded already."""
    while True:
        came: Any = await connection.recv()
        handle(kind.deserialize(came) if isinstance(came, bytes) else came)


class _Waker:
    """A page's loop, woken once for all that a thread sends while it `wakes_once`."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop

    def call_soon_threadsafe(self, callback: Callable[[], object]) -> None:
        """Have the loop call back, soon or when the thread that sends is done."""
        later: list[Callable[[], object]] | None = getattr(_sending, "later", None)
        if later is None:
            self._loop.call_soon_threadsafe(callback)
        else:
            later.append(callback)


_sending = threading.local()


@contextlib.contextmanager
def wakes_once(server: viser.ViserServer) -> Generator[None]:
    """Let what this thread sends to pages meanwhile go out together, by one call of the loop."""
    _sending.later = later = list[Callable[[], object]]()
    try:
        yield
    finally:
        del _sending.later
        if later:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                server.get_event_loop().call_soon_threadsafe(_call_all, later)


def _call_all(callbacks: Iterable[Callable[[], object]]) -> None:
    for callback in callbacks:
        callback()


_send_to_all = _infra._message_producer  # pyright: ignore[reportPrivateUsage]
_infra._message_producer = _send_messages  # pyright: ignore[reportPrivateUsage]
_infra._message_consumer = _take_messages  # pyright: ignore[reportPrivateUsage]


def _taken(buffer: AsyncMessageBuffer) -> Sequence[Any]:
    """Take the messages that wait, in their order; none while more are being grouped."""
    waiting, most = buffer.message_from_id, buffer.max_window_size
    with buffer.buffer_lock:
        if buffer.atomic_counter:
            return ()
        if len(waiting) > most:
            return [buffer.pop_message_locked(number) for number in [*islice(waiting, most)]]
        window = [*waiting.values()]
        for index in (waiting, buffer.id_from_redundancy_key, buffer.ids_from_entity_state_key):
            index.clear()
        return window


def _packed(messages: Sequence[Any], compress: Callable[[bytes], bytes]) -> bytes:
    """Return messages as one frame: their compressed text, then their arrays, aligned to 8."""
    arrays: list[memoryview] = []
    content = _encode(
        {
            "messages": [_plain(each, arrays) for each in messages],
            "timestampSec": time.perf_counter(),
            "binaryBufferLengths": [each.nbytes for each in arrays],
        }
    )
    packed = compress(content)
    parts: list[bytes | memoryview] = [
        len(content).to_bytes(8, "little") + len(packed).to_bytes(8, "little"),
        packed,
    ]
    end = 16 + len(packed)
    for each in arrays:
        parts += (bytes(-end % 8), each)
        end += -end % 8 + each.nbytes
    return b"".join(parts)


_encode = msgspec.msgpack.Encoder().encode


def _plain(message: Any, arrays: list[memoryview]) -> dict[str, Any]:
    """Return what viser's `as_serializable_dict` does, without its look at every type."""
    plain: dict[str, Any] = {}
    for name, hint, own in _fields(cast(type[Any], type(message))):
        value: object = getattr(message, name)
        kind = type(value)
        if kind is str or value is None or kind is own:
            plain[name] = value
        elif kind is dict:
            plain[name] = {
                key: each if type(each) in _AS_THEY_ARE else prepared(each, Any, arrays)
                for key, each in cast("dict[str, Any]", value).items()
            }
        elif (
            own is tuple
            and kind is tuple
            and all(type(one) is float for one in cast(tuple[object, ...], value))
        ):
            plain[name] = value
        else:
            plain[name] = prepared(value, hint, arrays)
    plain["type"] = type(message).__name__
    return plain


_AS_THEY_ARE = frozenset({str, float, int, bool, type(None)})


@cache
def _fields(kind: type[Any]) -> list[tuple[str, Any, type | None]]:
    """Return a message's fields with their types, and the type that goes out as it is, if any."""
    hints = get_type_hints_cached(kind)
    return [
        (
            name,
            hints[name],
            hints[name]
            if hints[name] in (float, int, bool)
            else tuple
            if get_origin(hints[name]) is tuple and set(get_args(hints[name])) == {float}
            else None,
        )
        for name in wire_field_names(kind)
    ]


def stream(node: viser.SceneNodeHandle, name: str, value: NDArray[np.float32] | str) -> None:
    """Send a text, or a copy of an array, of a scene node if it differs, as assigning does."""
    before = getattr(node._impl.props, name)  # pyright: ignore[reportPrivateUsage]
    if not (before == value if isinstance(value, str) else np.array_equal(before, value)):
        hand_over(node, name, value if isinstance(value, str) else value.copy())


def hand_over(node: viser.SceneNodeHandle, name: str, value: NDArray[np.float32] | str) -> None:
    """Send a text or an array of a scene node, which nobody writes to from now on."""
    state = node._impl  # pyright: ignore[reportPrivateUsage]
    if state.removed:
        raise RuntimeError(f"{state.name} has been removed")
    setattr(state.props, name, value)
    message = _messages.SceneNodeUpdateMessage(state.name, {name: value})
    _queue(state, message, f"scene:{state.name}:update:{name}")


def place_node(node: viser.SceneNodeHandle, x: float, y: float, z: float) -> None:
    """Send where a scene node is if it differs: as assigning does, in less time."""
    state = node._impl  # pyright: ignore[reportPrivateUsage]
    if state.position.tolist() != [x, y, z]:
        state.position[:] = x, y, z
        message = _messages.SetPositionMessage(state.name, (x, y, z))
        _queue(state, message, f"scene:{state.name}:update:SetPositionMessage")


def _queue(
    state: Any,
    message: _messages.SceneNodeUpdateMessage | _messages.SetPositionMessage,
    key: str,
) -> None:
    """Queue an update of a scene node under its `redundancy_key`, as viser does in more time."""
    message.owner = state.api._owner_id
    object.__setattr__(message, "_cached_redundancy_key", key)
    interface = state.api._websock_interface
    buffer: AsyncMessageBuffer = interface.get_message_buffer()
    with interface._record_lock:
        if not buffer.done and not interface._record_handles:
            with buffer.buffer_lock:
                if buffer.atomic_counter:  # the block's end wakes who sends
                    _push(buffer, message, key)
                    return
        interface.queue_message(message)


def _push(buffer: AsyncMessageBuffer, message: Any, key: str) -> None:
    """Add an update of a scene node, in place of an older one; the buffer is locked."""
    numbers, of_node = buffer.id_from_redundancy_key, buffer.ids_from_entity_state_key
    before = numbers.get(key)
    if before is not None:
        buffer.pop_message_locked(before)
    number = buffer.message_counter
    buffer.message_counter = number + 1
    buffer.message_from_id[number], numbers[key] = message, number
    node = "scene", message.name
    if node in of_node:
        of_node[node].add(number)
    else:
        of_node[node] = {number}


def set_plot(plot: viser.GuiUplotHandle, data: tuple[NDArray[np.float64], ...]) -> None:
    """Send the data of a plot, which nobody writes to from now on: as assigning does."""
    state = cast(Any, plot)._impl
    if state.removed:
        raise RuntimeError("the plot has been removed")
    state.props.data = data
    plot._queue_update("data", data)  # pyright: ignore[reportPrivateUsage]


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


def page_number(handle: viser.CommandHandle | viser.GuiSliderHandle[Any]) -> str:
    """Return the identifier of a command or a widget in the page."""
    return handle._impl.uuid  # pyright: ignore[reportPrivateUsage, reportUnknownMemberType]


def queue_script(channel: viser.SceneApi | viser.GuiApi, source: str) -> None:
    """Send a script, which each page of the channel runs in turn with its other messages."""
    channel._websock_interface.queue_message(  # pyright: ignore[reportPrivateUsage]
        _messages.RunJavascriptMessage(source=source)
    )
