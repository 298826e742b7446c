"""Access control of the trainer: each request, page or websocket, is checked before viser sees it.

A page of any site can reach a loopback address through the browser, by a cross-site websocket or by
DNS rebinding (a name of the site that resolves to 127.0.0.1). It cannot choose the headers Origin
and Host that the browser sends, so on loopback both must name this machine. At any other address
a request also needs a token: it stands in the printed link, which gives the browser a cookie.
"""

import hmac
import re
import secrets
from collections.abc import Callable
from http import HTTPStatus
from ipaddress import ip_address
from urllib.parse import parse_qs

from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from app.trainer.server.bounds import Connections, PageConnection

__all__ = ["TOKEN_VARIABLE", "Guard", "is_loopback"]

TOKEN_VARIABLE = "BLUNTDISSECT_TOKEN"  # noqa: S105
"""Environment variable that can give the token."""

TOKEN_BYTES = 24
BROWSER_BYTES = 12
LONGEST_PATH = 200
RETRY_SECONDS = 10
_TOKEN = re.compile(r"[A-Za-z0-9_-]{16,200}")
_HOST = re.compile(r"(?:\[(?P<six>[^\[\]]*)\]|(?P<name>[^:\[\]]*))(?::[0-9]+)?")

FOREIGN_HOST = "This trainer serves its own machine only: open it as localhost.\n"
FOREIGN_ORIGIN = "This trainer takes nothing from pages of other sites.\n"
NO_TOKEN = "Open this trainer by the link that it printed when it started.\n"  # noqa: S105
NO_BEARER = "Send the trainer's token: Authorization: Bearer TOKEN\n"
ENTERED = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta http-equiv="refresh" content="0;url=./">
<title>Blunt dissection</title>
<a href="./">Open the trainer</a>
</html>
"""
"""Redirects to the trainer. A redirect by status (303) fails after a click in a mail or a chat: the
browser sends no SameSite=Strict cookie with a navigation that another site began."""


class Guard:
    """Lets a request through, or answers it itself.

    Parameters
    ----------
    host
        The address that is served.
    token
        What the link must have. When None, one is made; on loopback none is then needed.
    connections
        Says whether there is a place for one more page; None for always.

    Attributes
    ----------
    token
        As given or made; None where none is needed.
    healthy
        Whether the trainer goes on as it should, for `/healthz`.
    metrics
        What `/metrics` gives to who has the token, if anything.

    Raises
    ------
    ValueError
        If the token is too short to be secret, or cannot stand in a link.
    """

    def __init__(
        self, host: str, token: str | None = None, connections: Connections | None = None
    ) -> None:
        if token is not None and not _TOKEN.fullmatch(token):
            raise ValueError(
                f"the token of --token-file or {TOKEN_VARIABLE} must be 16 to 200 letters, digits, "
                "- or _"
            )
        self._loopback = is_loopback(host)
        if token is None and not self._loopback:
            token = secrets.token_urlsafe(TOKEN_BYTES)
        self.token, self._connections = token, connections
        self.healthy: Callable[[], bool] = lambda: True
        self.metrics: Callable[[], bytes] | None = None

    def __call__(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return None for a request that gets in, else its answer."""
        headers = request.headers
        hosts = headers.get_all("Host")
        if len(hosts) != 1 or (self._loopback and not _names_loopback(hosts[0])):
            return connection.respond(HTTPStatus.FORBIDDEN, FOREIGN_HOST)
        own = {f"{scheme}://{hosts[0].lower()}" for scheme in ("http", "https")}
        if any(origin.lower() not in own for origin in headers.get_all("Origin")):
            return connection.respond(HTTPStatus.FORBIDDEN, FOREIGN_ORIGIN)
        path, _, query = request.path.partition("?")
        if len(path) > LONGEST_PATH:
            return connection.respond(HTTPStatus.REQUEST_URI_TOO_LONG, "There is no such page.\n")
        if path == "/healthz":
            if self.healthy():
                return connection.respond(HTTPStatus.OK, "ok\n")
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "the sessions stand\n")
        if path == "/metrics" and self.metrics is not None:
            bearer = " ".join(headers.get_all("Authorization"))
            if self.token is None or _same(bearer, f"Bearer {self.token}"):
                figures = connection.respond(HTTPStatus.OK, self.metrics().decode())
                del figures.headers["Content-Type"]
                figures.headers["Content-Type"] = "text/plain; version=0.0.4; charset=utf-8"
                return figures
            return connection.respond(HTTPStatus.UNAUTHORIZED, NO_BEARER)
        browser = None
        if self.token is not None:
            # Cookies know no ports: another trainer on this machine has one of its own.
            name = f"bluntdissect-{connection.local_address[1]}"
            given = parse_qs(query).get("token", [])
            if len(given) == 1 and _same(given[0], self.token):
                return _entered(connection, f"{name}={self._cookie()}")
            browser = self._browser(headers.get_all("Cookie"), name)
            if browser is None:
                return connection.respond(HTTPStatus.FORBIDDEN, NO_TOKEN)
        if self._connections is None or not isinstance(connection, PageConnection):
            return None
        opens = headers.get("Upgrade") == "websocket"
        full = self._connections.admit(connection, browser, opens=opens)
        if full is None:
            return None
        response = connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, full)
        response.headers["Retry-After"] = str(RETRY_SECONDS)
        return response

    def _cookie(self, browser: str | None = None) -> str:
        """Return a browser's cookie, which a start with the same token knows again."""
        browser = secrets.token_urlsafe(BROWSER_BYTES) if browser is None else browser
        # It does not give the token away.
        proof = hmac.digest((self.token or "").encode(), b"cookie" + browser.encode(), "sha256")
        return f"{browser}.{proof.hex()}"

    def _browser(self, cookies: list[str], name: str) -> str | None:
        """Return which browser's cookie this is, if it is one of ours."""
        for each in (part.strip() for line in cookies for part in line.split(";")):
            called, _, value = each.partition("=")
            browser = value.partition(".")[0]
            if called == name and browser.isascii() and _same(value, self._cookie(browser)):
                return browser
        return None


def is_loopback(host: str) -> bool:
    """Return whether an address is this machine's alone, as it stands: other names may change."""
    try:
        return host.lower() == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


def _names_loopback(host: str) -> bool:
    """Return whether a Host header, on whatever port, is loopback's: a tunnel has its own port."""
    parts = _HOST.fullmatch(host)
    return parts is not None and is_loopback(parts["six"] or parts["name"] or "")


def _same(given: str, wanted: str) -> bool:
    """Compare in constant time; what is given may hold bytes that are no text."""
    return hmac.compare_digest(given.encode("utf-8", "surrogatepass"), wanted.encode())


def _entered(connection: ServerConnection, cookie: str) -> Response:
    response = connection.respond(HTTPStatus.OK, ENTERED)
    del response.headers["Content-Type"]
    response.headers.update(
        {
            "Content-Type": "text/html; charset=utf-8",
            "Set-Cookie": f"{cookie}; Path=/; HttpOnly; SameSite=Strict",
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
        }
    )
    return response
