"""What replaces viser's transport: its message pump, its serialiser and its queue.

A picture costs a third of the work that viser needs for it, and a page is always woken
(docs/viser-faults.md says which two faults of viser's are mended here). With
`BLUNTDISSECT_PLAIN_VISER=1` in the environment all of it is off, and each function below does its
work by viser's public interface: what fails then too is no fault of this module.
"""

import asyncio
import contextlib
import dataclasses
import os
import threading
import time
import typing
from collections.abc import Callable, Generator, Iterable, Sequence
from functools import cache
from itertools import islice
from operator import attrgetter
from typing import Any, cast, get_args, get_origin

import msgspec
import numpy as np
import viser
import zstandard
from numpy.typing import NDArray
from viser import _messages, infra  # pyright: ignore[reportPrivateUsage]
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

from app.trainer.viser_bridge.private_api import PAGE_MESSAGES

ON = os.environ.get("BLUNTDISSECT_PLAIN_VISER") != "1"
"""Whether viser's transport is replaced; read once, when this module is imported."""


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
    if not ON:
        yield
        return
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
    chunks: list[bytes | memoryview] = [
        len(content).to_bytes(8, "little") + len(packed).to_bytes(8, "little"),
        packed,
    ]
    end = 16 + len(packed)
    for each in arrays:
        chunks += (bytes(-end % 8), each)
        end += -end % 8 + each.nbytes
    return b"".join(chunks)


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


def stream(node: viser.SceneNodeHandle, name: str, value: NDArray[np.float32] | str) -> bool:
    """Send a text, or a copy of an array, of a scene node if it differs; return whether it did."""
    before = getattr(node._impl.props if ON else node, name)  # pyright: ignore[reportPrivateUsage]
    if before == value if isinstance(value, str) else np.array_equal(before, value):
        return False
    hand_over(node, name, value if isinstance(value, str) else value.copy())
    return True


def hand_over(node: viser.SceneNodeHandle, name: str, value: NDArray[np.float32] | str) -> None:
    """Send a text or an array of a scene node, which nobody writes to from now on."""
    if not ON:
        setattr(node, name, value)
        return
    state = node._impl  # pyright: ignore[reportPrivateUsage]
    if state.removed:
        raise RuntimeError(f"{state.name} has been removed")
    setattr(state.props, name, value)
    message = _messages.SceneNodeUpdateMessage(state.name, {name: value})
    _queue(state, message, f"scene:{state.name}:update:{name}")


def place_node(node: viser.SceneNodeHandle, x: float, y: float, z: float) -> None:
    """Send where a scene node is if it differs: as assigning does, in less time."""
    if not ON:
        node.position = x, y, z
        return
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
    if not ON:
        plot.data = data
        return
    state = cast(Any, plot)._impl
    if state.removed:
        raise RuntimeError("the plot has been removed")
    state.props.data = data
    plot._queue_update("data", data)  # pyright: ignore[reportPrivateUsage]


def received(raw: bytes, decoded: msgspec.Struct) -> Any:
    """Return what viser is to read of a page's message: itself, or viser's own message of it."""
    return viser_message(decoded) if ON else raw


def viser_message(decoded: msgspec.Struct) -> Any:
    """Return what was decoded as viser's own message, as viser would have made it."""
    kind, fields, changed = _KINDS[type(decoded).__name__]
    values = [getattr(decoded, name) for name in fields]
    for place, change in changed:
        values[place] = change(values[place])
    return kind(*values)


def _whole(number: float) -> float:
    return int(number) if number.is_integer() else number


def _changes(hint: Any) -> Callable[[Any], Any] | None:
    """Return what makes viser's value of a field's decoded one, if that is another."""
    if hint is int:
        return int
    if hint == typing.Optional[int]:  # noqa: UP045
        return lambda value: None if value is None else _whole(value)
    if typing.get_origin(hint) is dict:
        value_of = attrgetter("value")
        return lambda updates: {"value": value_of(updates)}
    return tuple if typing.get_args(hint)[1:] == (...,) else None


def _kind(kind: type[Any]) -> tuple[type[Any], list[str], list[tuple[int, Callable[[Any], Any]]]]:
    hints = typing.get_type_hints(kind)
    names = [field.name for field in dataclasses.fields(kind)]
    changes = [(place, _changes(hints[name])) for place, name in enumerate(names)]
    return kind, names, [(place, change) for place, change in changes if change is not None]


_KINDS = {kind.__name__: _kind(kind) for kind in PAGE_MESSAGES}


_send_to_all = _infra._message_producer  # pyright: ignore[reportPrivateUsage]
if ON:
    _infra._message_producer = _send_messages  # pyright: ignore[reportPrivateUsage]
    _infra._message_consumer = _take_messages  # pyright: ignore[reportPrivateUsage]
