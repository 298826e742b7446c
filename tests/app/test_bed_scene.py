"""The scene of a dissection: strands, stubs, instruments and colours are those of the physics."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from queue import Queue
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import viser
from browser import new_context
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page
from program import LONGEST
from simulated import bed_exercises, bed_session, phantom

from app.simulation import Exercise, FreeLength, Instrument, Opening, Session, preset_named
from app.trainer.scene.goal_band import GoalStretch
from app.trainer.scene.tissue_scene import TissueScene
from app.trainer.scope.picture import PAGE
from app.trainer.stage.strands import NUMBERS, PARTED, ROD_NUMBERS
from app.trainer.viser_bridge.page import file_text
from physics.bed import kernels

UP = np.array([0.0, 0.0, 1.0])


def lift(session: Session, height: float) -> None:
    """Lift the duct in the middle by the first hand's hook."""
    session.grab(0, 25.4)
    start = session.spatial.hands[0].place.copy()
    for tick in range(1, 46):
        session.move_hand(0, start + height * min(1.0, tick / 30) * UP)
        session.advance()


def put(session: Session, instrument: Instrument, place: np.ndarray, opening: float) -> None:
    """Lead an instrument of the first hand somewhere."""
    session.choose_instrument(0, instrument)
    session.move_hand(0, place)
    session.open_jaws(0, opening)
    for _ in range(90):
        session.advance()


@pytest.fixture
def session() -> Session:
    return bed_session(phantom(), vertices=600)


@pytest.fixture
def client(scene: viser.SceneApi) -> viser.ClientHandle:
    """A client without a page: what the scene asks of one."""
    camera = SimpleNamespace(
        aspect=1.5, position=np.zeros(3), look_at=np.zeros(3), on_update=lambda _: None
    )
    found = SimpleNamespace(scene=scene, gui=scene, camera=camera, atomic=nullcontext)
    return cast("viser.ClientHandle", found)


@pytest.fixture
def sent(scene: viser.SceneApi, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Every message that is sent to the page."""
    messages: list[Any] = []
    interface = scene._websock_interface
    queue: Callable[[Any], None] = interface.queue_message

    def keep(message: Any) -> None:
        messages.append(message)
        queue(message)

    monkeypatch.setattr(interface, "queue_message", keep)
    return messages


def drawn_rows(drawn: TissueScene, count: int) -> NDArray[np.float32]:
    """Return what was sent last of each strand."""
    assert drawn._strands is not None
    header = ROD_NUMBERS * len(drawn._session.spatial.beam.state.rods)
    return drawn._strands._sent.reshape(-1)[header : header + NUMBERS * count].reshape(-1, NUMBERS)


def test_strands_are_drawn_where_they_hold_and_as_many_as_are_whole(
    client: viser.ClientHandle, session: Session
) -> None:
    drawn = TissueScene(client, session, "plain")
    lift(session, 6.0)
    reading, beam = session.reading(), session.spatial.beam
    drawn.draw(reading)
    assert 0 < reading.broken < reading.strands
    assert drawn._strands is not None
    rows = drawn_rows(drawn, reading.strands)
    assert np.count_nonzero(rows[:, 3] > PARTED) == reading.strands - reading.broken
    # On the skin, which is near to the beam's surface.
    aside = drawn._strands._aside
    assert np.abs(aside).max() < 0.4
    np.testing.assert_allclose(rows[:, :3], beam.strand_ends()[beam.order] + aside, atol=1e-5)
    np.testing.assert_array_equal(rows[:, 3] == PARTED, beam.state.damage >= 1.0)
    # What is half way to its parting is drawn half as taut as can be.
    whole = rows[:, 3] != PARTED
    feet = beam.state.strand[kernels.FOOT_X : kernels.FOOT_Z + 1].T
    length = np.linalg.norm(beam.strand_ends()[beam.order] - feet, axis=1)
    past = length - beam.state.strand[kernels.LENGTH]
    taut = whole & (past > 0.0)
    assert taut.sum() > 20
    np.testing.assert_allclose(
        rows[taut, 3], (past / beam.state.strand[kernels.FAILURE])[taut], atol=1e-4
    )
    assert (rows[whole & (past <= 0.0), 3] <= 0.0).all()


@pytest.mark.parametrize("instrument", ["hook", "grasper", "dissector", "swab"])
def test_instruments_are_where_the_hands_have_them(
    client: viser.ClientHandle, session: Session, instrument: Instrument
) -> None:
    drawn = TissueScene(client, session, "plain")
    put(session, instrument, np.array([20.0, -9.0, 7.0]), 6.0)
    drawn.draw(session.reading())
    shown = drawn._instruments[0]
    assert shown is not None
    assert shown.instrument == instrument
    hand = session.spatial.hands[0]
    np.testing.assert_allclose(shown._node.position, hand.place)
    np.testing.assert_allclose(hand.place, [20.0, -9.0, 7.0])
    # Its shaft leads aside, not at the viewer, who would see nothing else.
    lengths = np.linalg.norm(shown.grip.vertices, axis=1)
    assert shown.grip.vertices[lengths.argmax(), 0] > 0.3 * lengths.max()


def test_a_dissectors_jaws_lie_along_its_rods(client: viser.ClientHandle, session: Session) -> None:
    drawn = TissueScene(client, session, "plain")
    put(session, "dissector", np.array([20.0, -14.0, -6.0]), 8.0)
    drawn.draw(session.reading())
    shown = drawn._instruments[0]
    assert shown is not None
    assert shown._jaws is not None
    for number, mesh in enumerate(shown._jaws._meshes):
        rod = session.spatial.beam.state.rods[number]
        vertices = shown._node.position + mesh.vertices
        back = (vertices - rod[:3]) @ rod[3:6]
        working = (back > 3.2) & (back < 12.0)
        assert working.sum() > 30
        out = vertices[working] - rod[:3] - back[working, None] * rod[3:6]
        np.testing.assert_allclose(np.linalg.norm(out, axis=1), rod[kernels.RADIUS], rtol=0.06)
        assert back.min() == pytest.approx(0.0, abs=0.1)


def test_arrows_are_as_the_forces_and_are_hidden_with_the_figures(
    client: viser.ClientHandle, session: Session
) -> None:
    drawn = TissueScene(client, session, "plain")
    lift(session, 6.0)
    reading = session.reading()
    drawn.draw(reading)
    held, free = drawn._arrows
    assert (held.visible, free.visible) == (True, False)
    arrow, label = held._handles
    foot, tip = arrow.points[0]
    direction, force = tip - foot, session.tissue.dissection.frame @ reading.forces[0]
    np.testing.assert_allclose(
        direction / np.linalg.norm(direction), force / np.linalg.norm(force), atol=1e-5
    )
    # A fifth of the span at the break, in proportion to the stress below it.
    fraction = max(reading.stress_ratio, 0.3)
    assert np.linalg.norm(direction) == pytest.approx(
        0.2 * drawn._set_stage().span * fraction, rel=1e-4
    )
    assert label.text == f"{np.linalg.norm(force):.2f} N"
    drawn.draw(reading, figures=False)
    assert not held.visible


def test_the_stretch_that_an_exercise_is_about_is_marked(
    client: viser.ClientHandle, session: Session
) -> None:
    drawn = TissueScene(client, session, "plain")
    goal = FreeLength(9.0, 20.0, 31.0)
    scar = Exercise("free_scar", "Free a scar", goal, opening=Opening("scar", 1))
    drawn.draw(session.reading())

    def shown() -> GoalStretch | None:
        return drawn._annotations._stretch

    assert shown() is None
    session.start_exercise(scar)
    drawn.draw(session.reading())
    marked = shown()
    assert marked is not None
    lines, _ = marked._handles
    assert (lines.points[..., 0].min(), lines.points[..., 0].max()) == (20.0, 31.0)
    session.finish()
    drawn.draw(session.reading())
    assert shown() is None


def test_nothing_is_sent_when_nothing_changes(
    client: viser.ClientHandle, session: Session, sent: list[Any]
) -> None:
    drawn = TissueScene(client, session, "full")
    lift(session, 4.0)
    drawn.draw(session.reading())
    before = len(sent)
    drawn.draw(session.reading())
    assert len(sent) == before
    session.move_hand(0, session.spatial.hands[0].place + UP)
    for _ in range(10):
        session.advance()
    drawn.draw(session.reading())
    assert len(sent) > before


def test_both_looks_both_colours_and_a_tear_are_drawn_and_removed(
    client: viser.ClientHandle, session: Session, scene: viser.SceneApi
) -> None:
    drawn = TissueScene(client, session, "full")
    session.choose_bed("inflamed")
    lift(session, 16.0)
    assert session.reading().torn_at is not None
    for look in ("full", "plain"):
        drawn.set_look(look)
        for colours in ("tissue", "stress", "freed"):
            drawn.draw(session.reading(), colours)
    assert {surface.surface.name for surface in drawn._drawn} == {"first_piece", "second_piece"}
    session.reset()
    drawn.draw(session.reading())
    assert {surface.surface.name for surface in drawn._drawn} == {"skin"}
    before = drawn._stage
    session.choose_preset(preset_named("human-ureter"))
    drawn.draw(session.reading())
    assert drawn._stage is not before  # it lies in fat
    assert drawn._strands is not None
    strands = session.reading().strands
    assert np.all(drawn_rows(drawn, strands)[:, 3] > PARTED)
    drawn.remove()
    left = [name for name in scene._handle_from_node_name if name.startswith(("/bed/", "/stage"))]
    assert left == []


@contextmanager
def strands_in_page(browser: Browser, session: Session) -> Iterator[Page]:
    """Draw a session in a page of its own, until its strands are at rest there."""
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    context = new_context(browser, 500, 400)
    try:
        connected = Queue[viser.ClientHandle]()
        server.on_client_connect(connected.put)
        page = context.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(f"http://127.0.0.1:{server.get_port()}/?fixedDpr=1")
        client = connected.get(timeout=LONGEST)
        reading = session.reading()
        TissueScene(client, session, "plain").draw(reading)
        ready = f"""() => {{
            const strands = window.bluntdissectStrands?.drawn.get('/bed/strands');
            if (!strands?.given || strands.moving) return false;
            const parted = strands.parted.filter(at => !Number.isNaN(at)).length;
            return parted === {reading.broken};
        }}"""
        page.wait_for_function(ready)
        yield page
        assert not errors, errors
    finally:
        context.close()
        server.stop()


def drawn_middles(page: Page, strands: int) -> NDArray[np.float64]:
    """Return (strands, 8, 3) places along each strand as it is drawn, mm."""
    places = page.evaluate(
        "() => Array.from(window.bluntdissectStrands.drawn.get('/bed/strands').ribbons.position)"
    )
    return np.array(places).reshape(strands, 8, 2, 3).mean(axis=2)


def test_a_page_draws_every_strand_whole_or_as_two_stubs(browser: Browser) -> None:
    """A whole strand runs from foot to duct; a parted one's halves stay near their ends."""
    session = bed_session(phantom(), vertices=600)
    lift(session, 7.0)
    with strands_in_page(browser, session) as page:
        middles = drawn_middles(page, session.reading().strands)
        colours = page.evaluate(
            "() => Array.from(window.bluntdissectStrands.drawn.get('/bed/strands').ribbons.color)"
        )
        # In their first picture, too, films are where the threads are: the page may rest after it.
        moved, together = page.evaluate(
            """() => {
                const old = window.bluntdissectStrands.drawn.get('/bed/strands');
                const { source, bed } = old, made = new old.constructor(source, bed);
                made.update(0, window.__viserMutable.cameraControl.camera);
                const [films, threads] = [made.films, made.ribbons].map(
                    each => each.mesh.matrixWorld.toArray());
                made.remove();
                return [source.matrixWorld.toArray().some((x, k) => x !== (k % 5 ? 0 : 1)),
                    films.every((x, k) => x === threads[k])];
            }"""
        )
        assert moved
        assert together
    # They have the colours that threads have through the scope: between its slack and its taut one.
    slack, taut = np.array(
        re.findall(r"vec3\(([\d.]+), ([\d.]+), ([\d.]+)\)", file_text(PAGE / "thread.frag.glsl"))[
            :2
        ],
        dtype=np.float64,
    )
    shares = (np.array(colours).reshape(-1, 4)[:, :3] - slack) / (taut - slack)
    np.testing.assert_allclose(shares, shares[:, :1].repeat(3, axis=1), atol=1e-6)
    assert shares.min() == pytest.approx(0.0, abs=1e-6)
    assert 0.5 < shares.max() <= 1.0 + 1e-6
    state = session.spatial.beam.state
    ends = session.spatial.beam.strand_ends()[session.spatial.beam.order]
    feet = state.strand[kernels.FOOT_X : kernels.FOOT_Z + 1].T
    parted = state.damage >= 1.0
    assert 0 < parted.sum() < parted.size
    # Feet are drawn on the bed, which taut strands draw up by less than two millimetres.
    np.testing.assert_allclose(middles[:, 0], ends, atol=1.2)
    np.testing.assert_allclose(middles[:, -1], feet, atol=2.2)
    step = np.linalg.norm(middles[:, 4] - middles[:, 3], axis=1)
    length = np.linalg.norm(ends - feet, axis=1)
    assert (step[~parted] < 0.5 * length[~parted]).all()
    assert np.linalg.norm(middles[parted, :4] - ends[parted, None], axis=2).max() < 3.0
    on_bed = middles[parted, 4:] - middles[parted, -1:]
    assert np.linalg.norm(on_bed, axis=2).max() < 3.0


def test_a_page_draws_strands_round_the_jaws_that_hold_them_aside(browser: Browser) -> None:
    session = bed_session(phantom(), vertices=600)
    session.choose_instrument(0, "dissector")  # which comes from where it is parked
    put(session, "dissector", session.spatial.hands[0].place + np.array([0.0, 25.0, 0.0]), 9.0)
    beam = session.spatial.beam
    held = [beam.touched_by(jaw)[beam.order] for jaw in range(2)]
    assert min(each.sum() for each in held) >= 20
    assert session.reading().broken == 0
    with strands_in_page(browser, session) as page:
        middles = drawn_middles(page, session.reading().strands)
    ends = beam.strand_ends()[beam.order]
    for jaw, mine in enumerate(held):
        rod, points = beam.state.rods[jaw], middles[mine]
        out = np.cross(points - rod[:3], rod[kernels.SHAFT : kernels.SHAFT + 3])
        nearest = np.linalg.norm(out, axis=2).min(axis=1)
        assert (np.abs(nearest - rod[kernels.RADIUS]) < 0.6).all(), "they lie against it"
        assert np.linalg.norm(points - ends[mine, None], axis=2).max() < 8.0


def test_a_divided_duct_is_drawn_without_its_second_clamp(
    client: viser.ClientHandle, session: Session
) -> None:
    front = next(each for each in bed_exercises(session) if each.name == "follow_front")
    assert isinstance(front.goal, FreeLength)
    front_length = front.goal.length_mm
    scene = TissueScene(client, session, "full")
    stubs: list[list[int]] = []
    for exercise in (None, front):
        if exercise is not None:
            session.start_exercise(exercise)
        scene.draw(session.reading())
        assert scene._stage is not None
        assert [clamp.visible for clamp in scene._stage._clamps] == [True, exercise is None]
        (drawn,) = scene._drawn
        stubs.append([len(each) for each in drawn.contact.stubs])
    assert stubs[0][0] == stubs[0][1] == stubs[1][0] > 0
    assert stubs[1][1] == 0, "nothing is pinched at the end that is free"
    assert scene._annotations._stretch is not None
    marked = scene._annotations._stretch._handles[0].points[..., 0]
    assert marked.max() - marked.min() == pytest.approx(front_length, abs=1e-3)
    session.reset()
    scene.draw(session.reading())
    assert scene._stage._clamps[1].visible
