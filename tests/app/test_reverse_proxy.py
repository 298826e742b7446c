"""TLS, and the trainer behind nginx and Caddy as the documentation sets them up."""

import asyncio
import re
import shutil
import socket
import ssl
import subprocess
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest
from browser import PATIENCE
from playwright.sync_api import Browser
from program import LONGEST, free_port, refused
from simulated import phantom
from test_guard import TOKEN, UPGRADE, Answer
from websockets import Subprotocol
from websockets.asyncio.client import connect

from app.command_line.serving import tls_context
from app.trainer.connections.bounds import Bounds, Connections, socket_options
from app.trainer.connections.guard import Guard
from app.trainer.server.trainer import Trainer
from app.trainer.viser_bridge.private_api import start_server, stop_server

CONFIGURATIONS = Path(__file__).parents[2] / "docs" / "proxy"
OPENSSL = shutil.which("openssl") or ""


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A certificate of localhost and its key."""
    if not OPENSSL:
        pytest.skip("openssl is not installed")
    folder = tmp_path_factory.mktemp("certificate")
    chain, key = folder / "localhost.pem", folder / "localhost.key"
    request = "req -x509 -newkey rsa:2048 -nodes -days 1 -subj /CN=localhost"
    subprocess.run(
        [
            OPENSSL,
            *request.split(),
            "-addext",
            "subjectAltName=DNS:localhost",
            "-keyout",
            key,
            "-out",
            chain,
        ],
        check=True,
        capture_output=True,
    )
    return chain, key


def test_what_is_sent_is_encrypted_with_the_certificate(certificate: tuple[Path, Path]) -> None:
    connections = Connections(Bounds())
    guard = Guard("127.0.0.1", TOKEN, connections, encrypted=True)
    server = start_server(
        "127.0.0.1", 0, guard, socket_options(connections, tls_context(*certificate))
    )
    try:
        port = server.get_port()
        trusting = ssl.create_default_context(cafile=certificate[0])
        with (
            socket.create_connection(("localhost", port)) as plain,
            trusting.wrap_socket(plain, server_hostname="localhost") as opened,
        ):
            opened.sendall(f"GET /?token={TOKEN} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
            answer = opened.recv(100_000).decode()
        assert answer.startswith("HTTP/1.1 200")
        found = re.search(r"Set-Cookie: (\S+); Path=/; HttpOnly; SameSite=Strict; Secure", answer)
        assert found is not None

        # Not websockets' client of threads: one reads while another writes, of a TLS connection
        # that is not safe for threads, and now and then what it writes is lost.
        async def open_page() -> None:
            async with connect(
                f"wss://localhost:{port}",
                ssl=trusting,
                origin=f"https://localhost:{port}",  # pyright: ignore[reportArgumentType]
                additional_headers={"Cookie": found[1]},
                subprotocols=[Subprotocol(UPGRADE["Sec-WebSocket-Protocol"])],
                open_timeout=LONGEST,
            ):
                assert len(connections) == 1

        with ThreadPoolExecutor() as pool:  # this thread has a browser's loop
            pool.submit(lambda: asyncio.run(open_page())).result()
        with pytest.raises((OSError, ConnectionError)):
            Answer(port, {"Host": "localhost"})  # not encrypted
    finally:
        stop_server(server)


def test_files_that_are_no_certificate_are_refused(
    certificate: tuple[Path, Path], tmp_path: Path
) -> None:
    chain, key = certificate
    assert "--key needs --certificate" in refused(("trainer", "--key", key))
    assert str(tmp_path / "no") in refused(("trainer", "--certificate", tmp_path / "no"))
    words = "must be a certificate with its own key, both PEM and without a password"
    assert words in refused(("trainer", "--certificate", key, "--key", key))
    assert words in refused(("trainer", "--certificate", chain))


def test_public_addresses_that_are_none_are_refused() -> None:
    for url in ("class.example", "ftp://class.example", "https://", "https://class.example/a b",
                "https://class.example/?a=1", "https://a:b@class.example"):  # fmt: skip
        assert "--public-url must be like" in refused(("trainer", "--public-url", url))
    assert "needs --public-url" in refused(("trainer", "--trust-proxy", "127.0.0.1"))
    public = ("trainer", "--public-url", "https://class.example/duct/")
    assert "--trust-proxy must be an address" in refused((*public, "--trust-proxy", "nginx"))


def test_only_the_proxy_is_believed_and_only_about_the_last_address(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each client may write X-Forwarded-For itself; the proxy adds to it who that was."""
    own = {"Host": "class.example", "Origin": "https://class.example"}
    for proxy, addresses in (("127.0.0.1", {"192.0.2.7"}), ("192.0.2.1", {"127.0.0.1"})):
        connections = Connections(Bounds(), None, proxy)
        seen: list[str] = []
        monkeypatch.setattr(
            connections, "admit", lambda page, *_, to=seen, **__: to.append(page.address)
        )
        guard = Guard("127.0.0.1", TOKEN, connections, public_url="https://class.example/duct/")
        server = start_server("127.0.0.1", 0, guard, socket_options(connections))
        try:
            port = server.get_port()
            entered = Answer(port, own, f"/?token={TOKEN}")
            assert "url=/duct/" in entered.text
            cookie, attributes = entered.headers["Set-Cookie"].split("; ", 1)
            assert attributes == "Path=/duct; HttpOnly; SameSite=Strict; Secure"
            forwarded = own | {"Cookie": cookie, "X-Forwarded-For": "10.0.0.1, 192.0.2.7"}
            assert Answer(port, forwarded).status == 200
            assert Answer(port, forwarded | {"X-Forwarded-For": "no address"}).status == 200
            assert Answer(port, forwarded | {"Host": "localhost"}).status == 403
            # A container asks itself whether it is well, and that only.
            for host, status in (("127.0.0.1:8080", 200), ("192.0.2.9", 403)):
                assert Answer(port, {"Host": host}, "/healthz").status == status
            assert Answer(port, forwarded | {"Origin": "http://localhost"}).status == 403
        finally:
            stop_server(server)
        assert {*seen[:1]} == addresses
        assert seen[1] == "127.0.0.1"


Proxy = Callable[[Path, int, int, tuple[Path, Path]], AbstractContextManager[None]]


@contextmanager
def nginx(folder: Path, port: int, upstream: int, files: tuple[Path, Path]) -> Iterator[None]:
    text = (CONFIGURATIONS / "nginx.conf").read_text(encoding="utf-8")
    for named, here in (
        ("listen 443 ssl", f"listen 127.0.0.1:{port} ssl"), ("class.example;", "localhost;"),
        ("/etc/ssl/class.example.pem", str(files[0])),
        ("/etc/ssl/class.example.key", str(files[1])), (":8080", f":{upstream}"),
    ):  # fmt: skip
        assert named in text
        text = text.replace(named, here)
    places = "".join(
        f"{each}_temp_path {folder}/{each};\n"
        for each in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    (folder / "nginx.conf").write_text(
        f"daemon off; master_process off; pid {folder}/pid; error_log stderr;\n"
        f"events {{}}\nhttp {{ access_log off;\n{places}{text}}}\n"
    )
    yield from running(["nginx", "-c", str(folder / "nginx.conf"), "-p", str(folder)], port)


@contextmanager
def caddy(folder: Path, port: int, upstream: int, files: tuple[Path, Path]) -> Iterator[None]:
    text = (CONFIGURATIONS / "Caddyfile").read_text(encoding="utf-8")
    site = f"https://localhost:{port} {{\n\tbind 127.0.0.1\n\ttls {files[0]} {files[1]}"
    for named, here in (("\nclass.example {", f"\n{site}"), (":8080", f":{upstream}")):
        assert named in text
        text = text.replace(named, here)
    own = "{\n\tadmin off\n\tauto_https disable_redirects\n}\n"
    (folder / "Caddyfile").write_text(own + text)
    command = ["caddy", "run", "--adapter", "caddyfile", "--config", str(folder / "Caddyfile")]
    yield from running(command, port, {"HOME": str(folder), "XDG_DATA_HOME": str(folder)})


def running(
    command: list[str], port: int, environment: dict[str, str] | None = None
) -> Iterator[None]:
    """Run a server until it is no longer needed."""
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment) as process:
        try:
            deadline = time.monotonic() + 180.0
            while True:
                try:
                    socket.create_connection(("127.0.0.1", port)).close()
                    break
                except ConnectionRefusedError:
                    assert process.poll() is None, process.stderr and process.stderr.read()
                    assert time.monotonic() < deadline
                    time.sleep(0.05)
            yield
        finally:
            process.terminate()


@pytest.mark.parametrize(
    ("name", "proxy"), [("nginx", nginx), pytest.param("caddy", caddy, marks=pytest.mark.long)]
)
def test_behind_a_proxy_under_a_path_a_browser_gets_in_and_trains(
    name: str, proxy: Proxy, certificate: tuple[Path, Path], browser: Browser, tmp_path: Path
) -> None:
    if shutil.which(name) is None:
        pytest.skip(f"{name} is not installed")
    port = free_port()
    running = Trainer(
        phantom(), port=0, look="plain", scene="free", public_url=f"https://localhost:{port}/duct/",
        trusted_proxy="127.0.0.1",
    )  # fmt: skip
    try:
        assert running.link.startswith(f"https://localhost:{port}/duct/?token=")
        with (
            proxy(tmp_path, port, running.port, certificate),
            browser.new_context(ignore_https_errors=True) as context,
        ):
            context.set_default_timeout(PATIENCE)
            page = context.new_page()
            page.goto(running.link)
            page.get_by_text("Force F (N)").first.wait_for()
            assert page.url.startswith(f"https://localhost:{port}/duct/")
            assert "token" not in page.url
            refused = context.browser
            assert refused is not None
            with refused.new_context(ignore_https_errors=True) as stranger:
                answer = stranger.request.get(f"https://localhost:{port}/duct/")
                assert answer.status == 403
    finally:
        running.stop()
