"""Who gets into a trainer, asked of the running server by requests as a browser would send them."""

import http.client
import io
import logging
import re
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import viser
from browser import PATIENCE
from playwright.sync_api import Browser
from program import LONGEST, refused, started
from prometheus_client.parser import text_string_to_metric_families
from simulated import phantom

from app.command_line.serving import draw_link
from app.trainer.connections import guard
from app.trainer.connections.guard import TOKEN_VARIABLE, Guard, is_loopback
from app.trainer.server import trainer as server
from app.trainer.server.metrics import trainer_metrics
from app.trainer.server.trainer import Trainer, _own_address
from app.trainer.viser_bridge.private_api import start_server, stop_server

TOKEN = "a-token-of-24-characters"
UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Protocol": f"viser-v{viser.__version__}",
}
KINDS = pytest.mark.parametrize(
    ("kind", "let_in"), [({}, 200), (UPGRADE, 101)], ids=["page", "websocket"]
)


class Answer:
    """What a server on loopback answers to one request; PORT in a header is its own port."""

    def __init__(
        self, port: int, headers: dict[str, str], path: str = "/", *more: tuple[str, str]
    ) -> None:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=LONGEST)
        # ASCII alone would attack less.
        vars(connection)["_encode_request"] = str.encode
        connection.putrequest("GET", path, skip_host=True, skip_accept_encoding=True)
        for name, value in (*headers.items(), *more):
            connection.putheader(name, value.replace("PORT", str(port)).encode("utf-8"))
        connection.endheaders()
        response = connection.getresponse()
        self.status = response.status
        self.headers = response.headers
        self.text = "" if response.status == 101 else response.read().decode()
        connection.close()


@pytest.fixture(scope="module")
def asking() -> Iterator[int]:
    """The port of a server that asks for the token."""
    server = start_server("127.0.0.1", 0, Guard("127.0.0.1", TOKEN))
    yield server.get_port()
    stop_server(server)


@KINDS
@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "127.0.0.1:PORT"},
        {"Host": "localhost:PORT"},
        {"Host": "LocalHost:PORT", "Origin": "http://localhost:PORT"},
        {"Host": "[::1]:PORT", "Origin": "http://[::1]:PORT"},
        {"Host": "127.0.0.1:PORT", "Origin": "http://127.0.0.1:PORT"},
        {"Host": "localhost:2222", "Origin": "http://localhost:2222"},  # through a tunnel
    ],
)
def test_this_machine_s_own_pages_get_in(
    trainer: Trainer, headers: dict[str, str], kind: dict[str, str], let_in: int
) -> None:
    assert Answer(trainer.port, headers | kind).status == let_in


@KINDS
@pytest.mark.parametrize(
    "host",
    [
        "attacker.example", "attacker.example:PORT", "localhost.attacker.example:PORT",
        "127.0.0.1.attacker.example:PORT", "localhost@attacker.example", "attacker.example:1:PORT",
        "192.168.1.7:PORT", "0.0.0.0:PORT", "[2001:db8::1]:PORT", "[::1", "localhost:PORT/",
        "löcalhost", "", ":PORT",
    ],
)  # fmt: skip
def test_a_name_of_another_is_refused(
    trainer: Trainer, host: str, kind: dict[str, str], let_in: int
) -> None:
    """A site may have a name of its own resolve to loopback: its pages then are of that origin."""
    for headers in ({"Host": host}, {"Host": host, "Origin": f"http://{host}"}):
        answer = Answer(trainer.port, headers | kind)
        assert answer.status == 403
        assert answer.text == guard.FOREIGN_HOST
    assert let_in != 403


@KINDS
def test_one_host_is_named(trainer: Trainer, kind: dict[str, str], let_in: int) -> None:
    own = ("Host", "localhost")
    assert Answer(trainer.port, kind).status == 403
    assert Answer(trainer.port, kind, "/", own).status == let_in
    assert Answer(trainer.port, kind, "/", own, ("Host", "attacker.example")).status == 403


@KINDS
@pytest.mark.parametrize(
    "origin",
    [
        "null", "", "file://", "http://attacker.example", "https://attacker.example:PORT",
        "http://localhost", "http://localhost:1", "http://127.0.0.1:PORT", "localhost:PORT",
        "http://localhost.attacker.example:PORT", "http://attacker.example@localhost:PORT",
        "http://localhost:PORT http://attacker.example", "ftp://localhost:PORT", "http://löcalhost:PORT",
    ],
)  # fmt: skip
def test_a_page_of_another_origin_is_refused(
    trainer: Trainer, asking: int, origin: str, kind: dict[str, str], let_in: int
) -> None:
    own = {"Host": "localhost:PORT"}
    for port in (trainer.port, asking):
        answer = Answer(port, own | kind | {"Origin": origin}, f"/?token={TOKEN}")
        assert answer.status == 403
        assert answer.text == guard.FOREIGN_ORIGIN
        assert "Set-Cookie" not in answer.headers
    both = ("Origin", "http://localhost:PORT")
    assert Answer(trainer.port, own | kind | {"Origin": origin}, "/", both).status == 403
    assert Answer(trainer.port, own | kind, "/", both).status == let_in


@KINDS
@pytest.mark.parametrize(
    ("path", "cookie"),
    [
        ("/", ""),
        ("/index.html", ""),
        ("/?token=", ""),
        ("/?token=another-token-of-24-char", ""),
        (f"/?token={TOKEN[:-1]}", ""),
        (f"/?token={TOKEN}x", ""),
        (f"/?token={TOKEN}&token={TOKEN}", ""),
        (f"/{TOKEN}", ""),
        ("/?token=%ff%ed%a0%80\N{LATIN SMALL LETTER E WITH ACUTE}", ""),
        ("/", "bluntdissect-PORT="),
        ("/", f"bluntdissect-PORT={TOKEN}"),
        ("/", "bluntdissect-PORT=é; =; ;;"),
        ("/", f"token={TOKEN}"),
    ],
)
def test_nobody_gets_in_without_the_token(
    asking: int, path: str, cookie: str, kind: dict[str, str], let_in: int
) -> None:
    answer = Answer(asking, {"Host": "127.0.0.1:PORT", "Cookie": cookie} | kind, path)
    assert answer.status == 403 != let_in
    assert answer.text == guard.NO_TOKEN
    assert "Set-Cookie" not in answer.headers


@KINDS
def test_a_link_gives_a_cookie_that_lets_in(
    asking: int, kind: dict[str, str], let_in: int, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    own = {"Host": "localhost:PORT"}
    entered = Answer(asking, own, f"/?token={TOKEN}")
    assert entered.status == 200
    assert 'http-equiv="refresh"' in entered.text  # that this leads on is tried in a browser, below
    assert entered.headers["Cache-Control"] == "no-store"
    cookie, *attributes = entered.headers["Set-Cookie"].split("; ")
    assert set(attributes) == {"Path=/", "HttpOnly", "SameSite=Strict"}
    assert TOKEN not in str(entered.headers) + entered.text
    assert Answer(asking, own | kind | {"Cookie": f"other=1; {cookie}"}).status == let_in
    for wrong in (cookie[:-1], f"{cookie}0", cookie.replace(f"-{asking}=", f"-{asking + 1}=")):
        assert Answer(asking, own | kind | {"Cookie": wrong}).status == 403
    foreign = own | kind | {"Cookie": cookie, "Origin": "http://localhost:1"}
    assert Answer(asking, foreign).status == 403
    assert TOKEN not in caplog.text
    assert cookie.partition("=")[2] not in caplog.text


def test_a_link_on_another_site_opens_the_page(browser: Browser, asking: int) -> None:
    """From a mail or a chat: a browser then holds a strict cookie back from redirects."""
    with browser.new_context() as context:
        context.set_default_timeout(PATIENCE)
        page = context.new_page()
        page.goto(f"data:text/html,<a href='http://localhost:{asking}/?token={TOKEN}'>Train</a>")
        with page.expect_websocket() as opened:
            page.get_by_text("Train").click()
        opened.value.wait_for_event("framereceived")
        assert page.url == f"http://localhost:{asking}/"
        assert page.evaluate("document.cookie") == ""
        page.go_back()
        assert page.url.startswith("data:")  # the token is not in the history


def test_a_balancer_sees_whether_the_sessions_go_on_and_no_site_does(
    trainer: Trainer, asking: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = {"Host": "localhost:PORT"}
    for port in (trainer.port, asking):
        answer = Answer(port, own, "/healthz")
        assert (answer.status, answer.text) == (200, "ok\n")
        assert Answer(port, own | {"Origin": "http://attacker.example"}, "/healthz").status == 403
        assert Answer(port, {"Host": "attacker.example"}, "/healthz").status == 403
    monkeypatch.setattr(trainer._guard, "healthy", lambda: False)
    assert Answer(trainer.port, own, "/healthz").status == 503
    assert trainer._goes_on()
    monkeypatch.setattr(server, "LONGEST_STANDING", -1.0)
    assert not trainer._goes_on()


def test_figures_are_served_to_who_has_the_token_and_only_when_asked_for(
    trainer: Trainer, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = {"Host": "localhost:PORT"}
    assert Answer(trainer.port, own, "/metrics").status == 404
    guard = trainer._guard
    monkeypatch.setattr(
        guard,
        "metrics",
        trainer_metrics(lambda: len(trainer.frames), trainer.timer, trainer.connections),
    )
    answer = Answer(trainer.port, own, "/metrics")
    assert answer.status == 200
    assert answer.headers["Content-Type"].startswith("text/plain; version=0.0.4")
    figures = {
        sample.name: sample.value
        for family in text_string_to_metric_families(answer.text)
        for sample in family.samples
        if not sample.labels
    }
    assert 0 < figures["bluntdissect_ticks"] <= trainer.timer.ticks
    assert figures["bluntdissect_pages"] == len(trainer._views)
    assert {"bluntdissect_connections", "bluntdissect_upload_bytes"} < figures.keys()
    monkeypatch.setattr(guard, "token", TOKEN)
    for bearer in ({}, {"Authorization": f"Bearer {TOKEN}x"}, {"Authorization": TOKEN}):
        assert Answer(trainer.port, own | bearer, "/metrics").status == 401
    right = {"Authorization": f"Bearer {TOKEN}"}
    assert Answer(trainer.port, own | right, "/metrics").status == 200
    assert Answer(trainer.port, own | right, "/").status == 403  # it opens nothing else


def test_any_address_but_loopback_asks_for_a_token() -> None:
    for host in ("127.0.0.1", "127.0.1.1", "localhost", "::1"):
        assert is_loopback(host)
        assert Guard(host).token is None
    open_to_others = ("0.0.0.0", "::", "", "192.168.1.7", "machine.example", "127.1", "localhost.")
    tokens = {Guard(host).token for host in open_to_others}
    assert len(tokens) == len(open_to_others)
    assert all(re.fullmatch(r"[\w-]{32}", token or "") for token in tokens)


def test_at_another_address_the_link_has_the_token_and_any_name_does() -> None:
    # Loopback in truth, so that the test opens nothing; but not as it stands.
    running = Trainer(phantom(), host="127.1", port=0, scene="free", look="plain")
    try:
        address, token = running.link.split("/?token=")
        assert address == running.address
        for name in ("127.1", "classroom.example"):
            own = {"Host": f"{name}:PORT", "Origin": f"http://{name}:PORT"}
            assert Answer(running.port, own).status == 403
            cookie = Answer(running.port, own, f"/?token={token}").headers["Set-Cookie"]
            for kind, let_in in (({}, 200), (UPGRADE, 101)):
                assert Answer(running.port, own | kind | {"Cookie": cookie}).status == let_in
    finally:
        running.stop()


def test_a_link_names_an_address_that_others_can_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    for host in ("localhost", "192.168.1.7", "2001:db8::1"):
        assert _own_address(host) == host
    wildcards = ("0.0.0.0", "::", "")
    assert not {*map(_own_address, wildcards)} & {*wildcards}

    def unreachable(*_: object) -> None:
        raise OSError

    monkeypatch.setattr(socket.socket, "connect", unreachable)
    assert {*map(_own_address, wildcards)} == {"localhost"}


def test_the_token_of_a_file_is_asked_for_and_printed_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "token"
    file.write_text(f"{TOKEN}\n", encoding="utf-8")
    monkeypatch.setenv(TOKEN_VARIABLE, "the-token-of-the-environment")
    with started("--port", 0, "--look", "plain", "--token-file", file) as (process, link):
        address, _, token = link.partition("/?token=")
        assert token == TOKEN
        port = int(address.removeprefix("http://127.0.0.1:"))
        own = {"Host": "localhost:PORT"}
        assert Answer(port, own).status == 403
        assert Answer(port, own, f"/?token={TOKEN}").status == 200
        assert Answer(port, own, "/?token=the-token-of-the-environment").status == 403
        process.terminate()
        out, errors = process.communicate(timeout=LONGEST)
        assert errors == ""
        assert TOKEN not in out


def test_a_token_that_is_none_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert str(tmp_path / "nowhere") in refused(("trainer", "--token-file", tmp_path / "nowhere"))
    file = tmp_path / "token"
    words = "must be 16 to 200 letters, digits, - or _"
    for token in (b"", b"short", b"with spaces and more of them", b"a" * 201, b"\xff" * 20):
        file.write_bytes(token)
        assert words in refused(("trainer", "--port", 0, "--token-file", file))
    monkeypatch.setenv(TOKEN_VARIABLE, "short")
    assert words in refused(("trainer", "--port", 0))


class Terminal(io.TextIOWrapper):
    """Keeps what is printed in a terminal."""

    def isatty(self) -> bool:
        return True


def test_the_link_is_drawn_as_a_code_that_a_camera_reads(monkeypatch: pytest.MonkeyPatch) -> None:
    link = f"http://192.168.1.7:8080/?token={TOKEN}"
    drawn: dict[str, str] = {}
    for encoding in ("utf-8", "ascii"):
        monkeypatch.setattr(sys, "stdout", terminal := Terminal(io.BytesIO(), encoding))
        draw_link(link)
        terminal.seek(0)
        drawn[encoding] = terminal.read()
    monkeypatch.undo()
    assert drawn["ascii"] == ""  # such a terminal has no blocks
    halves = [
        [255 * (block in blocks) for block in line]
        for line in drawn["utf-8"].splitlines()
        for blocks in ("█▀", "█▄")
    ]
    picture = np.kron(np.array(halves, np.uint8), np.ones((8, 8), np.uint8))
    assert cv2.QRCodeDetector().detectAndDecode(picture)[0] == link


def test_a_link_of_this_machine_alone_is_not_drawn_for_phones(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for link in ("http://127.0.0.1:8080/", "http://localhost:8080/", "http://[::1]:8080/"):
        draw_link(link)
        assert "--host 0.0.0.0" in capsys.readouterr().out
