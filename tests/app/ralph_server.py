"""Ralph, a learning record store, in an environment of its own: `make test-all` makes that.

`python ralph_server.py FOLDER KEY SECRET` prints its address and serves from files in the folder.
"""

import json
import os
import socket
import sys
from pathlib import Path

folder, (key, secret) = Path(sys.argv[1]), sys.argv[2:]
(folder / "lrs").mkdir(parents=True)
# Ralph reads these as it is imported.
os.environ |= {
    "RALPH_APP_DIR": str(folder),
    "RALPH_AUTH_FILE": str(folder / "auth.json"),
    "RALPH_RUNSERVER_BACKEND": "fs",
    "RALPH_BACKENDS__LRS__FS__DEFAULT_DIRECTORY_PATH": str(folder / "lrs"),
}

import bcrypt  # noqa: E402  # pyright: ignore[reportMissingImports]
import uvicorn  # noqa: E402  # pyright: ignore[reportMissingImports]
from ralph.api import app  # noqa: E402  # pyright: ignore[reportMissingImports]
from ralph.backends.data.base import (  # noqa: E402  # pyright: ignore[reportMissingImports]
    BaseOperationType,
)
from ralph.backends.lrs.fs import (  # noqa: E402  # pyright: ignore[reportMissingImports]
    FSLRSBackend,
)

# What it does by default, to create a file, refuses the second request.
FSLRSBackend.default_operation_type = BaseOperationType.APPEND
user = {
    "username": key,
    "hash": bcrypt.hashpw(secret.encode(), bcrypt.gensalt(4)).decode(),
    "scopes": ["all"],
    "agent": {"mbox": "mailto:trainer@example.org"},
}
(folder / "auth.json").write_text(json.dumps([user]))
listening = socket.create_server(("127.0.0.1", 0))
print(f"http://127.0.0.1:{listening.getsockname()[1]}/xAPI", flush=True)
uvicorn.Server(uvicorn.Config(app, log_level="critical")).run(sockets=[listening])
