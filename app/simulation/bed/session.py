"""A dissection session: one trainee's duct in its bed, two hands at it, stepped in time.

The same action has one name from the page down: `choose_instrument`, `grab`, `move_hand`,
`release`, `open_jaws`. An input is clamped to its range here, set on the duct, and acts with the
next tick. Places are mm in the duct's frame (`app.simulation.bed.hand`).
"""

from threading import RLock

import numpy as np
from numpy.typing import NDArray

from app.simulation.bed.bedded_duct import HANDS, BeddedDuct, BedReading
from app.simulation.bed.hand import INSTRUMENTS, Instrument
from app.simulation.bed.preset import BedPreset, bed_named
from app.simulation.clock import TICK_SECONDS
from app.simulation.dissection import Dissection, default_preset
from app.simulation.drawn_duct import DrawnDuct
from app.simulation.preset import Preset
from app.simulation.session import VERTICES
from app.simulation.tear import SETTLED_SECONDS, tear_front, tear_swing
from organ_geometry import Organ

__all__ = ["BedSession"]

REACH = 60.0
"""mm beyond the duct's ends and to its sides that a hand can reach."""


class BedSession:
    """One duct in its bed, stepped in time. Safe to call from several threads.

    Inputs come from a browser: out of range they are clamped, and those that are not numbers are
    ignored. To the bit, the course of a session is a function of its inputs and of the ticks at
    which they come. `seed` chooses the raggedness of a torn rim, `bed_seed` the bed's scatter.
    `duct` and `drawn` are public for reading; `duct` is another object after a choice of organ,
    preset or bed.
    """

    def __init__(
        self,
        organ: Organ,
        preset: Preset | None = None,
        bed: BedPreset | None = None,
        *,
        bed_seed: int = 1,
        vertices: int = VERTICES,
        seed: int = 1,
    ) -> None:
        self._lock = RLock()
        self.drawn = DrawnDuct(organ, vertices, seed)
        self._organ = organ
        self._torn_ticks, self._when_torn = 0, np.empty((0, 3, 4))
        self._start(preset or default_preset(organ), bed or bed_named("normal"), bed_seed)

    # What the trainee does.

    def choose_instrument(self, hand: int, instrument: Instrument) -> None:
        """Give a hand another instrument; what it held it lets go."""
        with self._lock:
            if 0 <= hand < HANDS and instrument in INSTRUMENTS:
                self.duct.choose_instrument(hand, instrument)

    def grab(self, hand: int, station: float) -> NDArray[np.float64] | None:
        """Take hold at a station, mm from the first clamp; return the place, or None."""
        # None where a hand cannot hold: at a clamp, on the other hand's hook, once the duct is
        # torn, and with an instrument that does not hold.
        with self._lock:
            if not np.isfinite(station):
                return None
            return self.duct.grab(hand, min(max(float(station), 0.0), self._span))

    def move_hand(self, hand: int, place: NDArray[np.float64]) -> None:
        """Lead a hand's tip to a place, (3,) mm."""
        with self._lock:
            wanted = np.asarray(place, dtype=np.float64)
            if wanted.shape == (3,) and np.all(np.isfinite(wanted)):
                self.duct.move_hand(hand, np.clip(wanted, *self._reach))

    def release(self, hand: int) -> None:
        """Let go of the duct."""
        with self._lock:
            self.duct.release(hand)

    def open_jaws(self, hand: int, opening: float) -> None:
        """Open or close a dissector, mm between its jaws."""
        with self._lock:
            if np.isfinite(opening):
                self.duct.open_jaws(hand, float(opening))

    def reset(self) -> None:
        """Make the duct and its bed whole."""
        with self._lock:
            torn = self.duct.torn is not None
            self.duct.reset()
            self._torn_ticks = 0
            if torn:
                self.drawn.show_whole()
            self._draw()

    def choose_bed(self, bed: BedPreset | str, seed: int = 1) -> None:
        """Start anew in another bed."""
        chosen = bed_named(bed) if isinstance(bed, str) else bed
        with self._lock:
            self._start(self.duct.dissection.preset, chosen, seed)

    def choose_preset(self, preset: Preset) -> None:
        """Start anew with another duct in the same bed."""
        with self._lock:
            self._start(preset, self.duct.bed, self.duct.seed)

    # Time and readings.

    def advance(self, ticks: int = 1) -> bool:
        """Advance by some ticks and draw; return whether anything has moved."""
        with self._lock:
            duct, changed = self.duct, False
            for _ in range(ticks):
                whole = duct.torn is None
                changed |= duct.advance()
                if duct.torn is not None:
                    if whole:
                        self._when_torn = self.drawn.transforms.copy()
                        self.drawn.show_pieces(duct.torn)
                    if self._torn_ticks * TICK_SECONDS < SETTLED_SECONDS:
                        self._torn_ticks += 1
                        changed = True
            if changed:
                self._draw()
            return changed

    def reading(self) -> BedReading:
        """Return what the instruments show now."""
        with self._lock:
            return self.duct.reading()

    @property
    def _span(self) -> float:
        return self.duct.dissection.beam.span

    def _start(self, preset: Preset, bed: BedPreset, bed_seed: int) -> None:
        """Start anew on a whole duct."""
        self.duct = BeddedDuct(Dissection.of(self._organ, preset), bed, seed=bed_seed)
        self._reach = (
            np.array([-REACH, -REACH, -REACH]),
            np.array([self._span + REACH, REACH, REACH]),
        )
        self._torn_ticks = 0
        self.drawn.follow(self.duct.dissection)

    def _draw(self) -> None:
        if self.duct.torn is None:
            self.drawn.draw_moved(self.duct.move)
            return
        # The beam is in its new equilibrium at once; the pieces are drawn swinging to it.
        elapsed = self._torn_ticks * TICK_SECONDS
        swing = tear_swing(elapsed)

        def move(out: NDArray[np.float64], piece: int | None) -> None:
            self.duct.move(out, piece)
            out += swing * (self._when_torn - out)

        self.drawn.draw_moved(move)
        self.drawn.open_tear(tear_front(elapsed))
