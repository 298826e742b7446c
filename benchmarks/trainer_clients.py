"""Steps per second of the trainer with many clients, their frames, and processor time.

`python -m benchmarks.trainer_clients dissect 32 60` has 32 pages dissect for 60 s; `pull`, `calot`,
`mixed` (every other page pulls) and `class` (mixed, trainees of a class who have joined it, whom
the teacher's page watches) are the others.

Clients are pages without a picture (`page_protocol`): they move the force slider, lift the duct
off its bed, or open a dissector's jaws in Calot's triangle again and again, as a trainee would, and
count the pictures that come back. One more client
waits for the duct's answer to each of its moves. The trainer runs as a process of its own, which
counts its ticks.
"""

import asyncio
import itertools
import math
import sys
import time
import timeit
from collections import Counter
from typing import Literal, cast

import numpy as np

from benchmarks.duct import DUCT
from benchmarks.page_protocol import Page, connected, cookie_of, hand_forces, teacher_connected
from benchmarks.served_trainer import Served, served_trainer
from physics import Exact, NeoHooke

Mode = Literal["pull", "dissect", "calot"]
Mix = Literal["pull", "dissect", "calot", "mixed", "class"]
"""What clients do; every other one of a mix, or of a class, pulls."""

CLIENTS = (1, 8, 16)
SECONDS = 10.0
# Time for the pages to be sent before anything is counted, s.
SETTLING = 2.0
SLIDER_SECONDS, DRAG_SECONDS = 0.1, 0.05
"""A hand moves a slider, or what it drags, this often."""
REACHED, STROKE = 44, 30
"""Steps of an instrument into the triangle, and then from one opening or closing to the next."""
# Moves of the slider whose answers are waited for.
LATENCY_MOVES = 60
# A duct that sends nothing for so long has come to rest.
STILL_SECONDS = 0.15


async def pulling(
    address: str,
    start: asyncio.Event,
    stop: asyncio.Event,
    mode: Mode = "pull",
    trainee: tuple[str, str] | None = None,
) -> tuple[int, float]:
    """Pull or dissect as one client does, in a class as a trainee by a cookie and a name."""
    cookie, name = trainee or ("", None)
    async with connected(address, cookie) as connection:
        page = Page(connection)
        await page.open(mode, name)

        async def pull() -> None:
            for force in hand_forces():
                await page.pull_with(force)
                await asyncio.sleep(SLIDER_SECONDS)

        async def dissect() -> None:
            for step in itertools.count():
                time_s = step * DRAG_SECONDS
                displacement = (0.0, math.sin(2.0 * time_s), 2.0 + 1.5 * math.sin(3.0 * time_s))
                await page.drag(displacement)
                await asyncio.sleep(DRAG_SECONDS)

        async def spread() -> None:
            await page.point("hand")  # the right one
            for step in itertools.count():
                in_triangle, at_end = divmod(step - REACHED, STROKE)
                if step < REACHED:
                    words = "nudge 0 0 0.5"
                elif not at_end:
                    words = "act"  # the jaws open, or close
                else:
                    words = f"nudge {0.1 * (-1) ** (in_triangle // 2)} 0 0"
                await page.point(words)
                await asyncio.sleep(DRAG_SECONDS)

        work = {"pull": pull, "dissect": dissect, "calot": spread}
        hand = asyncio.create_task(work[mode]())
        frames, longest, last = 0, 0.0, time.perf_counter()
        while not stop.is_set():
            came, now = await page.frames(), time.perf_counter()
            if came and start.is_set():
                frames += came
                longest = max(longest, now - last)
            last = now if came else last
        hand.cancel()
        return frames, longest


async def watching(served: Served, start: asyncio.Event, came: Counter[str]) -> None:
    """Watch a class as the teacher's page does, without end; count what comes."""
    cookie = await asyncio.to_thread(cookie_of, served.teacher_link)
    async with teacher_connected(served.address, cookie) as connection:
        await connection.send('{"type":"hello"}')  # who says nothing is sent away
        async for _ in connection:
            came["news"] += start.is_set()


async def counted(
    served: Served, clients: int, seconds: float, mix: "Mix" = "pull"
) -> dict[str, float]:
    """Return the figures of some clients at once; memory grows from the first minute on."""
    start, stop = asyncio.Event(), asyncio.Event()
    pages: list[asyncio.Task[tuple[int, float]]] = []
    for number in range(clients):
        mixed: Mode = "pull" if number % 2 else "dissect"
        mode: Mode = mixed if mix in ("mixed", "class") else mix
        trainee = None
        if mix == "class":
            trainee = await asyncio.to_thread(cookie_of, served.link), f"Trainee {number + 1}"
        pages.append(asyncio.create_task(pulling(served.address, start, stop, mode, trainee)))
    came_to_teacher = Counter[str]()
    teacher = (
        asyncio.create_task(watching(served, start, came_to_teacher)) if mix == "class" else None
    )
    while len((await asyncio.to_thread(served.takings)).frames) < clients:
        if failed := [page for page in pages if page.done()]:
            failed[0].result()
        await asyncio.sleep(0.1)
    await asyncio.sleep(SETTLING)
    before = await asyncio.to_thread(served.takings)
    start.set()
    began, own = time.perf_counter(), time.process_time()
    first = min(60.0, 0.5 * seconds)
    await asyncio.sleep(first)
    settled = await asyncio.to_thread(served.takings)
    await asyncio.sleep(seconds - first)
    after = await asyncio.to_thread(served.takings)
    elapsed, own = time.perf_counter() - began, time.process_time() - own
    stop.set()
    came = await asyncio.gather(*pages)
    ticks, missed = after.ticks - before.ticks, after.missed - before.missed
    watched: dict[str, float] = {}
    if teacher is not None:
        if teacher.done():
            teacher.result()
        teacher.cancel()
        watched[f"teacher_news_per_second_{clients}"] = came_to_teacher["news"] / elapsed
    frames = [after.frames[each] - before.frames[each] for each in before.frames]
    drawn, processor = min(frames), after.processor_s - before.processor_s
    return watched | {
        f"processor_ms_a_picture_{clients}": 1e3 * processor / max(sum(frames), 1),
        f"steps_per_second_{clients}": ticks / elapsed,
        f"missed_percent_{clients}": 100.0 * missed / max(ticks + missed, 1),
        f"drawn_per_second_{clients}": drawn / elapsed,
        f"frames_per_second_{clients}": min(frames for frames, _ in came) / elapsed,
        f"longest_gap_ms_{clients}": 1e3 * max(gap for _, gap in came),
        f"processor_percent_{clients}": 100.0 * processor / elapsed,
        f"clients_processor_percent_{clients}": 100.0 * own / elapsed,
        f"resident_mb_{clients}": after.resident_bytes / 1e6,
        f"memory_grown_percent_{clients}": 100.0
        * (after.resident_bytes / settled.resident_bytes - 1.0),
    }


async def answer_seconds(address: str, moves: int) -> list[float]:
    """Return how long after each move of the slider the duct's next vertices come, s."""
    async with connected(address) as connection:
        page = Page(connection)
        await page.open()
        seconds: list[float] = []
        for move in range(moves):
            try:
                while True:  # until it is at rest
                    await asyncio.wait_for(page.messages(), STILL_SECONDS)
            except TimeoutError:
                pass
            start = time.perf_counter()
            await page.pull_with(0.5 + 0.1 * (move % 2))
            while not await page.frames():
                pass
            seconds.append(time.perf_counter() - start)
        return seconds


def machine_speed() -> dict[str, float]:
    """Return this machine's speed now, to compare other figures with."""
    pull = Exact(NeoHooke()).pull(DUCT, 0.5 * DUCT.span)
    stations = np.array([0.0])

    def loop() -> None:
        total = 0
        for number in range(1_000_000):
            total += number

    def solves() -> None:
        for load in range(1000):
            pull.to_force(2.0 + 0.02 * (load % 2)).sample(stations)

    solves()
    return {
        "plain_loop_ms": 1e3 * min(timeit.repeat(loop, number=1, repeat=5)),
        "exact_beam_us": 1e3 * min(timeit.repeat(solves, number=1, repeat=5)),
    }


def client_figures() -> dict[str, float]:
    """Return the figures of each number of clients, and their share of a core."""
    figures = machine_speed()
    with served_trainer() as served:
        answers = asyncio.run(answer_seconds(served.address, LATENCY_MOVES))
        figures["answer_ms_95"] = 1e3 * float(np.percentile(answers, 95))
        for clients in CLIENTS:
            figures |= asyncio.run(counted(served, clients, SECONDS))
    return figures


def main() -> None:
    """Print the figures of some clients."""
    mix = cast("Mix", sys.argv[1])
    with served_trainer(of_class=mix == "class") as served:
        figures = asyncio.run(counted(served, int(sys.argv[2]), float(sys.argv[3]), mix))
    for name, figure in (machine_speed() | figures).items():
        print(f"{name}: {figure:.3g}")


if __name__ == "__main__":
    main()
