"""The trainer's server: how it starts, one session per client, and one clock for all.

In each tick some threads step the sessions: what is compiled runs without the interpreter's lock,
so that a class keeps more than one core at work.
"""

import contextlib
import ctypes
import logging
import os
import socket
import ssl
import threading
import time
from collections.abc import Awaitable, Callable, Generator, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TypeAlias, cast

import viser
from websockets.asyncio.server import ServerConnection

from app.anatomy import Anatomy, CaseWorkbench
from app.compression.build_process import BuildProcess
from app.haptics.servo_process import HapticSetting, ServoProcess
from app.simulation import TICK_SECONDS, ExerciseInputs, Preset, RunFile, Session, free_specimen
from app.trainer.classroom.lesson import Lesson, WatchRequest
from app.trainer.classroom.teacher_page import TeacherPage
from app.trainer.client.beside import StartCompanion
from app.trainer.client.haptic_hand import HapticHand, setting_of
from app.trainer.client.page_state import BRIEF_SECONDS, NOTICE_SECONDS, PageState
from app.trainer.client.practice import OLDER_NAMES, SCENES, Practice, SceneName
from app.trainer.client.workers import EXPORT_VERTICES, Workers
from app.trainer.connections.bounds import Bounds, Connections, PageConnection, socket_options
from app.trainer.connections.guard import Guard
from app.trainer.panel.frame import DISCLAIMER
from app.trainer.panel.help import SEEN, show_first_minute
from app.trainer.server.fixed_rate_timer import FixedRateTimer
from app.trainer.server.frame_budget import FrameBudget
from app.trainer.server.sessions import Sessions, SessionsFullError
from app.trainer.server.warm_up import WarmUp
from app.trainer.stage.camera import OVERVIEW
from app.trainer.stage.lighting import LookChoice
from app.trainer.view.page_view import PageView
from app.trainer.viser_bridge.fast_transport import wakes_once
from app.trainer.viser_bridge.page import (
    asked_by_address,
    cover_page,
    kept_by_tab,
    prepare_page,
    tab_keeps,
    uncover_page,
)
from app.trainer.viser_bridge.private_api import (
    close_page,
    connection_of,
    page_of,
    start_server,
    stop_server,
)
from organ_geometry import Organ

# s, longest time that a session advances at once: a stall slows a pull, but skips nothing.
LONGEST_TICK = 0.1

LONGEST_STANDING = 5.0
"""s without a tick after which the trainer is not healthy."""
# Threads that step sessions: more would only wait for the interpreter's lock.
MOST_THREADS = 4
EXPIRY_SECONDS = 10.0
"""s between two searches for sessions that have expired."""
# s that a browser may take to send its stored token.
STORAGE_SECONDS = 1.0
PREPARING = (
    "Blunt-dissection trainer",
    "Preparing the tissue. On a first start this takes some minutes, later a few seconds.",
    DISCLAIMER,
)
"""What a page shows until its scene is ready."""
STOPPED = "This duct has stopped", "A fault of the program. Reload the page for a new one."
LOST = (
    "The one that this page had is gone: the trainer was started anew, or the page was away for "
    "more than ten minutes."
)

# A client's number and view, and whether it is drawn in this tick.
_Turn: TypeAlias = tuple[int, PageView, bool]

log = logging.getLogger(__name__)


class AddressTakenError(ValueError):
    """The address cannot be served: it is in use, or not one of this machine."""


class Trainer:
    """A running trainer: open its `address` in a browser.

    Parameters
    ----------
    organ, preset
        That every client trains on, each in a session of its own, and that they open on.
    host, port, tls
        Address to serve, loopback by default; port 0 takes a free one; encrypts what is sent.
    token
        What the link must have; made when None, where the address is not loopback.
    scene, look
        What a page opens on, if its address does not say `?scene=`; "auto" is the full look,
        and the "plain" one for slow pages.
    anatomy
        What the scene of several tubes shows first; the usual one when None.
    case
        A case that is built in the page, in place of `anatomy`.
    replay
        A run that every page opens on, made on this organ; None opens on the page's own duct.
    bounds
        Limits of what clients may take; usual ones when None.
    build_process
        Builds organs, within limits of its own.
    export_vertices
        Of a surface that is downloaded, about.
    exercise_inputs
        Which inputs count in exercises; "any" allows sliders and keys, and each run says so.
    policy
        Starts a policy beside an exercise, as its second hand or a ghost; None for none.
    haptics
        Starts the servo of a device for a first setting; None for no device.
    metrics
        Whether `/metrics` has the trainer's figures.
    public_url, trusted_proxy
        Where a reverse proxy serves it, and the proxy's address, whose X-Forwarded-For counts.
    lesson
        The class whose trainees come by its link, if the trainer is a class's.

    Attributes
    ----------
    connections, timer, warm_up
        All connections and what was refused; the ticks that ran and those that the machine had no
        time for; what compiles and draws ahead of use.

    Raises
    ------
    AddressTakenError
        If the address is in use, or not one of this machine.
    ValueError
        If the token is too short or cannot stand in a link, or the public URL or proxy is none.
    RuntimeError
        If this viser opens its socket in another way than the guard can stand in.
    """

    def __init__(
        self,
        organ: Organ,
        preset: Preset | None = None,
        *,
        host: str = "127.0.0.1",
        token: str | None = None,
        port: int,
        scene: SceneName | None = None,
        look: LookChoice = "full",
        anatomy: Anatomy | None = None,
        case: CaseWorkbench | None = None,
        replay: RunFile | None = None,
        bounds: Bounds | None = None,
        build_process: BuildProcess | None = None,
        export_vertices: int = EXPORT_VERTICES,
        exercise_inputs: ExerciseInputs = "hand",
        policy: StartCompanion | None = None,
        haptics: Callable[[HapticSetting], ServoProcess] | None = None,
        metrics: bool = False,
        tls: ssl.SSLContext | None = None,
        public_url: str | None = None,
        trusted_proxy: str | None = None,
        lesson: Lesson | None = None,
    ) -> None:
        _limit_arenas()
        bounds = bounds or Bounds()
        self.connections = Connections(bounds, self._tell_refusal, trusted_proxy)
        self._encrypted, self._public_url = tls is not None, public_url
        self._lesson = lesson
        self._guard = Guard(
            host,
            token if lesson is None else lesson.store.trainee_token,
            self.connections,
            public_url=public_url,
            encrypted=self._encrypted,
            teacher_token=None if lesson is None else lesson.store.teacher_token,
        )
        if lesson is not None:
            self._guard.teacher_page = TeacherPage(lesson, lambda: self.link)
        self._exercise_inputs: ExerciseInputs = exercise_inputs
        self._host = host
        self._scene: SceneName = scene or "bed"
        self._look: LookChoice = look
        self._replay, self._policy = replay, policy
        self._views: dict[int, PageView] = {}
        self._tokens: dict[int, str] = {}
        self._views_lock = threading.Lock()
        self._making = threading.Lock()
        self._left = threading.Event()  # a page has left since memory was given back
        self._kept = Sessions(
            lambda: Practice(organ, preset, own_anatomy=anatomy, case=case),
            most=bounds.most_clients,
        )
        self._workers = Workers(
            build_process=build_process or BuildProcess(), export_vertices=export_vertices
        )
        self._stopping = threading.Event()
        self._ticked = time.monotonic()
        self.timer, self._budget = FixedRateTimer(TICK_SECONDS), FrameBudget()
        self._guard.healthy = self._goes_on
        if metrics:
            from app.trainer.server.metrics import trainer_metrics

            self._guard.metrics = trainer_metrics(
                lambda: len(self.frames), self.timer, self.connections
            )
        self._server = _serve(host, port, self._guard, socket_options(self.connections, tls))
        self._hand: HapticHand | None = None
        if haptics is not None:
            try:
                self._hand = HapticHand(haptics(setting_of(Session(free_specimen(organ, preset)))))
            except ValueError:
                self._server.stop()
                raise
        self.warm_up = WarmUp(organ, preset, "plain" if look == "plain" else "full", self._scene)
        # What "reset view" goes to; each client's own camera is set when its scene is drawn.
        camera = self._server.initial_camera
        camera.position, camera.look_at = tuple(OVERVIEW.position), tuple(OVERVIEW.look_at)
        camera.up, camera.fov = tuple(OVERVIEW.up), OVERVIEW.fov
        # Not in viser's pool: pages that do not answer would keep the others out of it.
        self._server.on_client_connect(
            cast(Callable[[viser.ClientHandle], None], self._connect_apart)
        )
        self._server.on_client_disconnect(self._disconnect)
        self._faults: set[str] = set()
        self._expiry = time.monotonic() + EXPIRY_SECONDS
        self._threads = min(os.cpu_count() or 1, MOST_THREADS)
        self._helpers = ThreadPoolExecutor(self._threads, thread_name_prefix="sessions")
        self._clock = threading.Thread(target=self._run, name="sessions", daemon=True)
        self._clock.start()

    @property
    def port(self) -> int:
        """The port that answers."""
        return self._server.get_port()

    @property
    def address(self) -> str:
        """The address that answers."""
        if self._public_url is not None:
            return self._public_url.rstrip("/")
        host, scheme = _own_address(self._host), "https" if self._encrypted else "http"
        return f"{scheme}://{f'[{host}]' if ':' in host else host}:{self.port}"

    @property
    def link(self) -> str:
        """The address with the token that it asks for, if it asks for one."""
        token = self._guard.token
        return self.address if token is None else f"{self.address}/?token={token}"

    @property
    def teacher_link(self) -> str | None:
        """The link to the teacher's page, if the trainer is a class's."""
        lesson = self._lesson
        return None if lesson is None else f"{self.address}/?token={lesson.store.teacher_token}"

    @property
    def frames(self) -> dict[int, int]:
        """How often each client's duct was drawn, by client number."""
        with self._views_lock:
            return {number: view.frames for number, view in self._views.items()}

    def _goes_on(self) -> bool:
        """Return whether the sessions are stepped."""
        return not self._stopping.is_set() and time.monotonic() - self._ticked < LONGEST_STANDING

    def stop(self) -> None:
        """Stop the clock and the server, and remove what clients have uploaded."""
        self._stopping.set()
        self.warm_up.stop()
        self._clock.join(timeout=5.0)
        self._helpers.shutdown(wait=False, cancel_futures=True)
        if self._hand is not None:
            self._hand.stop()
        with self._views_lock:
            views, self._views = self._views, {}
        for view in views.values():
            view.close()
        self._workers.stop()
        if self._lesson is not None:
            self._lesson.stop()
        stop_server(self._server)

    async def _connect_apart(self, client: viser.ClientHandle) -> None:
        threading.Thread(target=self._connect, args=(client,), name="page", daemon=True).start()

    def _connect(self, client: viser.ClientHandle) -> None:
        number = client.client_id
        try:
            prepare_page(client)
            cover_page(client, PREPARING, waits=True)
            before = kept_by_tab(client)
            if number not in self._server.get_clients():
                return  # it has left without an answer
            lost = before is not None and before not in self._kept
            token, practice = self._kept.claim(before)
            tab_keeps(client, token)
            watched, on_page_ready = self._of_class(client)
            if watched is not None:
                practice.scene = watched.scene
            elif practice.scene is None:
                practice.scene = _asked_scene(client) or self._scene
            self.warm_up.wait(practice.scene)
            # One page at a time: many that open together would leave no time to the clock.
            with self._making:
                view = PageView(
                    client,
                    practice,
                    self._workers,
                    self._look,
                    exercise_inputs=self._exercise_inputs,
                    policy=self._policy,
                    ready=self.warm_up.wait,
                    on_page_ready=on_page_ready,
                )
            if watched is not None:
                watched.begin(view)
            elif self._replay is not None:
                view.replay(self._replay)
            elif lost:
                client.add_notification(
                    "A new duct", LOST, color="yellow", auto_close_seconds=NOTICE_SECONDS
                )
            elif token == before and view.state.in_exercise and view.session.run.started:
                words = f"{view.session.run.seconds:.0f} s of it are over."
                client.add_notification("Your try goes on", words, auto_close_seconds=BRIEF_SECONDS)
            elif token != before and not _seen(client):
                show_first_minute(client, view.session)
            uncover_page(client)
        except TimeoutError:
            close_page(self._server, number, "a page that does not answer")
            return
        except SessionsFullError as full:
            cover_page(client, ("No free place", f"{full}."), waits=False)
            return
        except Exception:
            if number in self._server.get_clients():
                log.exception("the session of client %d has stopped", number)
                with self._surviving("telling a client"):
                    cover_page(client, STOPPED, waits=False)
            return
        with self._views_lock:
            # viser runs this in a thread pool: the tab may have been closed in the meantime.
            if there := number in self._server.get_clients():
                self._views[number], self._tokens[number] = view, token
        if not there:
            if self._lesson is not None:
                self._lesson.leave(view)
            view.close()
            self._kept.leave(token)

    def _of_class(
        self, client: viser.ClientHandle
    ) -> tuple[WatchRequest | None, Callable[[PageView], object]]:
        """Return what the teacher's page is to show, and what adds the class to a trainee's."""
        connection = connection_of(self._server, client.client_id)
        if self._lesson is not None and isinstance(connection, PageConnection):
            if connection.is_teacher and (watched := self._lesson.to_watch(client)) is not None:
                return watched, lambda _: None
            if connection.trainee is not None:
                return None, partial(self._lesson.add_card, connection.trainee)
        return None, lambda _: None

    def _disconnect(self, client: viser.ClientHandle) -> None:
        self._left.set()
        with self._views_lock:
            view = self._views.pop(client.client_id, None)
            token = self._tokens.pop(client.client_id, None)
        if view is not None:
            if self._lesson is not None:
                self._lesson.leave(view)
            view.close()
        if token is not None:
            self._kept.leave(token)

    @contextlib.contextmanager
    def _surviving(self, what: str) -> Generator[None]:
        """Log the first fault of a kind, and go on: one thread steps every client's session."""
        try:
            yield
        except Exception:
            if what not in self._faults:
                self._faults.add(what)
                log.exception("%s has failed; the sessions go on", what)

    def _tell_refusal(self, connection: PageConnection, words: str) -> None:
        if (client := page_of(self._server, connection)) is not None:
            client.add_notification(
                "Not taken", words, color="yellow", auto_close_seconds=NOTICE_SECONDS
            )

    def _tell_fault(self, client: viser.ClientHandle) -> None:
        """Log the fault that has stopped a client's session, and tell the client."""
        log.exception("the session of client %d has stopped", client.client_id)
        with self._surviving("telling a client"):
            client.add_notification(*STOPPED, color="red")

    def _run(self) -> None:
        while (seconds := self.timer.wait(self._stopping)) is not None:
            self._ticked = time.monotonic()
            with self._surviving("a tick"):
                self._tick(min(seconds, LONGEST_TICK))
            if (now := time.monotonic()) > self._expiry:
                self._expiry = now + EXPIRY_SECONDS
                with self._surviving("the end of sessions that were left"):
                    self._kept.expire()
                if self._left.is_set():
                    self._left.clear()
                    self._helpers.submit(_give_back)

    def _tick(self, seconds: float) -> None:
        """Step every session, and draw those that the frame budget allows."""
        with self._views_lock:
            views = list(self._views.items())
        self._budget.begin_tick(self.timer.load)
        if self._hand is not None:
            self._attend(self._hand, views[0][1].state if views else None)
        own: list[_Turn] = []
        watching: list[_Turn] = []
        for place, (number, view) in enumerate(views):
            turn = number, view, self._budget.draws(place)
            (watching if view.state.watching else own).append(turn)
        waiting = iter(own)
        helpers = [
            self._helpers.submit(self._step, waiting, seconds)
            for _ in range(min(self._threads, len(own)) - 1)
        ]
        self._step(waiting, seconds)
        for helper in helpers:
            helper.result()
        # Each shows the session of another page, which nobody steps now.
        self._step(iter(watching), seconds)

    def _step(self, waiting: Iterator[_Turn], seconds: float) -> None:
        """Step what is still waiting, beside other threads that take from the same turns."""
        with wakes_once(self._server):
            for number, view, draws in waiting:
                try:
                    view.tick(seconds, draws=draws)
                except Exception:
                    self._drop(number, view)

    def _drop(self, number: int, view: PageView) -> None:
        """Close a view whose tick has raised: its client has just gone, or there is a fault."""
        with self._views_lock:
            there = self._views.pop(number, None) is view
        with self._surviving("closing a client's view"):
            view.close()
        with self._surviving("asking for the clients"):
            there = there and number in self._server.get_clients()
        if there:
            self._tell_fault(view.client)

    def _attend(self, hand: HapticHand, state: PageState | None) -> None:
        """Let the hand on the device lead the first page."""
        try:
            hand.attend(state)
        except Exception:
            log.exception("the hand on the device has stopped")
            self._hand = None
            with self._surviving("stopping the device"):
                hand.stop()


def _limit_arenas() -> None:
    """Let all threads share two of glibc's arenas: each of viser's would keep memory of its own."""
    with contextlib.suppress(AttributeError, TypeError):  # another C library
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, 2)


_M_ARENA_MAX = -8  # malloc.h


def _give_back() -> None:
    """Give free memory back to the system: glibc keeps what lies between blocks in use."""
    with contextlib.suppress(AttributeError, TypeError):  # another C library
        ctypes.CDLL(None).malloc_trim(0)


def _asked_scene(client: viser.ClientHandle) -> SceneName | None:
    """Return the scene that a page's address asks for, by its name or what it was called before."""
    asked = asked_by_address(client, "scene")
    if asked in SCENES:
        return asked
    return OLDER_NAMES.get(asked_by_address(client, "mode") or "")


def _seen(client: viser.ClientHandle) -> bool:
    """Return whether this browser has shown the help for the first minute before."""
    try:
        return client.local_storage.get_item(SEEN, STORAGE_SECONDS) is not None
    except (RuntimeError, TimeoutError):
        return False


def _own_address(host: str) -> str:
    """Return where others find this machine, if it serves all of its addresses; else the host."""
    if host not in ("", "0.0.0.0", "::"):  # noqa: S104
        return host
    # Nothing is sent: the addresses are documentation's, and only choose the network.
    family, other = (
        (socket.AF_INET6, "2001:db8::1") if host == "::" else (socket.AF_INET, "192.0.2.1")
    )
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((other, 9))
            return str(probe.getsockname()[0])
    except OSError:
        return "localhost"


def _serve(host: str, port: int, guard: Guard, options: Mapping[str, object]) -> viser.ViserServer:
    """Return viser's server on exactly this address: viser itself would take another port."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        if isinstance(error, socket.gaierror):
            raise AddressTakenError(
                f"cannot serve {host}: {reason}; give --host an address of this machine"
            ) from error
        raise _taken(host, port, reason) from error
    server = start_server(host, port, guard, options, _apart)
    if port not in (0, server.get_port()):
        server.stop()
        raise _taken(host, port, "it is in use")
    return server


def _apart(connection: ServerConnection) -> Awaitable[None] | None:
    """Serve a websocket that is not of viser's page."""
    serve = connection.serve if isinstance(connection, PageConnection) else None
    return None if serve is None else serve()


def _taken(host: str, port: int, why: str) -> AddressTakenError:
    return AddressTakenError(
        f"cannot serve {host} port {port}: {why}; choose another with --port, or 0 for a free one"
    )
