"""Pages that play a run at an anatomy as its scope's camera saw it, without a server."""

import numpy as np

from app.anatomy import anatomy_network, tube_title
from app.simulation import TICK_SECONDS, Replay, Session
from app.trainer.pages.html_player import ASPECT, END_SECONDS, REST_SECONDS
from app.trainer.scope.drawn_tissue import draw_tissue, picture_of
from app.trainer.scope.held_scope import HOME, HeldScope
from app.trainer.viser_bridge.recording import recording_page, unseen_server, write_caption

NOTES = (
    "Each tube is a beam, each strand a spring that parts. What tears and bleeds is computed; "
    "where blood runs, fat, liver and duodenum are drawn.",
)


def scope_page(replay: Replay, *, frames: int) -> str:
    """Return a page that plays a run at an anatomy in so many keys, through its scope.

    Parameters
    ----------
    replay
        The run.
    frames
        Moments at which it is shown.

    Returns
    -------
    str
        HTML with all that it needs.

    Raises
    ------
    ValueError
        If the run is of another tissue.
    """
    session = replay.session
    anatomy = session.specimen.anatomy
    if anatomy is None:
        raise ValueError("only a run at an anatomy was seen through a scope")
    made = anatomy_network(anatomy)
    held = HeldScope(made)
    ticks = np.unique(np.rint(np.linspace(0.0, replay.ticks, frames)).astype(int)).tolist()
    with unseen_server() as server:
        picture = picture_of(server.scene, made, session.spatial, held.scope)
        draw_tissue(picture, session.spatial, held)
        record = server.get_scene_serializer()
        at, written = 0, ""
        for tick in ticks:
            record.insert_sleep(REST_SECONDS if tick == 0 else (tick - at) * TICK_SECONDS)
            replay.seek_tick(tick)
            follow(held, session, tick - at)
            at = tick
            draw_tissue(picture, session.spatial, held)
            if (words := _caption(session, at)) != written:
                written = words
                write_caption(server, words)
        record.insert_sleep(END_SECONDS)
        html = record.as_html(dark_mode=True)
    title = f"Calot's triangle, anatomy {made.anatomy.name}"
    return recording_page(html, title, NOTES, distance=HOME, aspect=ASPECT)


def follow(held: HeldScope, session: Session, ticks: int) -> None:
    """Hold a scope as a run did after some ticks more, or let the assistant follow its tips."""
    tissue = session.spatial
    if not held.show(tissue.pose):
        for _ in range(ticks):
            held.advance([hand.place for hand in tissue.hands])


def _caption(session: Session, tick: int) -> str:
    """Return what the page says of a moment."""
    tissue = session.spatial
    torn = [each.tube for each in tissue.events if each.kind == "tear"]
    lost = sum(each.lost_ml for each in session.reading().fluids)
    words = [f"{tick * TICK_SECONDS:.0f} s", f"{session.reading().broken} strands broken"]
    words += [f"torn: {', '.join(map(tube_title, torn))}"] * bool(torn)
    words += [f"{lost:.1f} ml lost"] * (lost >= 0.05)
    return "   ".join(words)
