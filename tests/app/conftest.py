"""What the trainer's tests share: one browser, one trainer, and a scene without a page."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import viser
from browser import running_browser
from own_organ import tube_file  # noqa: F401  (a fixture)
from playwright.sync_api import Browser
from simulated import phantom

from app.classroom.store import ClassStore
from app.compression.build_process import BuildProcess
from app.trainer.server.trainer import Trainer


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Pages in it draw no scene, which costs most: a test that looks at pixels says so."""
    with running_browser(drawing=False) as running:
        yield running


@pytest.fixture(scope="session")
def drawing_browser() -> Iterator[Browser]:
    with running_browser(drawing=True) as running:
        yield running


@pytest.fixture(scope="session")
def trainer() -> Iterator[Trainer]:
    """The plain look; each page has a session of its own."""
    running = Trainer(
        phantom(), port=0, look="plain", scene="free", build_process=BuildProcess(seconds=600.0)
    )
    running.warm_up.wait("free")
    yield running
    running.stop()


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    running = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield running
    running.stop()


@pytest.fixture
def scene(server: viser.ViserServer) -> viser.SceneApi:
    return server.scene


@pytest.fixture
def store(tmp_path: Path) -> Iterator[ClassStore]:
    made = ClassStore.new(tmp_path / "class.sqlite", "Surgery 3A")
    yield made
    made.close()
