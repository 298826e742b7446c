"""Half an hour of pulling, to see whether the trainer's memory grows.

Run from the root of the repository: ``python -m benchmarks.trainer_soak --seconds 1800``. One page
moves its slider ten times a second, tears the duct once a minute and resets it; each minute the
trainer says what it takes. The slopes are straight lines through all but the first minutes, in
which caches fill.
"""

import argparse
import asyncio
import itertools
from collections.abc import Sequence

import numpy as np
from rich.console import Console

from benchmarks.page_protocol import Page, connected, hand_forces
from benchmarks.served_trainer import Served, Takings, served_trainer

__all__ = ["slopes"]

SAMPLE_SECONDS = 60.0
# Left out of the slopes: what is made once, and the caches.
SETTLING_SAMPLES = 5
FIGURES = ("resident_bytes", "traced_bytes", "blocks", "log_inputs")
SLIDER_SECONDS = 0.1
# s; N, past the duct's break; s.
TEARS_EVERY, TEARING_FORCE, TORN_SECONDS = 60.0, 4.0, 4.0
# A run keeps a tick, a kind and a number of each input.
BYTES_AN_INPUT = 17


def slopes(samples: Sequence[Takings], seconds: float) -> dict[str, float]:
    """Return the growth of each of a trainer's figures, a minute."""
    minutes = seconds / 60.0 * np.arange(len(samples))
    return {
        f"{name}_a_minute": float(
            np.polyfit(minutes, [float(getattr(each, name)) for each in samples], 1)[0]
        )
        for name in FIGURES
    }


async def _pull(address: str) -> None:
    """Pull, tear and reset as one client does, for ever."""
    async with connected(address) as connection:
        page = Page(connection)
        await page.open()

        async def hear() -> None:
            while True:
                await page.messages()

        listening = asyncio.create_task(hear())
        try:
            while True:
                moves = round(TEARS_EVERY / SLIDER_SECONDS)
                for force in itertools.islice(hand_forces(), moves):
                    await page.pull_with(force)
                    await asyncio.sleep(SLIDER_SECONDS)
                await page.pull_with(TEARING_FORCE)
                await asyncio.sleep(TORN_SECONDS)
                await page.reset()
        finally:
            listening.cancel()


async def _samples(served: Served, seconds: float, every: float, console: Console) -> list[Takings]:
    page = asyncio.create_task(_pull(served.address))
    samples: list[Takings] = []
    loop = asyncio.get_running_loop()
    began = loop.time()
    while loop.time() - began < seconds and not page.done():
        await asyncio.sleep(every)
        takings = await asyncio.to_thread(served.takings)
        samples.append(takings)
        console.print(
            f"{(loop.time() - began) / 60.0:6.1f} min  {takings.resident_bytes / 1e6:7.1f} MB, "
            f"Python {takings.traced_bytes / 1e6:6.2f} MB, {takings.blocks:,} blocks, "
            f"{takings.log_inputs:,} inputs, {sum(takings.frames.values()):,} frames, "
            f"{takings.missed:,} of {takings.ticks + takings.missed:,} ticks missed",
            highlight=False,
        )
    page.cancel()
    await asyncio.wait([page])
    if not page.cancelled():
        page.result()  # it has failed
    return samples


def main() -> None:
    """Pull, and print the growth rates."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=1800.0)
    parser.add_argument("--every", type=float, default=SAMPLE_SECONDS)
    chosen = parser.parse_args()
    console = Console()
    with served_trainer(traced=True) as served:
        samples = asyncio.run(_samples(served, chosen.seconds, chosen.every, console))
    if len(samples) < SETTLING_SAMPLES + 2:
        console.print("Too short for slopes.")
        return
    grown = slopes(samples[SETTLING_SAMPLES:], chosen.every)
    console.print(
        f"A minute: memory {grown['resident_bytes_a_minute'] / 1e3:+.1f} kB, Python "
        f"{grown['traced_bytes_a_minute'] / 1e3:+.2f} kB, blocks "
        f"{grown['blocks_a_minute']:+.1f}, inputs {grown['log_inputs_a_minute']:+.0f} "
        f"of {BYTES_AN_INPUT} bytes each",
        highlight=False,
    )


if __name__ == "__main__":
    main()
