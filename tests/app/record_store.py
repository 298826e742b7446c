"""A learning record store for tests: keeps statements in SQLite, and fails as often as it is told.

It answers as xAPI says: 200 or 204, 400 for what is no statement of a version it knows, 401 without
a key, 409 for other content under an id that it has. It fails (503) before and after it has stored.
`python tests/app/record_store.py FILE SHARE` prints its port.
"""

import base64
import json
import random
import sqlite3
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

KEY, SECRET = "trainer", "s:ecret"


class RecordStore(ThreadingHTTPServer):
    """A store on a port of its own."""

    daemon_threads = True

    def __init__(self, path: Path, failing: float = 0.0) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.path, self.failing, self.random = path, failing, random.Random(1)
        self.lock, self.asked, self.retry_after = threading.Lock(), 0, ""
        with self.opened() as db:
            db.execute("CREATE TABLE IF NOT EXISTS statement (id TEXT PRIMARY KEY, body TEXT)")

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/xapi"

    def opened(self) -> sqlite3.Connection:
        return sqlite3.connect(self.path, timeout=30.0)

    def kept(self) -> dict[str, dict[str, object]]:
        db = self.opened()
        found = dict(db.execute("SELECT id, body FROM statement").fetchall())
        db.close()
        return {key: json.loads(body) for key, body in found.items()}

    def fails(self) -> bool:
        with self.lock:
            return self.random.random() < self.failing

    def keep(self, statements: list[dict[str, object]]) -> int:
        with self.lock, self.opened() as db:
            for each in statements:
                body = json.dumps(each, sort_keys=True)
                old = db.execute(
                    "SELECT body FROM statement WHERE id = ?", (each["id"],)
                ).fetchone()
                if old is not None and old[0] != body:
                    db.rollback()
                    return 409
                db.execute("INSERT OR IGNORE INTO statement VALUES (?, ?)", (each["id"], body))
        return 200


class Handler(BaseHTTPRequestHandler):
    """One request."""

    server: RecordStore  # pyright: ignore[reportIncompatibleVariableOverride]
    protocol_version = "HTTP/1.1"

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Say nothing."""

    def do_POST(self) -> None:
        self.answer(200)

    def do_PUT(self) -> None:
        self.answer(204)

    def answer(self, good: int) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.server.asked += 1
        code = self.code(body)
        code = good if code == 200 else code
        message = b"no" if code >= 400 else b""
        self.send_response(code)
        if code >= 400 and self.server.retry_after:
            self.send_header("Retry-After", self.server.retry_after)
        self.send_header("Content-Length", str(len(message)))
        self.end_headers()
        self.wfile.write(message)

    def code(self, body: bytes) -> int:
        pair = base64.b64encode(f"{KEY}:{SECRET}".encode()).decode()
        if self.headers["Authorization"] != f"Basic {pair}":
            return 401
        if self.headers["X-Experience-API-Version"] not in ("1.0.3", "2.0.0"):
            return 400
        if self.server.fails():
            return 503
        found = json.loads(body)
        statements = found if isinstance(found, list) else [found]
        asked = parse_qs(urlsplit(self.path).query).get("statementId")
        if any("verb" not in each for each in statements) or (
            asked is not None and asked != [statements[0]["id"]]
        ):
            return 400
        code = self.server.keep(statements)
        return 503 if self.server.fails() else code


if __name__ == "__main__":
    served = RecordStore(Path(sys.argv[1]), float(sys.argv[2]))
    print(served.url, flush=True)
    served.serve_forever()
