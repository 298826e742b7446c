"""What a page may take of the trainer: places, messages and bytes, bounded before viser sees them.

A connection counts from the moment it is accepted. One that has not yet spoken as a page gives way
to a newer one where its address is full, so that silent connections keep nobody out. Messages that
come too fast wait in the sender's own socket. Anything that no page sends closes its connection.
"""

import asyncio
import logging
import ssl
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from ipaddress import IPv6Network, ip_address
from typing import Any

import msgspec
from websockets.asyncio.server import ServerConnection
from websockets.frames import CloseCode, Frame, Opcode
from websockets.protocol import Event

from app.trainer.viser_bridge.fast_transport import received
from app.trainer.viser_bridge.page_messages import page_message_decoder

MIB = 2**20
# Addresses whose openings are remembered.
MOST_ADDRESSES = 1000
CLOSE_SECONDS = 0.5
"""s that a page may take to close its connection when asked."""
LEAST_RATE = 10.0
MOST_CLIENTS = 64
MOST_FRAMES, FRAMES_PER_SECOND = 200.0, 10.0
"""Pings and small fragments of a page, at once and in the long run: browsers send hardly any."""
SMALL_BYTES = 1024
SPARE = 32
"""Connections beside the pages: of requests for the page, and of pages that are being closed."""
# Pages that an address may open in the long run; at first as many as it may have.
OPENINGS_PER_SECOND = 2.0

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Bounds:
    """Limits of what is sent to the trainer."""

    most_clients: int = MOST_CLIENTS  # Trainees at a time
    most_per_address: int = 48  # Pages; a class behind one router has one address
    most_per_browser: int = 8  # Pages with the same cookie
    messages_per_second: float = 120.0  # Of a page, in the long run
    silent_seconds: float = 20.0  # Until a connection's first message
    message_bytes: int = MIB  # A page sends a file in parts of half of this
    upload_bytes: int = 64 * MIB  # Of a page's unfinished uploads
    all_upload_bytes: int = 256 * MIB  # Of those of all pages

    def __post_init__(self) -> None:
        for name in ("most_clients", "most_per_address", "most_per_browser"):
            if getattr(self, name) < 1:
                raise ValueError(f"--{name.replace('_', '-')} must be at least 1")
        if not self.messages_per_second >= LEAST_RATE:  # NaN neither
            raise ValueError(
                f"--messages-per-second must be at least {LEAST_RATE:g}: a hand that drags sends 60"
            )


class Bucket:
    """Lets `most` through at once, and `rate` a second in the long run."""

    def __init__(
        self, most: float, rate: float, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._most, self._rate, self._clock = most, rate, clock
        self._left, self._at = most, clock()

    def take(self) -> float:
        """Take one, and return the s until it may pass."""
        now = self._clock()
        self._left = min(self._most, self._left + (now - self._at) * self._rate) - 1.0
        self._at = now
        return max(0.0, -self._left / self._rate)

    def passes(self) -> bool:
        """Take one if it may pass at once; return whether it does."""
        if self.take() == 0.0:
            return True
        self._left += 1.0
        return False


class Connections:
    """All connections of a trainer, under common bounds; used on the server's event loop only."""

    def __init__(
        self,
        bounds: Bounds,
        tell: Callable[["PageConnection", str], None] | None = None,
        proxy: str | None = None,
    ) -> None:
        # `proxy` is a reverse proxy's address: what it says of its clients' addresses is believed.
        self.bounds, self._tell = bounds, tell
        try:
            self.proxy = None if proxy is None else _network(str(ip_address(proxy)))
        except ValueError:
            raise ValueError(f"--trust-proxy must be an address, not {proxy}") from None
        self.decoder = page_message_decoder()
        self.refusals: Counter[str] = Counter()
        self._all: dict[PageConnection, None] = {}
        self._openings: dict[str, Bucket] = {}

    def __len__(self) -> int:
        return len(self._all)

    @property
    def upload_bytes(self) -> int:
        """Bytes of all unfinished uploads, as announced."""
        return sum(each.upload_bytes for each in self._all)

    def add(self, new: "PageConnection") -> None:
        """Count a connection; of too many the oldest that is no page yet gives way."""
        self._all[new] = None
        bounds = self.bounds
        mine = [each for each in self._all if each.address == new.address != self.proxy]
        for those, most in (
            (mine, bounds.most_per_address + SPARE),
            (list(self._all), 2 * bounds.most_clients + 2 * SPARE),
        ):
            if len(those) > most:
                oldest = next(each for each in those if not each.spoke)
                self.remove(oldest)
                self.refuse("connections", oldest)
                oldest.transport.abort()

    def remove(self, connection: "PageConnection") -> None:
        """Count a connection no longer."""
        self._all.pop(connection, None)

    def admit(self, page: "PageConnection", browser: str | None, *, opens: bool) -> str | None:
        """Return why a page, which opens now or soon, gets no place; None if it gets one."""
        bounds = self.bounds
        pages = [each for each in self._all if each.opened]
        mine = sum(each.address == page.address for each in pages)
        if browser and sum(each.browser == browser for each in pages) >= bounds.most_per_browser:
            reason = f"This browser has {bounds.most_per_browser} pages open: close one.\n"
        elif mine >= bounds.most_per_address:
            reason = f"Your address has {bounds.most_per_address} pages open: close one.\n"
        elif len(pages) >= bounds.most_clients + SPARE:
            reason = f"All {bounds.most_clients} places are taken: come back later.\n"
        elif opens and not self._may_open(page.address):
            reason = "Your address opens pages too fast: wait some seconds.\n"
        else:
            page.opened, page.browser = opens, browser
            return None
        self.refuse("pages", page)
        return reason

    def _may_open(self, address: str) -> bool:
        if address not in self._openings and len(self._openings) >= MOST_ADDRESSES:
            del self._openings[next(iter(self._openings))]
        openings = self._openings.setdefault(
            address, Bucket(self.bounds.most_per_address, OPENINGS_PER_SECOND)
        )
        return openings.passes()

    def refuse(self, what: str, connection: "PageConnection", reason: str = "") -> None:
        """Count a refusal, and log the first of its kind: what was sent is never logged."""
        self.refusals[what] += 1
        if self.refusals[what] == 1:
            log.warning("refused from %s: %s", connection.address, reason or f"too many {what}")

    def tell(self, connection: "PageConnection", words: str) -> None:
        """Tell a page what it cannot have."""
        if self._tell is not None:
            self._tell(connection, words)


@dataclass(slots=True)
class _Upload:
    chunks: int  # as announced
    size_bytes: int
    came: set[int] = field(default_factory=set[int])
    bytes_came: int = 0


class PageConnection(ServerConnection):
    """A connection within bounds; viser reads its messages only by `recv`."""

    def __init__(self, connections: Connections, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        bounds = connections.bounds
        self._connections, self._bounds = connections, bounds
        self._messages = Bucket(3.0 * bounds.messages_per_second, bounds.messages_per_second)
        self._frames = Bucket(MOST_FRAMES, FRAMES_PER_SECOND)
        self._uploads: dict[str, _Upload] = {}
        self._patience: asyncio.TimerHandle | None = None
        self._ending: asyncio.Task[None] | None = None
        self.address = ""
        self.browser: str | None = None
        self.trainee: str | None = None  # whose cookie of a trainee's link it has
        self.is_teacher = False  # whether it has that of the teacher's link
        self.serve: Callable[[], Awaitable[None]] | None = None  # in place of viser
        self.opened = self.spoke = False

    @property
    def upload_bytes(self) -> int:
        """Bytes of the page's unfinished uploads, as announced."""
        return sum(each.size_bytes for each in self._uploads.values())

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Count the connection, and give it a time to speak."""
        self.address = _network(transport.get_extra_info("peername")[0])
        super().connection_made(transport)
        self._patience = self.loop.call_later(self._bounds.silent_seconds, self._end_silence)
        self._connections.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Free the connection's place."""
        if self._patience is not None:
            self._patience.cancel()
        self._connections.remove(self)
        super().connection_lost(exc)

    def take_client(self, forwarded: list[str]) -> None:
        """Take the client's address from a trusted proxy, which adds it to X-Forwarded-For."""
        if self.address == self._connections.proxy and forwarded:
            with suppress(ValueError):
                last = ip_address(forwarded[-1].rpartition(",")[2].strip())
                self.address = _network(str(last))

    def process_event(self, event: Event) -> None:
        """Take a frame. Pings and small fragments are counted: they never come to `recv`."""
        if isinstance(event, Frame) and event.opcode is not Opcode.BINARY:
            small = event.opcode is not Opcode.CONT or len(event.data) < SMALL_BYTES
            if small and self._frames.take() > 0.0:
                self._connections.refuse("frames", self, "pings or fragments without end")
                self.transport.abort()
                return
        super().process_event(event)

    async def recv(self, decode: bool | None = None) -> Any:
        """Return the next message that a page may send, as viser is to read it."""
        while True:
            raw = await self._next(decode)
            try:
                if isinstance(raw, str):
                    raise msgspec.ValidationError("a text")
                message = self._connections.decoder.decode(raw)
                passes = self._passes(message)
            except (msgspec.MsgspecError, RecursionError):
                self._connections.refuse("kinds", self, "a message that no page sends")
                await self.close(CloseCode.POLICY_VIOLATION, "a message that no page sends")
                while True:  # until the end is raised
                    await super().recv(decode)
            self._hear()
            if passes:
                return received(raw, message)

    async def recv_text(self) -> str:
        """Return the next text, of a page that is not viser's."""
        raw = await self._next(None)
        self._hear()
        return raw if isinstance(raw, str) else ""

    async def _next(self, decode: bool | None) -> Any:
        """Return the next message, at the pace that is allowed."""
        raw = await super().recv(decode)
        if (wait := self._messages.take()) > 0.0:
            if not self._connections.refusals["messages"]:
                self._connections.refuse("messages", self, "too many messages; they wait")
            await asyncio.sleep(wait)
        return raw

    def _hear(self) -> None:
        """Note that it has spoken as a page."""
        if not self.spoke:
            self.spoke = True
            if self._patience is not None:
                self._patience.cancel()

    def _passes(self, message: Any) -> bool:
        """Return whether a valid message may be read; not if it is of a file that is too large."""
        kind = type(message).__name__
        if kind == "FileTransferStartUpload":
            # Whole numbers as viser makes them of these, and like it a second start replaces one.
            size, chunks = int(message.size_bytes), int(message.part_count)
            if not 0 <= chunks <= size:
                raise msgspec.ValidationError("parts of nothing")
            before = self._uploads.get(message.transfer_uuid)
            more = size - (0 if before is None else before.size_bytes)
            mine = self._bounds.upload_bytes
            if (
                self.upload_bytes + more > mine
                or self._connections.upload_bytes + more > self._bounds.all_upload_bytes
            ):
                self._connections.refuse("uploads", self, "more bytes of uploads than it may send")
                self._connections.tell(
                    self,
                    f"A file of {size / MIB:,.0f} MiB is not taken: a page may send "
                    f"{mine // MIB} MiB at a time, and less while many do.",
                )
                return False
            self._uploads[message.transfer_uuid] = _Upload(chunks, size)
            if chunks == 0:
                del self._uploads[message.transfer_uuid]
        elif kind == "FileTransferPart":
            upload = self._uploads.get(message.transfer_uuid)
            if upload is None:
                return False
            upload.came.add(int(message.part_index))
            upload.bytes_came += len(message.content)
            if upload.bytes_came > upload.size_bytes or not (
                0 <= message.part_index < upload.chunks
            ):
                raise msgspec.ValidationError("more than was announced")
            if len(upload.came) == upload.chunks:
                del self._uploads[message.transfer_uuid]
        return True

    def _end_silence(self) -> None:
        self._connections.refuse("silence", self, "a connection that said nothing")
        if self.opened:
            self._ending = self.loop.create_task(
                self.close(CloseCode.POLICY_VIOLATION, "a page that said nothing")
            )
        else:
            self.transport.abort()


def _network(address: str) -> str:
    """Return whose an address is: with IPv6 each customer has a network of 64 bits at least."""
    six = address.partition("%")[0]
    return str(IPv6Network((six, 64), strict=False)) if ":" in six else address


def socket_options(
    connections: Connections, tls: ssl.SSLContext | None = None
) -> dict[str, object]:
    """Return websockets' options under which it makes bounded connections."""
    return {
        "create_connection": partial(PageConnection, connections),
        "max_size": connections.bounds.message_bytes,
        "close_timeout": CLOSE_SECONDS,
        "server_header": None,
        "ssl": tls,
    }
