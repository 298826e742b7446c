"""The wheel holds what the program needs, nothing else, and runs where nothing else of ours is."""

import json
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import venv
import zipfile
from email.parser import Parser
from pathlib import Path
from urllib.request import urlopen

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("app", "assets", "kernel_cache", "organ_geometry", "physics")


def succeed(*words: object, **options: object) -> str:
    done = subprocess.run(
        [str(word) for word in words],
        capture_output=True, text=True, check=False, **options,  # pyright: ignore
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def install(*words: object) -> None:
    succeed(sys.executable, "-m", "pip", "-q", "--disable-pip-version-check", *words)


@pytest.fixture(scope="module")
def sources() -> list[str]:
    """The files of our packages, as git has them."""
    listed = succeed("git", "ls-files", "-z", "-co", "--exclude-standard", *PACKAGES, cwd=ROOT)
    return [name for name in listed.split("\0") if name and (ROOT / name).exists()]


@pytest.fixture(scope="module")
def wheel(sources: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy: setuptools would leave a folder in the clone."""
    copy = tmp_path_factory.mktemp("sources")
    for name in (*sources, "pyproject.toml", "README.md", "LICENSE"):
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, copy / name)
    folder = tmp_path_factory.mktemp("wheel")
    # A source's build leaves folders beside it too.
    install("wheel", "--no-deps", "--no-index", "--no-build-isolation", "-w", folder, copy)
    (built,) = folder.glob("*.whl")
    return built


def test_holds_the_packages_and_nothing_else(wheel: Path, sources: list[str]) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if not name.endswith("/")}
        about = next(name for name in names if name.endswith(".dist-info/METADATA"))
        metadata = Parser().parsestr(archive.read(about).decode())
    info = about.removesuffix("METADATA")
    assert {name for name in names if not name.startswith(info)} == set(sources)
    assert {f"{package}/py.typed" for package in PACKAGES} <= names
    assert f"{info}licenses/LICENSE" in names
    assert metadata["License-Expression"] == "MIT"
    assert wheel.stat().st_size < 2_500_000


def test_citation_has_the_version() -> None:
    version = re.search(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    assert version is not None
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"\nversion: {version[1]}\n" in citation


@pytest.mark.parametrize(
    "dependencies", ["of this environment", pytest.param("installed", marks=pytest.mark.long)]
)
def test_runs_where_nothing_else_of_ours_is(
    dependencies: str, wheel: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, work = tmp_path / "environment", tmp_path / "work"
    python, program = place / "bin" / "python", place / "bin" / "bluntdissect"
    work.mkdir()
    monkeypatch.chdir(work)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    venv.create(place)
    if dependencies == "installed":
        install("--python", python, "install", "-c", ROOT / "constraints.txt", wheel)
    else:
        install("--python", python, "install", "--no-deps", "--no-index", wheel)
        libraries = sysconfig.get_path("purelib", vars={"base": str(place)})
        Path(libraries, "dependencies.pth").write_text(sysconfig.get_path("purelib"))

    shipped = succeed(python, "-c", "import app, assets; print(app.__file__, assets.BILE_DUCT)")
    assert shipped.count(str(place)) == 2
    assert re.fullmatch(r"bluntdissect \d+\.\d+\.\d+\n", succeed(program, "--version"))
    pull = json.loads(
        succeed(program, "solve", "--preset", "thesis-bile-duct", "--force", 3, "--json")
    )
    assert pull["deflection_mm"] == pytest.approx(11.730151, abs=1e-6)
    assert "firm" in succeed(program, "info", "--beds")
    succeed(program, "export", shipped.split()[-1], "-o", "duct.glb")
    assert Path("duct.glb").read_bytes()[:4] == b"glTF"
    if dependencies == "installed":
        images = Path(shipped.split()[-1]).with_suffix("")
        succeed(program, "compress", images, "-o", "duct.organ")
        assert Path("duct.organ").read_bytes() == Path(shipped.split()[-1]).read_bytes()

    with subprocess.Popen(
        [program, "trainer", "--port", "0"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as trainer:  # fmt: skip
        try:
            assert trainer.stdout is not None
            address = re.search(r"http://127\.0\.0\.1:\d+", trainer.stdout.readline())
            assert address is not None
            with urlopen(f"{address[0]}/healthz", timeout=180) as answer:
                assert answer.status == 200
            with urlopen(address[0], timeout=180) as answer:
                assert b"<html" in answer.read().lower()
            trainer.send_signal(signal.SIGTERM)
            assert trainer.communicate(timeout=180)[1] == ""
            assert trainer.returncode == 0
        finally:
            trainer.kill()
