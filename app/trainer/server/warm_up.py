"""Warm-up: kernels are compiled and static meshes made before they are needed.

A thread compiles what the scene that pages open on needs, then makes the static meshes, and then
compiles what the other scenes and the other theories need. This takes a minute on a first start,
and a client that is faster is told to wait. Later starts load all from numba's cache.
"""

import threading

import numpy as np
import viser

from app.anatomy import anatomy_named
from app.simulation import (
    THESIS_PRESET,
    Dissection,
    Preset,
    Session,
    Specimen,
    default_preset,
    free_specimen,
    preset_named,
    specimen_in_bed,
)
from app.trainer.client.practice import SCENES, SceneName
from app.trainer.panel.compare_tab import OFFERED_THEORIES
from app.trainer.scope.packing import Frame, Packing
from app.trainer.scope.pose import Pose
from app.trainer.stage.appearance import appearance_of, drawn_radius
from app.trainer.stage.contact import Contact, HookPlace
from app.trainer.stage.lighting import Look
from app.trainer.stage.stage import stage_files
from app.trainer.stage.strands import differ, write_strands
from app.trainer.stage.wall_texture import wall_texture
from app.trainer.viser_bridge.private_api import read_icons
from organ_geometry import Organ
from physics import Cubic, break_of

# mm by which a duct is lifted that is to tear.
MOST_LIFT = 40.0

ICONS = (
    viser.Icon.ARROW_BACK_UP,
    viser.Icon.ARROW_LEFT,
    viser.Icon.CAMERA,
    viser.Icon.DEVICE_FLOPPY,
    viser.Icon.DOWNLOAD,
    viser.Icon.HAND_GRAB,
    viser.Icon.HAND_MOVE,
    viser.Icon.HELP,
    viser.Icon.MAXIMIZE,
    viser.Icon.PLAYER_PAUSE,
    viser.Icon.PLAYER_PLAY,
    viser.Icon.PLAYER_STOP,
    viser.Icon.REFRESH,
    viser.Icon.REPORT_ANALYTICS,
    viser.Icon.SCHOOL,
    viser.Icon.STACK_2,
    viser.Icon.TABLE_EXPORT,
    viser.Icon.UPLOAD,
    viser.Icon.X,
)
"""The icons of the panel."""


def warm_session(organ: Organ, preset: Preset | None = None) -> None:
    """Compile, or load, what a session and its drawing need of the theory that it starts with."""
    _warm_drawing(Session(free_specimen(organ, preset)))
    session = Session(free_specimen(organ, preset))
    session.choose_ghost(Cubic())
    session.show_chain(True)
    session.grab(0, session.planar.grasp)
    session.lift(0.5 * session.planar.deflection_limit)
    session.advance(5)
    _write_stress(session)
    session.release()
    session.advance(5)
    session.set_target_force(session.planar.force_limit)
    while session.advance():
        pass
    _write_stress(session)
    session.reading()


def warm_bed(organ: Organ, preset: Preset | None = None) -> None:
    """Compile, or load, what a session in a bed and its drawing need, until the duct is torn."""
    session = Session(specimen_in_bed(organ, preset))
    contact = _warm_drawing(session)
    session.grab(0, 0.5 * session.tissue.dissection.beam.span)
    session.choose_instrument(1, "dissector")
    session.open_jaws(1, 1.0)
    session.move_hand(0, session.spatial.hands[0].place + np.array([0.0, 1.0, 2.0]))
    session.advance(5)
    _write_stress(session)
    duct = session.spatial
    duct.freed_at(session.drawn.skin.stations)
    contact.press_rods(duct.beam.state.rods, duct.dissection.axis_point(0.0))
    write_strands(duct.beam)
    session.reading()
    while session.spatial.torn is None and session.spatial.hands[0].place[2] < MOST_LIFT:
        session.move_hand(0, session.spatial.hands[0].place + np.array([0.0, 0.0, 5.0]))
        session.advance()
    session.advance(3)
    _write_stress(session)


def warm_anatomy() -> None:
    """Compile, or load, what an anatomy and its picture need, until a tube has torn and bleeds."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")))
    packing = Packing(session.spatial.beam)
    session.choose_instrument(1, "dissector")
    session.open_jaws(1, 1.0)
    artery = session.spatial.tubes.names.index("artery")
    session.grab(0, 10.0, artery)
    while not session.spatial.events and session.spatial.hands[0].place[2] < MOST_LIFT:
        session.move_hand(0, session.spatial.hands[0].place + np.array([0.0, 0.0, 2.0]))
        session.advance()
    session.advance(3)
    packing.write(session.spatial.beam, Frame(Pose()), 0.0)
    session.reading()


class WarmUp:
    """A thread that makes ready what clients need, and then ends.

    `scene` is made ready first. `done` is set when all is ready.
    """

    def __init__(
        self, organ: Organ, preset: Preset | None, look: Look, scene: SceneName = "bed"
    ) -> None:
        self.done = threading.Event()
        self._organ, self._preset = organ, preset
        self._scene: SceneName = scene
        self._look: Look = look
        self._ready = {each: threading.Event() for each in SCENES}
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="warm-up", daemon=True)
        self._thread.start()

    def wait(self, scene: SceneName) -> None:
        """Wait until a scene is ready."""
        self._ready[scene].wait()

    def stop(self) -> None:
        """End the thread after what it is compiling, without waiting for it."""
        self._stopping = True
        for ready in self._ready.values():
            ready.set()

    def _run(self) -> None:
        try:
            read_icons(ICONS)  # which else the first page would wait for
            self._warm(self._scene)
            self._make_static()
            if not self._stopping:
                for scene in SCENES.keys() - {self._scene}:
                    self._warm(scene)
        finally:  # after a fault a client meets it where it can be told
            for ready in self._ready.values():
                ready.set()
        self._warm_theories()

    def _warm(self, scene: SceneName) -> None:
        """Compile what a scene needs."""
        if scene == "calot":
            warm_anatomy()
        else:
            (warm_session if scene == "free" else warm_bed)(self._organ, self._preset)
        self._ready[scene].set()

    def _make_static(self) -> None:
        """Make the meshes and textures of the stage."""
        dissection = Dissection.of(self._organ, self._preset or default_preset(self._organ))
        look, radius = appearance_of(dissection.preset), drawn_radius(dissection)
        stage_files(radius=radius, look=self._look, appearance=look)
        if self._look == "full":
            wall_texture(look, radius)

    def _warm_theories(self) -> None:
        beam = preset_named(THESIS_PRESET).round_beam()
        middle = 0.5 * beam.span
        for theory in OFFERED_THEORIES.values():
            for grasp in (middle, 0.8 * middle):
                if self._stopping:
                    return
                theory.pull(beam, grasp).to_force(1.0).sample(np.array([grasp]))
                theory.pull(beam, grasp).to_deflection(1.0).sample(np.array([grasp]))
                break_of(theory.pull(beam, grasp), 1.0)
        self.done.set()


def _write_stress(session: Session) -> None:
    for index, surface in enumerate(session.drawn.surfaces):
        session.stress(np.empty(len(surface.vertices), np.float32), index)


def _warm_drawing(session: Session) -> Contact:
    dissection, skin = session.tissue.dissection, session.drawn.surfaces[0].skin
    contact = Contact.of(dissection, skin)
    middle = dissection.axis_point(0.5 * dissection.beam.span)
    place = HookPlace(middle, dissection.frame, drawn_radius(dissection))
    contact.mark(session.drawn.surfaces[0].vertices, place)
    differ(contact.vertices[0], contact.vertices[0], 1.0)
    return contact
