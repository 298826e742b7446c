"""The trainer in a real browser, and as a process."""

import os
import signal
import subprocess
import threading
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import cv2
import numpy as np
import pytest
from browser import PATIENCE, TrainerPage, scene_of, stands_still, trainer_page
from browser import newest as newest_view
from playwright.sync_api import Browser, expect
from program import ENTRY, LONGEST, command, free_port, refused, started
from simulated import phantom
from viser import CameraHandle, ClientHandle

from app.simulation import Phase, Session
from app.trainer.server import trainer as server
from app.trainer.server.frame_budget import FrameBudget
from app.trainer.server.trainer import AddressTakenError, Trainer
from organ_geometry.organ_file import write_organ
from physics import Beam, Cubic, TautString

DUCT = Beam.round(span=50.8, diameter=8.89, modulus=0.310264)
SINGLE_PRECISION = 2e-5
"""mm: what vertices of some 50 mm lose on their way to the page."""


def newest(trainer: Trainer) -> Session:
    """The session of the client that came last, once it is there."""
    return newest_view(trainer).session


def drawn(trainer: Trainer) -> list[np.ndarray]:
    """The surfaces of the client that came last as they are drawn: smooth, and marked."""
    view = newest_view(trainer)
    return [each.contact.vertices for each in scene_of(view)._drawn]


def untouched(at_rest: np.ndarray) -> np.ndarray:
    """Vertices of the duct at rest that neither the clamps nor the hook in the middle mark."""
    return np.abs(np.abs(at_rest[:, 0] - 25.4) - 8.0) < 3.0


def rise(tab: TrainerPage, at_rest: np.ndarray) -> float:
    """How far the top of the duct's middle has risen in the page, mm."""
    middle = (np.abs(at_rest[:, 0] - 25.4) < 0.6) & (at_rest[:, 2] > 4.0)
    now = tab.vertices("skin")
    return float((now[middle, 2] - at_rest[middle, 2]).max())


def test_pull_bends_by_what_the_beam_says_tears_past_the_threshold_and_resets(
    browser: Browser, trainer: Trainer
) -> None:
    with trainer_page(browser, trainer.address) as tab:
        assert tab.figure("distance-to-break") == 1.0
        at_rest = tab.vertices("skin")

        tab.slide("Force F (N)", 2.0)
        tab.wait_for_force(2.0)
        expected = Cubic().pull(DUCT, 25.4).to_force(2.0).deflection
        assert tab.figure("deflection-mm") == pytest.approx(expected, rel=1e-5)
        free = untouched(at_rest)

        def as_computed() -> None:
            # The ring next to the grasp is a quarter of a millimetre off it at most.
            assert rise(tab, at_rest) == pytest.approx(expected, rel=5e-3)
            (computed,) = drawn(trainer)
            computed = computed[: len(at_rest)]
            assert tab.vertices("skin")[free] == pytest.approx(computed[free], abs=SINGLE_PRECISION)
            assert tab.figure("distance-to-break") == pytest.approx(
                newest(trainer).reading().check.distance_to_break, abs=1e-5
            )

        tab.eventually(as_computed)

        # The plot follows the pull.
        wanted = pytest.approx(expected, rel=1e-4)
        tab.wait_until(lambda: _reached(tab.charts()[0]) == wanted)
        deflections, theory, _, level, *_ = cast("list[list[float]]", tab.charts()[0])
        forces = [Cubic().pull(DUCT, 25.4).to_deflection(x).force for x in deflections]
        assert theory == pytest.approx(forces, abs=2e-3)
        assert level == pytest.approx([3.558577] * len(level), rel=1e-5)

        tab.slide("Force F (N)", 3.7)
        tab.wait_for_phase("torn")
        tab.wait_for_node("first_piece")
        tab.wait_for_node("second_piece")
        expect(tab.page.get_by_text("The duct is torn")).to_be_visible()
        expect(tab.page.get_by_test_id("worst")).to_have_text("Tore 25.4 mm from the left clamp.")
        tab.wait_until(lambda: "skin" not in tab.nodes())
        assert tab.figure("force-n") == 0.0
        assert tab.figure("breaks-at-n") == pytest.approx(3.55858, rel=1e-5)
        expect(tab.page.get_by_role("button", name="Reset")).to_be_enabled()
        fields = tab.page.get_by_role("textbox").filter(visible=True)
        expect(fields).to_have_count(2)  # force and grasp keep their place
        for label in ("Force F (N)", "Grasp (mm)"):
            tab.wait_for_disabled(label)
        for field in fields.all():
            field.focus()
            expect(field).not_to_be_focused()  # and take nothing
        session = newest(trainer)
        tab.wait_until(lambda: stands_still(session))  # the pieces have stopped swinging
        tab.wait_until(
            lambda: _drawn_gap(tab) == pytest.approx(_gap(*drawn(trainer)), abs=SINGLE_PRECISION)
        )
        assert _gap(*drawn(trainer)) > 1.0  # mm between the longest of what is frayed

        tab.page.get_by_role("button", name="Reset").click()
        tab.wait_for_phase("intact")
        tab.wait_for_node("skin")
        tab.wait_until(lambda: not tab.nodes() & {"first_piece", "second_piece"})
        expect(tab.page.get_by_text("The duct is torn")).to_have_count(0)
        tab.wait_until(lambda: np.array_equal(tab.vertices("skin"), at_rest))
        assert tab.figure("force-n") == 0.0
        tab.slide("Force F (N)", 1.0)
        tab.wait_for_force(1.0)


def _reached(plot: list[list[float | None]]) -> float | None:
    """The deflection that the pull in a plot has come to, mm."""
    return [x for x, y in zip(plot[0], plot[2], strict=True) if y is not None][-1]


def _gap(first: np.ndarray, second: np.ndarray) -> float:
    """Distance between two pieces along the duct, mm."""
    return float(second[:, 0].min() - first[:, 0].max())


def _drawn_gap(tab: TrainerPage) -> float:
    """That of the pieces as the page draws them."""
    return _gap(tab.vertices("first_piece"), tab.vertices("second_piece"))


def test_grasp_threshold_theory_and_duct_can_be_chosen(browser: Browser, trainer: Trainer) -> None:
    with trainer_page(browser, trainer.address) as tab:
        session = newest(trainer)
        tab.slide("Grasp (mm)", 12.0)
        tab.slide("Force F (N)", 1.0)
        tab.wait_for_force(1.0)
        expected = Cubic().pull(DUCT, 12.0).to_force(1.0).deflection
        assert tab.figure("deflection-mm") == pytest.approx(expected, rel=1e-5)

        tab.open("Model")
        tab.slide("Threshold (kPa)", 300.0)
        tab.page.locator("[data-testid=readout][data-threshold-kpa='300']").wait_for()
        assert session.tissue.threshold == pytest.approx(0.3)

        tab.open("Compare")
        tab.choose("Theory", "String (very large deflection)")
        tab.page.locator("[data-testid=readout][data-bending-stress-kpa='0']").wait_for()
        expected = TautString().pull(DUCT, 12.0).to_force(1.0).deflection
        assert tab.figure("deflection-mm") == pytest.approx(expected, rel=1e-5)

        tab.open("Model")
        tab.choose("Duct", "Porcine gallbladder wall, pulled fast")
        tab.wait_for_force(0.0)
        assert session.tissue.dissection.preset.name == "porcine-gallbladder"
        tab.open("Train")
        tab.slide("Force F (N)", 5.0)
        tab.wait_for_force(5.0)


def test_values_out_of_range_are_clamped_on_the_server(browser: Browser, trainer: Trainer) -> None:
    """Sent as the page's own message, past the slider's limits: clamped, or no number at all."""
    with trainer_page(browser, trainer.address) as tab:
        session = newest(trainer)
        tab.page.evaluate(
            "() => { const viewer = window.__viserMutable; const send = viewer.sendMessage;"
            " viewer.sendMessage = message => {"
            "  if (message.type === 'GuiUpdateMessage') window.__update = message;"
            "  send(message); }; }"
        )
        tab.open("Model")
        tab.slide("Threshold (kPa)", 420.0)  # so that all the force can be borne
        tab.open("Train")
        tab.slide("Force F (N)", 1.0)
        tab.wait_for_force(1.0)
        message = "{...window.__update, updates: {value: %s}}"
        for value, force in (
            ("1e9", session.planar.force_limit),
            ("NaN", session.planar.force_limit),
            ("-5", 0.0),
            ("Infinity", 0.0),
            ("'text'", 0.0),
            ("null", 0.0),
        ):
            # Two messages in order: when the second has come, the first has been answered.
            tab.page.evaluate(
                f"() => {{ const send = window.__viserMutable.sendMessage;"
                f" const update = {message % value}; send(update); window.__update = update; }}"
            )
            tab.wait_until(lambda wanted=force: session.reading().force == wanted)
            assert session.reading().phase is Phase.INTACT
        tab.slide("Force F (N)", 1.5)
        tab.wait_for_force(1.5)


def _tissue_row(tab: TrainerPage) -> float | None:
    """Mean row of the duct's colour in a strip of the picture, px; None where there is little."""
    picture = cv2.imdecode(np.frombuffer(tab.page.screenshot(), np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    strip = picture[60:, 400:520].astype(int)
    blue, green, red = strip[..., 0], strip[..., 1], strip[..., 2]
    tissue = (red > 110) & (green > 0.5 * red) & (blue < 0.8 * green)
    return float(np.nonzero(tissue)[0].mean()) if tissue.mean() > 0.03 else None


def test_duct_is_seen(drawing_browser: Browser, trainer: Trainer) -> None:
    """The picture shows tissue where the duct is, and higher once it is pulled."""
    with trainer_page(drawing_browser, trainer.address, dots=0.5) as tab:
        heights: list[float] = []
        tab.wait_for_camera(newest_view(trainer))
        for force in (0.0, 3.0):
            tab.slide("Force F (N)", force)
            tab.wait_for_force(force)
            tab.wait_until(lambda: _tissue_row(tab) is not None)
            if heights:
                tab.wait_until(lambda: (_tissue_row(tab) or np.inf) < heights[0] - 20.0)
            heights.append(_tissue_row(tab) or np.nan)
        assert heights[1] < heights[0] - 20.0  # px, upwards


# The process.


def ends(process: subprocess.Popen[str], number: signal.Signals) -> None:
    """See that a signal ends a trainer without a word."""
    process.send_signal(number)
    _, errors = process.communicate(timeout=LONGEST)
    assert (process.returncode, errors) == (0, "")


def test_prints_the_address_that_answers_and_ends_cleanly() -> None:
    with started("--port", 0, "--look", "plain") as (process, address):
        assert address.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(address, timeout=LONGEST) as answer:
            assert answer.status == 200
            assert b"<html" in answer.read().lower()
        ends(process, signal.SIGTERM)


BUSY_WARMING = f"""
import numpy, scipy.fft
from app.trainer.server import warm_up

def busy(**_):
    places = numpy.ones((300, 300))
    while True:
        scipy.fft.dctn(places)

warm_up.stage_files = busy
{ENTRY}"""


def test_ends_cleanly_while_its_warming_is_in_compiled_code() -> None:
    """Python would abort ("terminate called without an active exception") at its own end."""
    with started("--port", 0, "--look", "plain", entry=BUSY_WARMING) as (process, _):
        ends(process, signal.SIGTERM)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_it_compiles_ends_it_at_once(number: signal.Signals, tmp_path: Path) -> None:
    """A first start compiles for many seconds, after it has said its address."""
    with subprocess.Popen(
        command("trainer", "--port", 0, "--look", "plain"),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
    ) as process:  # fmt: skip
        try:
            deadline = time.monotonic() + LONGEST
            while not any(tmp_path.rglob("*.nbc")):  # the first kernel of many
                assert time.monotonic() < deadline
                time.sleep(0.02)
            process.send_signal(number)
            output, errors = process.communicate(timeout=LONGEST)
        finally:
            process.kill()
    assert errors == ""
    # Before the address is said the signal itself ends it, then the end is an orderly one.
    assert process.returncode == (0 if output.startswith("The trainer is ready") else -number)


@pytest.mark.long  # many tabs
def test_tabs_that_close_while_they_are_drawn_are_no_fault(browser: Browser) -> None:
    with started("--port", 0, "--look", "plain", "--mode", "pull") as (process, address):
        for _ in range(3):
            with trainer_page(browser, address, width=640, height=480) as tab:
                tab.slide("Force F (N)", 3.0)  # and gone, while the duct still moves
        ends(process, signal.SIGTERM)


def test_one_camera_callback_whatever_the_duct(
    browser: Browser, trainer: Trainer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """viser keeps them all: one for each new stage would draw stages that are gone."""
    callbacks: list[object] = []
    register = CameraHandle.on_update

    def counted(camera: CameraHandle, callback: Callable[[CameraHandle], None]) -> object:
        callbacks.append(callback)
        return register(camera, callback)

    monkeypatch.setattr(CameraHandle, "on_update", counted)
    with trainer_page(browser, trainer.address, width=640, height=480) as tab:
        view = newest_view(trainer)
        for preset in ("porcine-gallbladder", "thesis-bile-duct", "porcine-gallbladder"):
            view.session.choose_preset(preset)
            tab.wait_until(
                lambda name=preset: scene_of(view)._clamps == view.session.tissue.dissection.clamps
            )
        assert len(callbacks) == 1


def test_serves_the_port_it_is_told_says_when_it_is_taken_and_ends_by_an_interrupt(
    tmp_path: Path,
) -> None:
    organ = tmp_path / "duct.organ"
    write_organ(phantom(), organ)
    port = free_port()
    with started("--port", port, "--organ", organ, "--look", "plain") as (process, address):
        assert address == f"http://127.0.0.1:{port}"
        line = refused(("trainer", "--port", port, "--organ", organ))
        assert str(port) in line
        assert "in use" in line
        with urllib.request.urlopen(address, timeout=LONGEST) as answer:  # undisturbed
            assert answer.status == 200
        ends(process, signal.SIGINT)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--organ", "nowhere.organ"), "nowhere.organ"),
        (("--port", 70000), "--port must be from 0 to 65535"),
        (("--look", "shiny"), "auto, full or plain"),
        (("--exercise-inputs", "feet"), "hand or any"),
        (("--host", "no.such.host.invalid", "--port", 0), "give --host an address"),
    ],
)
def test_trainer_refuses(arguments: tuple[object, ...], words: str) -> None:
    assert words in refused(("trainer", *arguments))


ON_TOP = """at => document.elementFromPoint(...at).closest('#bd-cover') !== null"""
PLACES = (5, 5), (1200, 60), (640, 400), (1275, 795)
"""In a window of 1280 by 800 px: in viser's bar, its panel and its picture."""
HIGHEST_AT_ITS_MIDDLE = """note => {
    const box = note.getBoundingClientRect();
    const all = document.elementsFromPoint(box.x + box.width / 2, box.y + box.height / 2);
    return all.some(each => note.contains(each)) && (all[0].closest("#bd-cover") ?? note).id;
}"""
"""The name of what lies highest where a note has come to: of the cover, or of the note."""


def test_a_page_is_covered_until_its_scene_is_ready(
    browser: Browser, trainer: Trainer, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready = threading.Event()
    monkeypatch.setattr(trainer.warm_up, "wait", lambda _: ready.wait())
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    try:
        page.goto(trainer.address)
        expect(page.get_by_text("Preparing the tissue.")).to_be_visible(timeout=PATIENCE)
        expect(page.get_by_text("not a medical device")).to_be_visible()
        page.get_by_text("Connected").wait_for()  # viser's own panel lies below
        clients = trainer._server.get_clients()
        clients[max(clients)].add_notification("A note", "as viser shows its own")
        note = page.get_by_role("alert").filter(has_text="A note").element_handle()
        highest = page.wait_for_function(HIGHEST_AT_ITS_MIDDLE, arg=note).json_value()
        assert highest == "bd-cover"
        for at in PLACES:
            assert page.evaluate(ON_TOP, at)
        ready.set()
        page.get_by_role("dialog").wait_for(timeout=PATIENCE)
        page.locator("#bd-cover").wait_for(state="detached")
    finally:
        ready.set()
        page.close()


def test_a_page_that_connects_again_is_covered_and_after_a_restart_is_told_so(
    browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Covered before the trainer has said a word."""
    port = free_port()
    running = Trainer(phantom(), port=port, scene="free", look="plain")
    spoken, prepare = threading.Event(), server.prepare_page

    def silent(client: ClientHandle) -> None:
        spoken.wait()
        prepare(client)

    try:
        with trainer_page(browser, running.address) as tab:

            def stays_covered() -> None:
                tab.readout.wait_for(state="detached")  # viser has emptied the page
                for at in PLACES:
                    assert tab.page.evaluate(ON_TOP, at)
                spoken.set()
                tab.readout.wait_for()
                tab.page.locator("#bd-cover").wait_for(state="detached")

            monkeypatch.setattr(server, "prepare_page", silent)
            running._server._websock_server.disconnect_all_clients()
            stays_covered()
            spoken.clear()
            running.stop()
            running = Trainer(phantom(), port=port, scene="free", look="plain")
            stays_covered()
            reported = tab.page.get_by_role("alert").filter(has_text="A new duct")
            expect(reported).to_contain_text("the trainer was started anew")
            tab.page.reload()  # its new session is known: nothing to tell
            tab.wait_for_node("skin")
            expect(reported).to_have_count(0)
    finally:
        spoken.set()
        running.stop()


def test_a_page_whose_session_cannot_be_made_says_so(
    browser: Browser, trainer: Trainer, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise RuntimeError("no view")

    monkeypatch.setattr(server, "PageView", fails)
    page = browser.new_page()
    try:
        page.goto(trainer.address)
        expect(page.locator("#bd-cover")).to_contain_text("Reload the page for a new one.")
    finally:
        page.close()


@pytest.mark.parametrize("answers", [True, False])
def test_a_tab_that_closes_while_it_connects_leaves_nothing(
    trainer: Trainer, monkeypatch: pytest.MonkeyPatch, answers: bool
) -> None:
    """A client may be disconnected before its view is made, or before it has said a word."""
    view, there = Ticked(), {10**6: object()} if answers else {}

    def made(*_: object, **__: object) -> Ticked:
        there.clear()
        return view

    monkeypatch.setattr(server, "PageView", made)
    monkeypatch.setattr(trainer._server, "get_clients", lambda: there)
    for unseen in ("prepare_page", "cover_page", "uncover_page"):
        monkeypatch.setattr(server, unseen, lambda *_, **__: None)
    monkeypatch.setattr(server, "kept_by_tab", lambda _: None)
    monkeypatch.setattr(server, "asked_by_address", lambda *_: None)
    tokens: list[str] = []
    monkeypatch.setattr(server, "tab_keeps", lambda _, token: tokens.append(token))
    storage = SimpleNamespace(get_item=lambda *_: "1")  # it has seen the first minute
    gone = cast("ClientHandle", SimpleNamespace(client_id=10**6, local_storage=storage))
    before = len(trainer._kept)
    trainer._disconnect(gone)
    trainer._connect(gone)
    assert gone.client_id not in trainer._views
    assert gone.client_id not in trainer._tokens
    assert view.closed == answers
    if not answers:
        assert (tokens, len(trainer._kept)) == ([], before)
        return
    (token,) = tokens
    again, _ = trainer._kept.claim(token)  # another, were it not left
    trainer._kept.leave(again)
    assert again == token


class Ticked:
    """A view that counts its ticks, and raises in each if it has a client."""

    def __init__(self, client: object = None) -> None:
        self.client = client
        self.ticks = 0
        self.closed = False
        self.state = SimpleNamespace(watching=False)

    def tick(self, seconds: float, *, draws: bool) -> None:
        self.ticks += 1
        if self.client is not None:
            raise RuntimeError("this session fails")

    def close(self) -> None:
        self.closed = True
        if self.client is not None:
            raise RuntimeError("viser cannot close")


def test_sessions_go_on_whatever_viser_raises(
    trainer: Trainer, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise AttributeError("viser has changed")

    monkeypatch.setattr(trainer._server, "get_clients", fails)
    monkeypatch.setattr(server, "EXPIRY_SECONDS", 0.0)  # every tick looks for sessions to end
    monkeypatch.setattr(trainer._kept, "expire", fails)
    monkeypatch.setattr(trainer, "_expiry", 0.0)
    monkeypatch.setattr(trainer, "_faults", set[str]())
    others = range(10**6, 10**6 + 3)
    broken = [
        Ticked(SimpleNamespace(client_id=number, add_notification=fails)) for number in others
    ]
    steady = Ticked()
    try:
        trainer._views |= cast("dict[int, Any]", dict(zip(others, broken, strict=True)))
        trainer._views[10**7] = cast("Any", steady)
        deadline = time.monotonic() + LONGEST
        while steady.ticks < 10 and time.monotonic() < deadline:
            time.sleep(0.01)
    finally:
        for number in (*others, 10**7):
            trainer._views.pop(number, None)
    assert steady.ticks >= 10
    assert [view.ticks for view in broken] == [1, 1, 1]
    stopped = [f"the session of client {number} has stopped" for number in others]
    output = [each.getMessage() for each in caplog.records if each.name == server.__name__]
    assert sorted(each for each in output if each in stopped) == stopped
    assert sorted(each for each in output if each not in stopped) == [
        f"{what} has failed; the sessions go on"
        for what in (
            "asking for the clients",
            "closing a client's view",
            "telling a client",
            "the end of sessions that were left",
        )
    ]


def test_sessions_are_stepped_side_by_side_and_who_watches_one_after_them(
    trainer: Trainer,
) -> None:
    together = threading.Barrier(2)
    order: list[str] = []

    def view(name: str, *, watching: bool = False) -> Any:
        def tick(_: float, *, draws: bool) -> None:
            assert draws
            if not watching:
                together.wait(timeout=LONGEST)
            order.append(name)

        return SimpleNamespace(tick=tick, state=SimpleNamespace(watching=watching))

    views = {1: view("teacher", watching=True), 2: view("trainee"), 3: view("trainee")}
    stepping = Trainer.__new__(Trainer)
    vars(stepping).update(
        vars(trainer), _views=views, _budget=FrameBudget(), _threads=2, _hand=None
    )
    stepping._tick(1.0 / 30.0)
    assert order == ["trainee", "trainee", "teacher"]
    assert set(views) == {1, 2, 3}  # none has raised


def test_memory_is_given_back_once_a_page_has_left(
    trainer: Trainer, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = threading.Event()
    monkeypatch.setattr(server, "_give_back", done.set)
    trainer._disconnect(cast("ClientHandle", SimpleNamespace(client_id=10**6)))
    monkeypatch.setattr(trainer, "_expiry", 0.0)
    assert done.wait(LONGEST)


def test_taken_port_is_an_error_in_the_library_too(trainer: Trainer) -> None:
    with pytest.raises(AddressTakenError, match=str(trainer.port)):
        Trainer(phantom(), port=trainer.port, look="plain")
