"""What is sent in one `atomic()` block of viser comes in several frames (docs/viser-faults.md)."""

import asyncio
import threading

from viser import _messages
from viser.infra._async_message_buffer import AsyncMessageBuffer


class BeginsTheNextBlock(_messages.RunJavascriptMessage):
    """A message during whose sending another thread begins its next block."""

    buffer: AsyncMessageBuffer | None = None

    @property
    def excluded_self_client(self):
        if self.buffer is not None:
            buffer, self.buffer = self.buffer, None
            other = threading.Thread(target=buffer.atomic_start)
            other.start()
            other.join()
        return None

    @excluded_self_client.setter
    def excluded_self_client(self, value):  # pyright: ignore[reportIncompatibleVariableOverride]
        pass


async def frames(messages):
    buffer = AsyncMessageBuffer(asyncio.get_running_loop(), persistent_messages=False)
    windows = buffer.window_generator(client_id=0)
    for each in messages:
        if isinstance(each, BeginsTheNextBlock):
            each.buffer = buffer
    buffer.atomic_start()
    for each in messages:
        buffer.push(each)
    buffer.atomic_end()
    sizes = [len(await anext(windows))]
    if buffer.atomic_counter:  # the other thread's block ends
        buffer.atomic_end()
    while sum(sizes) < len(messages):
        sizes.append(len(await anext(windows)))
    await windows.aclose()
    return sizes


def scripts(count):
    return [_messages.RunJavascriptMessage(f"{k}") for k in range(count)]


print("129 messages:", asyncio.run(frames(scripts(129))))
print("4 messages:", asyncio.run(frames([BeginsTheNextBlock("first"), *scripts(3)])))
