"""Every command, figure and link of the README is true."""

import os
import re
import shlex
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import pytest
from program import LONGEST, blocks, commands, run, serves_a_class

from assets import BILE_DUCT

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text()


def test_every_command_is_tested_here() -> None:
    lines = [
        line
        for text in (README, CONTRIBUTING)
        for block in blocks(text, "sh")
        for line in block.splitlines()
        if line
    ]
    programs = {shlex.split(line, comments=True)[0] for line in lines}
    assert programs == {"make", "bluntdissect"}
    assert len(commands(README, "bluntdissect")) >= 5
    assert ["trainer"] in commands(README, "make")
    assert ["test"] in commands(README, "make")


@pytest.mark.parametrize("words", commands(README, "make") + commands(CONTRIBUTING, "make"))
def test_make_knows_its_targets(words: list[str]) -> None:
    done = subprocess.run(
        ["make", "--dry-run", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_program_s_examples_run_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "assets").symlink_to(ROOT / "assets")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    message = ""
    for words in commands(README, "bluntdissect"):
        if words[:2] == ["class", "new"]:
            serves_a_class(words)
            continue
        done = run(*words)
        assert done.returncode == 0, (words, done.stderr)
        message += done.stdout
    assert {"duct.organ", "duct.stl", "torn.glb"} < {entry.name for entry in tmp_path.iterdir()}
    assert (tmp_path / "duct.organ").read_bytes() == BILE_DUCT.read_bytes()
    for line in "".join(blocks(README, "text")).splitlines():
        assert line in message


def test_python_example_gives_its_figures() -> None:
    (example,) = blocks(README, "python")
    names: dict[str, object] = {}
    exec(example, names)
    deflection, event = names["deflection"], names["event"]
    assert isinstance(deflection, float)
    assert f"{deflection:.2f} mm" in example
    assert f"at {event.force:.3f} N" in example  # pyright: ignore[reportAttributeAccessIssue]
    solid = names["solid"]
    assert f"# {solid.deflection:.2f} mm" in example  # pyright: ignore[reportAttributeAccessIssue]


def test_peel_s_python_example_gives_its_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the figures are those that `solve --bed` prints of the same pull."""
    monkeypatch.chdir(tmp_path)
    example, _ = blocks((ROOT / "docs" / "peel.md").read_text(), "python")
    names: dict[str, object] = {}
    exec(example, names)
    history = names["history"]
    assert f"# {history.freed[-1]:.2f} mm" in example  # pyright: ignore[reportAttributeAccessIssue]
    assert len((tmp_path / "history.csv").read_text().splitlines()) == 21
    done = run(
        *("solve", "--bed", "firm", "--seed", 7, "--hook", 31, "--lift", 6),
        *("--steps", 20, "--threshold", 0.17, "-o", "solve.csv"),
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "solve.csv").read_text() == (tmp_path / "history.csv").read_text()


@pytest.mark.parametrize(
    "document", sorted(ROOT.glob("*.md")) + sorted((ROOT / "docs").glob("*.md"))
)
def test_links_and_pictures_are_there(document: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)", document.read_text()):
        if target.startswith("https://"):  # somebody else's page
            continue
        assert (document.parent / target).exists(), target


def test_the_paper_has_its_parts_and_cites_what_its_bibliography_has() -> None:
    paper, known = (ROOT / "paper.md").read_text(), (ROOT / "paper.bib").read_text()
    assert set(re.findall(r"@(\w+)", paper.partition("# Summary")[2])) == set(
        re.findall(r"^@\w+\{(\w+),", known, flags=re.MULTILINE)
    )
    for heading in ("Summary", "Statement of need", "State of the field", "Limits", "References"):
        assert f"\n# {heading}\n" in paper
    assert 250 < len(paper.split()) < 1000  # as JOSS asks


def test_make_trainer_answers_and_ends() -> None:
    """The README's first command, with a free port; in the environment that make has made."""
    if not (ROOT / ".venv" / ".runs").exists():
        pytest.skip("these tests do not run in the environment that `make test` makes")
    with subprocess.Popen(
        ["make", "trainer", "ARGS=--port 0 --look plain"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"},
        start_new_session=True,
    ) as process:
        try:
            assert process.stdout is not None
            found = None
            while found is None:
                line = process.stdout.readline()
                assert line, "make trainer has ended without an address"
                found = re.search(r"http://127\.0\.0\.1:\d+", line)
            with urllib.request.urlopen(found.group(), timeout=LONGEST) as answer:
                assert answer.status == 200
        finally:
            # What Ctrl+C in a terminal does: the whole group gets the signal.
            os.killpg(process.pid, signal.SIGINT)
            process.wait(timeout=LONGEST)
    # make does not wait for what it has started.
    until = time.monotonic() + LONGEST
    while True:
        try:
            urllib.request.urlopen(found.group(), timeout=LONGEST).close()
        except OSError:
            break
        assert time.monotonic() < until, "the trainer goes on"
        time.sleep(0.05)
