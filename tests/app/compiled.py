"""Run as a program: what a trainee's page compiles although the trainer has warmed up."""

import sys

import numpy as np
import viser
from numba.core.dispatcher import Dispatcher
from simulated import bed_session, phantom, pull_session, settle, tear

from app.simulation import INSTRUMENTS, Session, exercises_offered
from app.trainer.panel.compare_tab import OFFERED_THEORIES
from app.trainer.server.warm_up import WarmUp, warm_session
from app.trainer.stage.appearance import appearance_of
from app.trainer.stage.contact import Contact, HookPlace
from app.trainer.stage.tissue import Tissue
from physics import Exact


def signatures() -> dict[str, set[str]]:
    """What each kernel of ours is compiled for in this process."""
    kernels = [
        each
        for name, module in list(sys.modules.items())
        if name.split(".")[0] in {"app", "organ_geometry", "physics"}
        for each in vars(module).values()
        if isinstance(each, Dispatcher)
    ]
    return {
        f"{each.py_func.__module__}.{each.py_func.__qualname__}": set(map(str, each.signatures))
        for each in kernels
    }


def draw(scene: viser.SceneApi, session: Session) -> None:
    """Draw a session's surfaces as tissue and as stress."""
    dissection = session.tissue.dissection
    organ, radius = dissection.organ, dissection.organ.mean_radius
    for index, surface in enumerate(session.drawn.surfaces):
        skin = surface.skin
        axis = organ.axis_at(skin.stations)
        contact = Contact(skin, axis, dissection.frame, dissection.clamps, radius)
        hook = HookPlace(dissection.axis_point(20.0), dissection.frame, radius)
        contact.mark(surface.vertices, None if len(session.drawn.surfaces) > 1 else hook)
        torn = (None, "last", "first")[0 if len(session.drawn.surfaces) == 1 else index + 1]
        look = appearance_of(dissection.preset)
        tissue = Tissue(scene, f"/{surface.name}", contact, look=look, radius=radius, torn_end=torn)
        tissue.show(contact.vertices, contact.shade)
        stress = session.stress(np.empty(len(surface.vertices), np.float32), index)
        tissue.show_stress(contact.vertices, stress)


def train(scene: viser.SceneApi, session: Session) -> None:
    """Do what a trainee can."""
    session.show_chain(True)
    exercises_offered(session)
    session.grab(0, 20.0)
    session.lift(0.2 * session.planar.deflection_limit)
    settle(session)
    draw(scene, session)
    session.release()
    settle(session)
    session.set_grasp(12.0)
    session.set_threshold(0.9 * session.tissue.threshold)
    session.set_target_force(0.3 * session.planar.force_limit)
    settle(session)
    session.reading()
    session.ghost_reading()
    session.curve()
    tear(session)
    draw(scene, session)


def dissect(session: Session) -> None:
    """Do what a trainee can with a duct in its bed, until it is torn."""
    for instrument in INSTRUMENTS:
        session.choose_instrument(1, instrument)
        session.grab(1, 12.0)
        session.open_jaws(1, 3.0)
        session.move_hand(1, session.spatial.hands[1].place + np.array([0.0, 2.0, 0.5]))
        session.advance(5)
        session.release(1)
    session.choose_bed("firm", 2)
    session.grab(0, 25.0)
    while session.spatial.torn is None:
        session.move_hand(0, session.spatial.hands[0].place + np.array([0.0, 0.5, 5.0]))
        session.advance()
        session.reading()
    session.advance(30)
    session.reset()
    session.advance()


def report(before: dict[str, set[str]], when: str) -> None:
    """Print what is compiled now and was not before."""
    for name, now in signatures().items():
        for signature in now - before.get(name, set()):
            print(f"compiled {when}: {name}{signature}")


def main() -> None:
    """Warm up, train, and print what was compiled after all."""
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    organ = phantom()
    warm_session(organ)
    before = signatures()
    session = pull_session(organ)
    train(server.scene, session)
    report(before, "before the other theories")
    WarmUp(organ, None, "full").done.wait()
    before = signatures()
    dissect(bed_session(organ))
    report(before, "in a bed")
    for theory in OFFERED_THEORIES.values():
        session = pull_session(organ)
        session.choose_theory(theory)
        session.choose_ghost(Exact())
        train(server.scene, session)
    report(before, "after all theories")
    server.stop()
    print("done")


if __name__ == "__main__":
    main()
