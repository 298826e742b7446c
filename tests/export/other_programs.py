"""Other people's programs that read what is exported: npm's, the system's, three.js in a page."""

import json
import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
from browser import new_context, running_browser
from playwright.sync_api import Page, Route

HERE = Path(__file__).parent
PACKAGES = HERE / "node_modules"
ADDRESS = "http://127.0.0.1"
"""Of the page, which the browser is given without a server."""


def missing(what: str) -> NoReturn:
    """Skip a test whose program is not here, or fail where all must be."""
    if os.environ.get("REQUIRE_BROWSER") == "1":
        pytest.fail(what)
    pytest.skip(what)


def package(name: str) -> Path:
    """The folder of an npm package that `make test` installs."""
    folder = PACKAGES / name
    if not folder.is_dir():
        missing(f"{name} is not installed: run `make test` with npm at hand")
    return folder


def program(name: str) -> str:
    """The path of a program of the system."""
    found = shutil.which(name)
    if found is None:
        missing(f"{name} is not installed")
    return str(found)


def validated(*files: Path) -> list[dict[str, dict[str, object]]]:
    """What the Khronos validator says about glTF files."""
    package("gltf-validator")
    done = subprocess.run(
        [program("node"), HERE / "validate.cjs", *files],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def statement_faults(statements: Sequence[object], file: Path) -> list[int]:
    """How many faults Learning Locker's validator finds in each xAPI statement of 1.0.3.

    `file` is written with them.
    """
    checker = package("@learninglocker/xapi-validation")
    file.write_text(json.dumps(statements))
    script = (
        f"const check = require({json.dumps(str(checker))});"
        f"const all = JSON.parse(require('fs').readFileSync({json.dumps(str(file))}));"
        "console.log(JSON.stringify(all.map(each => check.default(each).length)))"
    )
    done = subprocess.run(
        [program("node"), "-e", script], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


class Viewer:
    """A page in which three.js plays one GLB."""

    def __init__(self, page: Page) -> None:
        self.page = page

    @property
    def clips(self) -> dict[str, float]:
        """Durations of the animations, s."""
        return dict(self.page.evaluate("() => viewer.clips"))

    def places(self, clip: str, time: float) -> dict[str, np.ndarray]:
        """(V, 3) places of the vertices of each mesh at a time of an animation, m."""
        self.page.evaluate("([clip, time]) => viewer.play(clip, time)", [clip, time])
        found = self.page.evaluate("() => viewer.places()")
        return {
            name: np.concatenate([np.array(each).reshape(-1, 3) for each in pieces])
            for name, pieces in found.items()
        }


@contextmanager
def three_viewer(glb: bytes) -> Iterator[Viewer]:
    """A viewer with a GLB in it, which draws nothing; fails on any error in the page."""
    three = package("three")
    errors: list[str] = []

    def answer(route: Route) -> None:
        path = route.request.url.removeprefix(ADDRESS)
        if path == "/":
            route.fulfill(path=HERE / "viewer.html", content_type="text/html")
        elif path == "/organ.glb":
            route.fulfill(body=glb, content_type="model/gltf-binary")
        elif path.startswith("/three/"):
            route.fulfill(path=three / path.removeprefix("/three/"), content_type="text/javascript")
        else:
            route.fulfill(status=404 if path != "/favicon.ico" else 204)

    with running_browser(drawing=False) as browser:
        page = new_context(browser).new_page()
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on(
            "console",
            lambda message: errors.append(message.text) if message.type == "error" else None,
        )
        page.route("**/*", answer)
        page.goto(f"{ADDRESS}/")
        page.wait_for_function("() => window.viewer")
        yield Viewer(page)
        assert not errors, errors
