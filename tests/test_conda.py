"""The recipe for conda is what pyproject.toml says, and builds."""

import hashlib
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[1]
RECIPE = ROOT / "conda" / "recipe.yaml"
CONDA_NAMES = {"opencv-python-headless": "py-opencv", "prometheus-client": "prometheus_client"}


def test_the_recipe_asks_for_what_the_project_does() -> None:
    recipe: Any = yaml.safe_load(RECIPE.read_text())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    asked = [f"python {project['project']['requires-python']}"]
    for each in project["project"]["dependencies"]:
        found = re.fullmatch(r"([\w-]+)([=>].*)", each)
        assert found is not None
        asked.append(f"{CONDA_NAMES.get(found[1], found[1])} {found[2]}")
    assert recipe["requirements"]["run"] == asked
    assert recipe["context"]["version"] == project["project"]["version"]
    (setuptools,) = project["build-system"]["requires"]
    assert setuptools.replace(">=", " >=") in recipe["requirements"]["host"]


@pytest.mark.long
def test_the_recipe_builds_on_a_channel_of_this_machine(tmp_path: Path) -> None:
    """With rattler-build (`pip install py-rattler-build`); a channel of our own has this Python."""
    rattler_build: Any = pytest.importorskip("rattler_build")
    host, channel = tmp_path / "host", tmp_path / "channel"
    base = Path(sys.base_prefix) / "bin" / f"python3.{sys.version_info.minor}"
    subprocess.run([base, "-m", "venv", "--copies", host], check=True)
    install = [host / "bin" / "python", "-m", "pip", "install", "--quiet", "setuptools>=77"]
    subprocess.run(install, check=True)
    records: dict[str, Any] = {}
    for name, version in (("python", f"3.{sys.version_info.minor}"), ("pip", "25"),
                          ("setuptools", "80")):  # fmt: skip
        folder = host if name == "python" else tmp_path / name  # Python brings the others
        folder.mkdir(exist_ok=True)
        (folder / f"{name}.txt").touch()
        made = rattler_build.assemble_package(
            name, version, "linux-64", "0", channel / "linux-64", files_dir=folder,
            detect_prefix=False,
        )  # fmt: skip
        path = Path(made.path)
        records[path.name] = {
            "name": name, "version": version, "build": "0", "build_number": 0, "depends": [],
            "subdir": "linux-64", "size": path.stat().st_size,
            "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        }  # fmt: skip
    for folder, packages in (("linux-64", records), ("noarch", {})):
        (channel / folder).mkdir(exist_ok=True)
        index = {"info": {"subdir": folder}, "packages": {}, "packages.conda": packages}
        (channel / folder / "repodata.json").write_text(json.dumps(index))
    with pytest.deprecated_call():
        rattler_build.cli_api.build_recipes(
            [RECIPE], channel=[channel.as_uri()], output_dir=tmp_path / "out", test="skip"
        )
    (built,) = (tmp_path / "out" / "noarch").glob("*.conda")
    assert built.name.startswith("bluntdissect-")
    assert built.stat().st_size > 300_000
