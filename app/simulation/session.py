"""A session: one trainee's duct, its inputs, its state and its steps in time. No viewer in it."""

import numpy as np
from numpy.typing import NDArray

from app.simulation.ghost import GhostReading
from app.simulation.grasped_duct import Load
from app.simulation.measures import Measures
from app.simulation.reading import Phase, Reading, Surface
from app.simulation.run import Run
from app.simulation.run_log import OrganIdentity, RunFile
from app.simulation.session_choices import ChosenSession
from app.simulation.session_state import VERTICES

__all__ = ["VERTICES", "Phase", "Reading", "Session", "Surface"]


class Session(ChosenSession):
    """One duct under one grasper, stepped in time. Safe to call from several threads.

    Inputs out of range are clamped to it and inputs that are no number are ignored: they come
    from a browser. Steps and readings happen whether or not anybody looks. Time goes in ticks of
    `TICK_SECONDS`; what happens is a function of the inputs and the ticks they come at, to the bit.

    Parameters
    ----------
    organ
        The organ.
    preset
        The preset to start with; `default_preset` when None.
    vertices
        About how many vertices the skin shall have.
    seed
        Chooses the raggedness of the torn rim.
    """

    def step(self, seconds: float) -> bool:
        """Advance the duct by as many ticks as real time asks for, and draw it."""
        with self._lock:
            return self.advance(self._clock.ticks(seconds)) or self._pulled.moving

    def advance(self, ticks: int = 1) -> bool:
        """Advance the duct by a number of ticks, and draw it as it is then."""
        with self._lock:
            changed = False
            for _ in range(ticks):
                changed |= self._tick()
            if changed:
                self._drawn.draw(self._pulled)
                if self.ghost is not None:
                    self.ghost.draw()
            return changed

    def reading(self) -> Reading:
        """Return what the instruments show now."""
        with self._lock:
            return self._pulled.reading()

    def ghost_reading(self) -> GhostReading | None:
        """Return what the ghost's theory says beside this one."""
        with self._lock:
            if self.ghost is None:
                return None
            control, grasped = self._pulled.control, self._pulled.grasped
            return self.ghost.reading(control.grip_force, grasped.pulled.deflection)

    def stress(self, out: NDArray[np.float32], surface: int = 0) -> NDArray[np.float32]:
        """Write the stress along the organ at each vertex of a surface."""
        with self._lock:
            return self._drawn.write_stress(self._pulled, surface, out)

    def curve(self, count: int = 80) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the chosen theory's force-deflection curve, past the break and past this pull."""
        with self._lock:
            duct, deepest = self._pulled.grasped, self._pulled.deepest
        return duct.curve(count, deepest=deepest)

    def measures(self) -> Measures:
        """Return the measures of this run so far."""
        with self._lock:
            return self._run.measures()

    def run_file(self) -> RunFile:
        """Return this run so far, to keep, download and replay."""
        with self._lock:
            return self._file(self._run)

    def last_run_file(self) -> RunFile | None:
        """Return the run before this one: a reset does not take its result away."""
        with self._lock:
            return None if self._last_run is None else self._file(self._last_run)

    def earlier_tries(self, run: RunFile) -> list[RunFile]:
        """Return this session's judged runs of one exercise from the same start, oldest first."""
        with self._lock:
            tries = [self._file(each) for each in self._tries if each.exercise == run.log.exercise]
        return [each for each in tries if each.log.start == run.log.start and each != run]

    def _tick(self) -> bool:
        """Advance by one tick without drawing."""
        pulled, was_whole = self._pulled, self._pulled.tear is None
        place = pulled.grasped.grasp
        changed = pulled.tick()
        if not was_whole:
            return changed
        control, grasped, tear = pulled.control, pulled.grasped, pulled.tear
        if grasped.grasp != place:
            self._run.regrasp()
        if self._ghost is not None and changed:
            self._ghost.follow(grasped.grasp, control.load)
        if self._chain is not None:
            if self._chain.grasp != grasped.grasp:
                self._chain = self._new_chain()
            free = control.mode == "free"
            changed |= self._chain.advance(Load("force", 0.0) if free else control.load)
        if self._run.going:
            self._run.take(
                control.grip_force if tear is None else tear.event.force,
                grasped.pulled.deflection,
                grasped.hook(),
                grasped.check.distance_to_break,
                came_from=pulled.came_from,
                held=control.holds,
                torn=None if tear is None else tear.event,
            )
        if tear is not None:
            self._drawn.show(tear.surfaces)
        return changed

    def _file(self, run: Run) -> RunFile:
        log = run.log(OrganIdentity.of(self._organ), self._seed)
        return RunFile.of(log, run.measures(), run.outcome)
