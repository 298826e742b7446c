"""Compilation done ahead: nothing is compiled in a tick, and little while somebody waits.

What any page can ask for without choosing another theory is ready before the first page is served.
The other theories take half a minute on a first start; they follow in a thread of their own, and
who chooses one meanwhile is told to wait. Later starts load all of it from numba's cache.
"""

import threading

import numpy as np

from app.simulation.preset import DEFAULT_PRESET, preset_named
from app.simulation.session import Session
from app.trainer.panel.compare_tab import OFFERED_THEORIES
from app.trainer.stage.bed_shadow import BANDS, lay_shadow
from app.trainer.stage.contact import Contact, HookPlace
from app.trainer.stage.heat_map import heat_colors
from app.trainer.stage.tissue import raise_wall
from app.trainer.stage.tissue_bed import bed_surface
from app.trainer.stage.underlay import sink_wall
from app.trainer.stage.vessels import Vessels, pose_vessels
from app.trainer.stage.wall import Wall, wall_normals
from organ_geometry.organ import Organ
from physics import Cubic

__all__ = ["TheoryWarming", "warm_session"]


def warm_session(organ: Organ) -> None:
    """Compile or load what a session and its drawing need by the theory that it starts with.

    Parameters
    ----------
    organ
        The organ that is trained on.
    """
    _warm_drawing(Session(organ))
    session = Session(organ)
    session.choose_ghost(Cubic())
    session.show_chain(True)
    session.grab(session.grasp)
    session.hand_to(0.5 * session.deflection_limit)
    session.advance(5)
    _write_stress(session)
    session.let_go()
    session.advance(5)
    session.set_force(session.force_limit)
    while session.advance():
        pass
    _write_stress(session)
    session.reading()


class TheoryWarming:
    """A thread that compiles or loads the theories that the panel offers, and then ends.

    Attributes
    ----------
    done
        Set when all of them are ready.
    """

    def __init__(self) -> None:
        self.done = threading.Event()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="warming", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread after the theory that it is at; nobody waits for it."""
        self._stopping = True

    def _run(self) -> None:
        beam = preset_named(DEFAULT_PRESET).round_beam()
        middle = 0.5 * beam.span
        for theory in OFFERED_THEORIES.values():
            for grasp in (middle, 0.8 * middle):
                if self._stopping:
                    return
                theory.under_force(beam, grasp, 1.0, np.array([grasp]))
                theory.under_deflection(beam, grasp, 1.0, np.array([grasp]))
        self.done.set()


def _write_stress(session: Session) -> None:
    for index, surface in enumerate(session.surfaces):
        session.stress(np.empty(len(surface.vertices), np.float32), index)


def _warm_drawing(session: Session) -> None:
    dissection, skin = session.dissection, session.surfaces[0].skin
    organ, radius = dissection.organ, dissection.organ.mean_radius
    axis = organ.axis_at(skin.stations)
    contact = Contact(skin, axis, dissection.frame, dissection.clamps, radius)
    middle = dissection.axis_point(0.5 * dissection.beam.span)
    contact.mark(session.surfaces[0].vertices, HookPlace(middle, dissection.frame, radius))
    wall, vessels = Wall.of(skin), Vessels.of(Wall.of(skin), organ.length, radius)
    normals, raised, colors = np.empty((3, wall.count, 3), np.float32)
    wall_normals(contact.vertices, wall.rings, wall.sides, wall.right_handed, normals)
    raise_wall(contact.vertices, normals, np.zeros(wall.count, np.float32), raised)
    sink_wall(raised, normals, colors)
    count = len(vessels.ring)
    pose_vessels(
        raised, normals, contact.shade, wall.sides, vessels.ring, vessels.side, vessels.between,
        vessels.lift, np.empty((count, 3), np.float32), np.empty(count, np.float32),
    )  # fmt: skip
    heat_colors(contact.shade, normals, dissection.frame[:, 2].copy(), colors)
    lay_shadow(
        axis[:2].copy(), np.full(3, 100.0), np.zeros(3), 1.0, radius, *bed_surface(),
        np.empty((len(BANDS), 2, 2, 3), np.float32),
    )  # fmt: skip
