"""The site builds, loads nothing from elsewhere, and what it shows is what its lines give."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from program import blocks, commands, run, serves_a_class

from app.classroom.exercise_file import read_exercise
from assets import BILE_DUCT

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()

TUTORIALS = (
    "dissect",
    "triangle",
    "first-view",
    "class",
    "check",
    "organ",
    "patient",
    "study",
    "policy",
    "extend",
)
PAGES = ("index", "gallery", *(f"tutorials/{name}" for name in TUTORIALS))
TEXTS = [(ROOT / "docs" / f"{page}.md").read_text() for page in PAGES]
EXAMPLES = sorted(re.findall(r'^--8<-- "examples/(.*?)"$', "\n".join(TEXTS), flags=re.MULTILINE))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built strictly: a link to a page, a heading or a picture that is not there is an error."""
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", folder],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_pages_load_nothing_from_elsewhere(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 20
    for page in pages:
        html = page.read_text()
        loaded = re.findall(r"<(?:script|img|iframe|source|video)[^>]*?src=\"?([^\">\s]+)", html)
        loaded += re.findall(
            r"<link[^>]*?rel=\"?(?:stylesheet|preconnect)[^>]*?href=\"?([^\">\s]+)", html
        )
        loaded += re.findall(r"url\(([^)]+)\)", html)
        assert not [place for place in loaded if re.match(r"[\"']?(https?:)?//", place)], page
        assert "Not clinically validated, not a medical device." in html


def test_each_page_is_of_one_kind() -> None:
    """Tutorials, how-to, reference, explanation; only the start is of none."""
    nav = (ROOT / "mkdocs.yml").read_text().partition("\nnav:\n")[2]
    kinds = re.findall(r"^  - (.+):$", nav, flags=re.MULTILINE)
    assert kinds == ["Tutorials", "How to", "Reference", "Explanation"]
    assert re.findall(r"^  - (\S+\.md)$", nav, flags=re.MULTILINE) == ["index.md"]
    named = re.findall(r"(\S+\.md)$", nav, flags=re.MULTILINE)
    pages = {str(page.relative_to(ROOT / "docs")) for page in (ROOT / "docs").rglob("*.md")}
    assert sorted(named) == sorted(pages)


def test_python_s_faces_are_described(site: Path) -> None:
    import physics
    import physics.bed

    for page, package in (("physics", physics), ("bed", physics.bed)):
        html = (site / "api" / f"{page}.html").read_text()
        for name in package.__all__:
            assert re.search(rf'id="{package.__name__}\.(\w+\.)?{name}"', html), name


def test_every_command_has_its_help_on_the_site(site: Path) -> None:
    from typer.main import get_command

    from app.command_line.program import program

    html = (site / "commands.html").read_text()
    known = get_command(program).commands  # pyright: ignore[reportAttributeAccessIssue]
    assert len(known) > 10
    for name in known:
        assert f"<code>bluntdissect {name}</code>" in html, name


def test_every_example_is_shown() -> None:
    others = {
        "diagrams.py",
        "gallery.py",
        "clone_window.py",
        "judge_on_workers.py",
        "refine_window.py",
        "scope_film.py",
        "scope_stills.py",
        "search_window.py",
    }  # that draw pages and films, record a run, learn long, or start workers
    scripts = {path.name for path in (ROOT / "examples").glob("*.py")} - others
    assert set(EXAMPLES) == scripts


def test_the_diagrams_are_of_this_code(tmp_path: Path) -> None:
    """Where an import is new: python examples/diagrams.py docs/images."""
    subprocess.run([sys.executable, "examples/diagrams.py", tmp_path], cwd=ROOT, check=True)
    made = list(tmp_path.iterdir())
    assert len(made) == 4
    for path in made:
        assert path.read_text() == (ROOT / "docs" / "images" / path.name).read_text(), path.name


@pytest.mark.parametrize("name", sorted(set(EXAMPLES)))
def test_example_prints_what_its_page_shows(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    source = (ROOT / "examples" / name).read_text()
    exec(compile(source, name, "exec"), {"__name__": "__main__"})
    printed = capsys.readouterr().out
    shown = [text for page in TEXTS for text in blocks(page, "text")]
    assert printed in shown
    written = re.findall(r'(?:savefig|Path)\("(.*?)"', source)
    assert written
    for file in written:
        assert Path(file).stat().st_size > 0


def test_commands_of_the_tutorials_run_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "assets").symlink_to(ROOT / "assets")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    made_before = commands(README, "bluntdissect")
    for text in TEXTS:
        for line in "\n".join(blocks(text, "sh")).splitlines():
            program, *words = shlex.split(line) or ["make"]
            if program == "python":  # what it prints is tested where it is quick
                assert (ROOT / words[0]).exists()
                continue
            assert program in {"bluntdissect", "make"}
            if program == "make":
                continue
            if words[:2] in (["class", "new"], ["class", "open"]):
                serves_a_class(words)
                continue
            if words[0] == "dataset":
                words[words.index("--seeds") + 1] = "1-2"
            if words not in made_before:
                done = run(*words)
                assert done.returncode == 0, (words, done.stderr)
            # The README's commands are run by its test; this one's file is the shipped one.
            elif words[0] == "compress":
                shutil.copy(BILE_DUCT, words[words.index("-o") + 1])


@pytest.mark.parametrize("name", TUTORIALS)
def test_python_and_exercises_of_the_tutorials_are_right(name: str) -> None:
    text = TEXTS[PAGES.index(f"tutorials/{name}")]
    for source in blocks(text, "python"):
        if "--8<--" not in source:  # else one of the examples
            exec(compile(source, name, "exec"), {})
    for source in blocks(text, "toml"):
        if source.startswith("title"):
            read_exercise(source)


def test_what_the_tutorials_of_a_change_name_is_in_the_code() -> None:
    text = TEXTS[PAGES.index("tutorials/extend")]
    for section in re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL).split("\n## "):
        message = re.findall(r"`([^`]+)`", section)
        files = [each for each in message if re.fullmatch(r"(\w+/)+\w+\.py", each)]
        code = "\n".join((ROOT / each).read_text() for each in files)
        for name in message if files else []:
            if re.fullmatch(r"[A-Z]\w+|[a-z]+(_[a-z]+)+", name):
                assert re.search(rf"\b{name}\b", code), (name, files)


def test_what_tutorials_say_to_press_is_there() -> None:
    text = TEXTS[PAGES.index("tutorials/class")]
    named = re.findall(r"(?<!\*)\*([^*\n]+)\*(?!\*)", text)
    folders = (ROOT / "app" / "trainer" / "classroom", ROOT / "app" / "classroom")
    paths = [path for folder in folders for path in folder.iterdir() if path.is_file()]
    paths.append(ROOT / "app" / "simulation" / "exercises" / "exercise_table.py")
    paths.append(ROOT / "app" / "trainer" / "panel" / "help.py")
    page = "".join(path.read_text() for path in paths)
    assert len(named) > 8
    assert not [each for each in named if each not in page]
    named = re.findall(
        r"(?<!\*)\*([^*\n]+)\*(?!\*)", TEXTS[PAGES.index("tutorials/triangle")].lower()
    )
    folder = ROOT / "app" / "trainer" / "panel"
    page = "".join(path.read_text() for path in folder.glob("*.py")) + paths[-1].read_text()
    assert len(named) > 8
    assert not [each for each in named if each not in page.lower()]
