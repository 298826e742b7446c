"""What an anatomy costs a page: memory, making it, a tick and its picture, by processor time.

`python -m benchmarks.anatomy_cost` prints it for the usual anatomy, whose gallbladder's neck is
drawn about while a dissector works among the strands, all relaxing as in free practice.
"""

import math
import time
from pathlib import Path

import numpy as np

from app.anatomy import anatomy_named, drawn_anatomy
from app.simulation import ELEMENTS, TICKS_PER_SECOND, Session, Specimen
from app.trainer.scope.packing import Frame, Packing
from app.trainer.scope.pose import Pose

PAGES, TICKS, CASES = 20, 600, 20
PAGE_BYTES = 4096


def print_cost() -> None:
    """Print memory of a session, and times of making it, of a tick and of a picture."""
    anatomy = anatomy_named("normal")
    Session(Specimen.of_anatomy(anatomy, relaxation=True)).advance(3)  # compiled before it counts
    before, begun = _resident(), time.process_time()
    kept = [Session(Specimen.of_anatomy(anatomy, relaxation=True)) for _ in range(PAGES)]
    made = (time.process_time() - begun) / PAGES
    print(f"a session: {(_resident() - before) / PAGES:.2f} MB, made in {made:.3f} s")
    networks: list[float] = []
    for seed in range(1, CASES + 1):
        case = drawn_anatomy(seed)
        begun = time.process_time()
        Specimen.of_anatomy(case).tubes(elements=ELEMENTS)
        networks.append(time.process_time() - begun)
    print(f"drawn cases: {np.median(networks):.3f} s at the median, at most {max(networks):.3f} s")
    session = kept[0]
    packing = Packing(session.spatial.beam)
    start = np.array(session.grab(0, 8.0, session.spatial.tubes.names.index("gallbladder")))
    session.choose_instrument(1, "dissector")
    session.open_jaws(1, 3.0)
    session.spatial.put_hand(1, np.array([44.0, 9.0, 6.0]))
    ticks, pictures = np.zeros(TICKS), np.zeros(TICKS)
    for tick in range(TICKS):
        at = tick / TICKS_PER_SECOND
        displacement = np.array(
            [0.5 * math.sin(at), 1.5 * math.sin(2 * at), 2.0 + 1.5 * math.sin(3 * at)]
        )
        session.move_hand(0, start + displacement)
        jaws = np.array([44.0 + 2.0 * math.sin(at), 9.0, 5.0 + 4.0 * math.sin(1.3 * at)])
        session.move_hand(1, jaws)
        begun = time.process_time()
        session.advance()
        done = time.process_time()
        packing.write(session.spatial.beam, Frame(Pose()), 0.0)
        session.reading()
        ticks[tick], pictures[tick] = done - begun, time.process_time() - done
    tick_ms, picture_ms = 1e3 * ticks.mean(), 1e3 * pictures.mean()
    print(f"a tick: {tick_ms:.2f} ms; picture and read-out: {picture_ms:.2f} ms")
    most = 1e3 / TICKS_PER_SECOND / (tick_ms + picture_ms)
    print(f"pages of a core at {TICKS_PER_SECOND} a second: {most:.0f}")


def _resident() -> float:
    """Return the memory that this process has, MB."""
    pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
    return int(pages) * PAGE_BYTES / 1e6


if __name__ == "__main__":
    print_cost()
