"""The container: what its file copies, and an image of it that runs as nobody special."""

import json
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILE = (ROOT / "Containerfile").read_text()
IMAGE = "localhost/bluntdissect-test"


def test_copies_what_the_wheel_is_built_of() -> None:
    copied = {
        name
        for line in re.findall(r"^COPY (?!--from)(.*) \S+$", FILE, flags=re.MULTILINE)
        for name in line.split()
    }
    assert copied - {"pyproject.toml", "README.md", "LICENSE", "constraints.txt"} == {
        path.parent.name for path in ROOT.glob("*/py.typed")
    }
    for name in copied:
        assert (ROOT / name).exists(), name


def buildah(*words: object) -> str:
    """Run buildah without a daemon, and without rights that a CI machine may not have."""
    done = subprocess.run(
        ["buildah", *map(str, words)],
        capture_output=True, text=True, check=False,
        env=os.environ | {"BUILDAH_ISOLATION": "chroot", "STORAGE_DRIVER": "vfs"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.fixture
def container() -> Iterator[str]:
    """An image built with buildah, of the base that CONTAINER_BASE names where it has another."""
    if shutil.which("buildah") is None:
        pytest.skip("no buildah (Debian: apt install buildah)")
    base = os.environ.get("CONTAINER_BASE")
    options = ["--build-arg", f"BASE={base}"] if base else []
    buildah(
        "bud", "-q", "--format", "docker", "--network", "host", *options,
        "-v", "/etc/ssl/certs:/etc/ssl/certs:ro", "-t", IMAGE, ROOT,
    )  # fmt: skip
    made = buildah("from", IMAGE)
    yield made
    buildah("rm", made)
    buildah("rmi", IMAGE)


@pytest.mark.long
def test_runs_as_nobody_special_and_says_that_it_is_well(container: str) -> None:
    settings = json.loads(buildah("inspect", container))["Docker"]["config"]
    assert settings["Entrypoint"][:2] == ["bluntdissect", "trainer"]
    check = settings["Healthcheck"]["Test"]
    assert check[0] == "CMD"
    assert buildah("run", container, "--", "id", "-un") == "trainer"
    assert buildah("run", container, "--", "bluntdissect", "--version").startswith("bluntdissect ")
    with subprocess.Popen(
        # On loopback, where the container shares the machine's network.
        ["buildah", "run", container, "--", "bluntdissect", "trainer", "--port", "8080"],
        stdout=subprocess.PIPE, text=True,
        env=os.environ | {"BUILDAH_ISOLATION": "chroot", "STORAGE_DRIVER": "vfs"},
    ) as trainer:  # fmt: skip
        try:
            assert trainer.stdout is not None
            assert "http://127.0.0.1:8080" in trainer.stdout.readline()
            buildah("run", container, "--", *check[1:])
        finally:
            trainer.terminate()
            trainer.wait(timeout=30)
