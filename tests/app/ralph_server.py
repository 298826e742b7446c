"""Ralph, a learning record store, in an environment of its own: `make test-all` makes that.

`python ralph_server.py FOLDER KEY SECRET` prints its address and serves from files in the folder.
"""

import json
import os
import socket
import sys
from pathlib import Path


def serve(folder: Path, key: str, secret: str) -> None:
    """Serve on a port of its own until the process is ended."""
    (folder / "lrs").mkdir(parents=True)
    os.environ |= {
        "RALPH_APP_DIR": str(folder),
        "RALPH_AUTH_FILE": str(folder / "auth.json"),
        "RALPH_RUNSERVER_BACKEND": "fs",
        "RALPH_BACKENDS__LRS__FS__DEFAULT_DIRECTORY_PATH": str(folder / "lrs"),
    }
    # Ralph reads these as it is imported.
    import bcrypt  # pyright: ignore[reportMissingImports]
    import uvicorn  # pyright: ignore[reportMissingImports]
    from ralph.api import app  # pyright: ignore[reportMissingImports]
    from ralph.backends.data.base import (  # pyright: ignore[reportMissingImports]
        BaseOperationType,
    )
    from ralph.backends.lrs.fs import FSLRSBackend  # pyright: ignore[reportMissingImports]

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


if __name__ == "__main__":
    serve(Path(sys.argv[1]), *sys.argv[2:])
