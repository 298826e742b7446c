"""Peers, each in a process of its own: one that crashes there costs only its own figure."""

import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context

from benchmarks import mujoco_chain, opensees_beam
from benchmarks.engine import Engine, unavailable

PEERS: tuple[tuple[str, str, Callable[[], Engine]], ...] = (
    (opensees_beam.KEY, opensees_beam.NAME, opensees_beam.opensees_engine),
    (mujoco_chain.KEY, mujoco_chain.NAME, mujoco_chain.mujoco_engine),
)


def peer_engines() -> list[Engine]:
    """Return the timing of each peer, one after the other."""
    engines: list[Engine] = []
    for key, name, timed in PEERS:
        with ProcessPoolExecutor(1, get_context("spawn"), initializer=_silence) as pool:
            try:
                engine = pool.submit(timed).result()
            except BrokenProcessPool:
                engine = unavailable(key, name, RuntimeError("its process crashed"))
        engines.append(engine)
    return engines


def _silence() -> None:
    """Drop the output of compiled code; a failure is returned as a note."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
