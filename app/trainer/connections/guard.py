"""Access control of the trainer: each request, page or websocket, is checked before viser sees it.

A page of any site can reach a loopback address through the browser, by a cross-site websocket or by
DNS rebinding (a name of the site that resolves to 127.0.0.1). It cannot choose the headers Origin
and Host that the browser sends, so on loopback both must name this machine. At any other address
a request also needs a token: it stands in the printed link, which gives the browser a cookie.
Behind a reverse proxy both headers must name the proxy's public address.
"""

import hmac
import re
import secrets
from collections.abc import Awaitable, Callable
from http import HTTPStatus
from ipaddress import ip_address
from urllib.parse import SplitResult, parse_qs, urlsplit

from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from app.trainer.connections.bounds import Connections, PageConnection

Answer = Response | Awaitable[Response] | None
"""What a request gets, now or later; None lets it through to viser."""

TOKEN_VARIABLE = "BLUNTDISSECT_TOKEN"  # noqa: S105
"""Environment variable that can give the token."""

TOKEN_BYTES = 24
BROWSER_BYTES = 12
LONGEST_PATH = 200
CLASS_PATH = "/class"
RETRY_SECONDS = 10
_TOKEN = re.compile(r"[A-Za-z0-9_-]{16,200}")
_PATH = re.compile(r"(/[\w.~-]+)*", re.ASCII)
_HOST = re.compile(r"(?:\[(?P<six>[^\[\]]*)\]|(?P<name>[^:\[\]]*))(?::[0-9]+)?")

FOREIGN_HOST = "This trainer serves its own machine only: open it as localhost.\n"
OTHER_HOST = "This trainer is served under another name.\n"
FOREIGN_ORIGIN = "This trainer takes nothing from pages of other sites.\n"
NO_TOKEN = "Open this trainer by the link that it printed when it started.\n"  # noqa: S105
NOT_THE_TEACHER = "Open this page by the teacher's link.\n"
NO_BEARER = "Send the trainer's token: Authorization: Bearer TOKEN\n"
# Redirects to the trainer. A redirect by status (303) fails after a click in a mail or a chat: the
# browser sends no SameSite=Strict cookie with a navigation that another site began.
ENTERED = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta http-equiv="refresh" content="0;url=PLACE">
<title>Blunt dissection</title>
<a href="PLACE">Open the trainer</a>
</html>
"""


class Guard:
    """Lets a request through, or answers it itself.

    Parameters
    ----------
    host, public_url
        The address that is served, and where a reverse proxy serves it to others, if one does.
    token, teacher_token
        What the link must have, made when None: on loopback none is then needed. What the teacher's
        link must have, whose cookie alone opens `/class`; None for no class.
    encrypted
        Whether the trainer itself speaks TLS.
    connections
        Says whether there is a place for one more page; None for always.

    Attributes
    ----------
    teacher_page
        Answers the teacher's requests below `/class`.
    healthy
        Whether the trainer goes on as it should, for `/healthz`.
    metrics
        What `/metrics` gives to who has the token, if anything.

    Raises
    ------
    ValueError
        If the token is too short to be secret or cannot stand in a link, or the URL is none.
    """

    def __init__(
        self,
        host: str,
        token: str | None = None,
        connections: Connections | None = None,
        *,
        public_url: str | None = None,
        encrypted: bool = False,
        teacher_token: str | None = None,
    ) -> None:
        if token is not None and not _TOKEN.fullmatch(token):
            raise ValueError(
                f"the token of --token-file or {TOKEN_VARIABLE} must be 16 to 200 letters, digits, "
                "- or _"
            )
        self._public = None if public_url is None else _public(public_url)
        self._loopback = is_loopback(host) and self._public is None
        if token is None and not self._loopback:
            token = secrets.token_urlsafe(TOKEN_BYTES)
        self.token, self._connections = token, connections
        self._teacher_token = teacher_token
        self.teacher_page: Callable[[PageConnection, Request], Answer] | None = None
        path = "" if self._public is None else self._public.path
        self._place = f"{path}/" if path else "./"
        secure = encrypted if self._public is None else self._public.scheme == "https"
        self._attributes = f"Path={path or '/'}; HttpOnly; SameSite=Strict{'; Secure' * secure}"
        self.healthy: Callable[[], bool] = lambda: True
        self.metrics: Callable[[], bytes] | None = None

    def __call__(self, connection: ServerConnection, request: Request) -> Answer:
        """Return None for a request that gets in, else its answer."""
        headers = request.headers
        if isinstance(connection, PageConnection):
            connection.take_client(headers.get_all("X-Forwarded-For"))
        hosts = headers.get_all("Host")
        if len(hosts) != 1 or (self._loopback and not _names_loopback(hosts[0])):
            return connection.respond(HTTPStatus.FORBIDDEN, FOREIGN_HOST)
        # A container asks itself whether it is well.
        asks_itself = request.path == "/healthz" and _names_loopback(hosts[0])
        if self._public is not None and hosts[0].lower() != self._public.netloc and not asks_itself:
            return connection.respond(HTTPStatus.FORBIDDEN, OTHER_HOST)
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
            given, cookies = parse_qs(query).get("token", []), headers.get_all("Cookie")
            if len(given) == 1 and _same(given[0], self.token):
                return self._entered(connection, name, self.token, self._place)
            browser = self._browser(cookies, name, self.token)
            if isinstance(connection, PageConnection):
                connection.trainee = browser
            if self._teacher_token is not None:
                place, name = f"{self._place}{CLASS_PATH[1:]}/", f"{name}-teacher"
                if len(given) == 1 and _same(given[0], self._teacher_token):
                    return self._entered(connection, name, self._teacher_token, place)
                teacher = self._browser(cookies, name, self._teacher_token)
                if isinstance(connection, PageConnection):
                    connection.is_teacher = teacher is not None
                browser = browser or teacher
                if path == CLASS_PATH or path.startswith(f"{CLASS_PATH}/"):
                    if teacher is None:
                        return connection.respond(HTTPStatus.FORBIDDEN, NOT_THE_TEACHER)
                    return self._teachers(connection, request, teacher)
            if browser is None:
                return connection.respond(HTTPStatus.FORBIDDEN, NO_TOKEN)
        return self._placed(connection, request, browser)

    def _teachers(self, connection: ServerConnection, request: Request, browser: str) -> Answer:
        """Return the answer of the teacher's page."""
        if self.teacher_page is None or not isinstance(connection, PageConnection):
            return connection.respond(HTTPStatus.NOT_FOUND, "There is no such page.\n")
        full = self._placed(connection, request, browser)
        return self.teacher_page(connection, request) if full is None else full

    def _placed(
        self, connection: ServerConnection, request: Request, browser: str | None
    ) -> Response | None:
        """Return None for a request that gets a place, else its answer."""
        if self._connections is None or not isinstance(connection, PageConnection):
            return None
        opens = request.headers.get("Upgrade") == "websocket"
        full = self._connections.admit(connection, browser, opens=opens)
        if full is None:
            return None
        response = connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, full)
        response.headers["Retry-After"] = str(RETRY_SECONDS)
        return response

    def _entered(self, connection: ServerConnection, name: str, token: str, place: str) -> Response:
        response = connection.respond(HTTPStatus.OK, ENTERED.replace("PLACE", place))
        del response.headers["Content-Type"]
        response.headers.update(
            {
                "Content-Type": "text/html; charset=utf-8",
                "Set-Cookie": f"{name}={_cookie(token)}; {self._attributes}",
                "Cache-Control": "no-store",
                "Referrer-Policy": "no-referrer",
            }
        )
        return response

    @staticmethod
    def _browser(cookies: list[str], name: str, token: str) -> str | None:
        for each in (cookie.strip() for line in cookies for cookie in line.split(";")):
            called, _, value = each.partition("=")
            browser = value.partition(".")[0]
            if called == name and browser.isascii() and _same(value, _cookie(token, browser)):
                return browser
        return None


def _cookie(token: str, browser: str | None = None) -> str:
    """Return a browser's cookie, which a start with the same token knows again."""
    browser = secrets.token_urlsafe(BROWSER_BYTES) if browser is None else browser
    # It does not give the token away.
    proof = hmac.digest(token.encode(), b"cookie" + browser.encode(), "sha256")
    return f"{browser}.{proof.hex()}"


def is_loopback(host: str) -> bool:
    """Return whether an address is this machine's alone, as it stands: other names may change."""
    try:
        return host.lower() == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


def opens_elsewhere(link: str) -> bool:
    """Return whether other machines can open a link."""
    return not is_loopback(urlsplit(link).hostname or "")


def _public(url: str) -> SplitResult:
    """Return the parts of a public URL, without a slash at its end."""
    address = urlsplit(url.rstrip("/"))
    plain = _PATH.fullmatch(address.path) and not (
        address.query or address.fragment or address.username
    )
    if address.scheme not in ("http", "https") or not address.netloc or not plain:
        raise ValueError(f"--public-url must be like https://class.example/duct/, not {url}")
    return address._replace(netloc=address.netloc.lower())


def _names_loopback(host: str) -> bool:
    """Return whether a Host header, on whatever port, is loopback's: a tunnel has its own port."""
    address = _HOST.fullmatch(host)
    return address is not None and is_loopback(address["six"] or address["name"] or "")


def _same(given: str, wanted: str) -> bool:
    """Compare in constant time; what is given may hold bytes that are no text."""
    return hmac.compare_digest(given.encode("utf-8", "surrogatepass"), wanted.encode())
