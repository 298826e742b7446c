"""Take pictures of a duct in its bed at stages of a dissection, without the page around it.

`python tests/app/dissections.py FOLDER [NAME ...]` needs Chromium, as the browser tests do.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import viser
from browser import close_browser, new_context, running_browser
from simulated import bed_exercises, bed_session, phantom

from app.simulation import Session
from app.simulation.scripts.scripted_hands import Follow
from app.trainer.scene.tissue_scene import Colours, TissueScene
from app.trainer.stage.lighting import Look

PICTURE_ONLY = """new MutationObserver(() => {
    for (const each of document.querySelectorAll('[class*=Notification], [class*=Paper-root]'))
        each.style.display = 'none';
}).observe(document, {childList: true, subtree: true});"""
"""Hides the panel and notes over the picture."""
UP = np.array([0.0, 0.0, 1.0])


def lead(session: Session, hand: int, direction: np.ndarray, seconds: float) -> None:
    """Lead a hand along a way, mm, at an even speed."""
    start, ticks = session.spatial.hands[hand].place.copy(), max(1, round(30 * seconds))
    for tick in range(1, ticks + 1):
        session.move_hand(hand, start + np.asarray(direction, float) * tick / ticks)
        session.advance()
    for _ in range(12):
        session.advance()


def rest(session: Session) -> None:
    """As it lies."""


def lifted(session: Session) -> None:
    """A hook in the middle, half way to the break: strands are taut, some have parted."""
    session.grab(0, 25.4)
    lead(session, 0, 6.0 * UP, 1.0)


def half_freed(session: Session) -> None:
    """The middle third has come free."""
    session.grab(0, 25.4)
    lead(session, 0, 10.0 * UP, 1.5)


def spread(session: Session) -> None:
    """A dissector behind the duct, opened; the second hand's grasper holds the duct up."""
    session.grab(1, 17.0)
    lead(session, 1, 3.0 * UP, 0.5)
    session.choose_instrument(0, "dissector")
    session.move_hand(0, session.spatial.hands[0].place + np.array([4.0, 0.0, 0.0]))
    for _ in range(20):
        session.advance()
    lead(session, 0, np.array([0.0, 24.0, 0.0]), 1.5)
    session.open_jaws(0, 9.0)
    for _ in range(40):
        session.advance()


def swept(session: Session) -> None:
    """A swab sweeps along the near flank."""
    session.choose_instrument(0, "swab")
    place = session.spatial.hands[0].place
    lead(session, 0, np.array([20.0, -6.5, -5.0]) - place, 1.0)
    lead(session, 0, np.array([14.0, 0.0, 0.0]), 1.0)


def torn(session: Session) -> None:
    """Pulled off in the middle of an inflamed bed."""
    session.choose_bed("inflamed")
    session.grab(0, 25.4)
    lead(session, 0, 14.0 * UP, 1.5)
    for _ in range(60):
        session.advance()


def followed(session: Session) -> None:
    """The end of a divided duct, lifted at the front."""
    session.choose_bed("firm")
    exercise = next(e for e in bed_exercises(session) if e.name == "follow_front")
    session.start_exercise(exercise)
    for _ in zip(range(240), Follow().inputs(session, exercise), strict=False):
        session.advance()


STATES: dict[str, tuple[Callable[[Session], None], Colours]] = {
    "rest": (rest, "tissue"),
    "lifted": (lifted, "tissue"),
    "half_freed": (half_freed, "tissue"),
    "spread": (spread, "tissue"),
    "swept": (swept, "tissue"),
    "torn": (torn, "tissue"),
    "followed": (followed, "tissue"),
    "stress": (half_freed, "stress"),
    "freed": (half_freed, "freed"),
}


def main(folder: Path, names: list[str], look: Look = "full") -> None:
    """Take a picture of each state."""
    folder.mkdir(parents=True, exist_ok=True)
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    server.gui.configure_theme(dark_mode=True)
    connected: list[viser.ClientHandle] = []
    server.on_client_connect(connected.append)
    try:
        with running_browser(drawing=True) as browser:
            page = new_context(browser, 960, 640).new_page()
            page.on("pageerror", lambda error: print("PAGE ERROR", error))
            page.on("console", lambda m: print("CONSOLE", m.text) if m.type == "error" else None)
            page.add_init_script(PICTURE_ONLY)
            page.goto(f"http://127.0.0.1:{server.get_port()}/?fixedDpr=1")
            while not connected:
                page.wait_for_timeout(100)
            session = bed_session(phantom())
            scene = TissueScene(connected[0], session, look)
            for name in names or list(STATES):
                act, colours = STATES[name]
                session.choose_bed("normal")
                for hand, instrument in enumerate(("hook", "grasper")):
                    session.choose_instrument(hand, instrument)
                act(session)
                scene.draw(session.reading(), colours)
                last = b""
                for _ in range(12):
                    page.wait_for_timeout(1000)
                    now = page.screenshot(timeout=180_000)
                    if now == last:
                        break
                    last = now
                (folder / f"{name}.png").write_bytes(last)
                print(name, session.reading(), flush=True)
    finally:
        close_browser()
        server.stop()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
