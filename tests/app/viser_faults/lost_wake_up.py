"""A client of viser that is sent nothing any more: a lost wake-up (docs/viser-faults.md)."""

import asyncio
import threading

from viser import _messages
from viser.infra._async_message_buffer import AsyncMessageBuffer


async def main():
    loop = asyncio.get_running_loop()
    buffer = AsyncMessageBuffer(loop, persistent_messages=False)
    windows = buffer.window_generator(client_id=0)
    create_future = loop.create_future

    def switch_threads():
        # `Event.wait` calls this after it has seen that the event is not set.
        loop.create_future = create_future
        push = threading.Thread(target=buffer.push, args=(_messages.RunJavascriptMessage("1"),))
        push.start()
        push.join()
        return create_future()

    async def first_window():
        loop.create_future = switch_threads
        return await anext(windows)

    waiting = asyncio.create_task(first_window())
    await asyncio.wait([waiting], timeout=1.0)
    await asyncio.to_thread(buffer.push, _messages.RunJavascriptMessage("2"))
    await asyncio.wait([waiting], timeout=1.0)
    print("sent" if waiting.done() else "not sent", len(buffer.message_from_id), "messages wait")
    waiting.cancel()


asyncio.run(main())
