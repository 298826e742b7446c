"""The words that users read: short sentences, British spelling, one name for a thing."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from page_strings import catalogue, script_strings, strings

from app.simulation import METRICS

ROOT = Path(__file__).parents[1]
MOST_WORDS = 25
# Names of others: an option, places in matplotlib's figures, and titles that are cited.
OTHERS = re.compile(r"--color|^(upper |lower )?center( left| right)?$|Modeling isotropic")
AMERICAN = re.compile(
    r"\b(colors?|colored|centers?|centered|gray|meters?|millimeters?|fibers?|behaviors?|"
    r"labeled|labeling|modeled|modeling|traveled|canceled|(?:normal|linear|optim|minim|maxim|"
    r"initial|recogn|organ|summar|visual)iz(?:e|es|ed|ing|ation))\b",
    re.IGNORECASE,
)


def sentences(text: str) -> list[str]:
    """Those of a text; a line, a cell or what a colon ends is one."""
    text = re.sub(r"\*\*|`", " ", re.sub(r"<[^>]+>", "\n", text))
    return re.split(r"(?<=[.!?;:])\s+|\n", text)


def words(sentence: str) -> list[str]:
    return [word for word in sentence.split() if re.search(r"\w", word)]


def prose(path: Path) -> Iterator[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    shown = list(strings(tree))
    if path.parent.name == "command_line":  # a command's help is its docstring
        functions = (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))
        for each in functions:
            reported = (ast.get_docstring(each) or "").partition("Example")[0]  # then commands
            paragraphs = reported.split("\n\n")
            shown += [(each.lineno, " ".join(one.split())) for one in paragraphs]
    for line, text in shown:
        if re.search(r"[a-z]{2,} [a-z]{2,}", text) and not re.search(
            r"[{};]\s*\n|=>|\bvar\(", text
        ):
            for each in sentences(text):
                yield f"{path.relative_to(ROOT)}:{line}: {each.strip()}"


@pytest.mark.parametrize(
    "folder", ["trainer", "classroom", "command_line", "simulation", "haptics"]
)
def test_no_sentence_that_users_read_is_long(folder: str) -> None:
    found = [
        each
        for path in sorted((ROOT / "app" / folder).rglob("*.py"))
        for each in prose(path)
        if len(words(each.partition(": ")[2])) > MOST_WORDS
    ]
    assert not found, "\n".join(found)


def test_spelling_is_british() -> None:
    found = [
        each
        for path in sorted((ROOT / "app").rglob("*.py"))
        for each in prose(path)
        if AMERICAN.search(OTHERS.sub("", each.partition(": ")[2]))
    ]
    for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]:
        text = re.sub(r"^```.*?^```|`[^`]*`", "", path.read_text(), flags=re.MULTILINE | re.DOTALL)
        found += [f"{path.name}: {each[0]}" for each in AMERICAN.finditer(OTHERS.sub("", text))]
    assert not found, "\n".join(found)


def test_the_page_s_scripts_say_it_in_short_british_sentences() -> None:
    scripts = sorted((ROOT / "app").rglob("*.js"))
    assert scripts
    for path in scripts:
        for text in script_strings(path):
            assert not AMERICAN.search(text), (path.name, text)
            for each in sentences(text):
                assert len(words(each)) <= MOST_WORDS, (path.name, each)


OBSCURE = re.compile(
    r"\b(told to|comes? to be seen|parted strands|strands (have )?parted|by own|whilst)\b",
    re.IGNORECASE,
)
"""Words that newcomers stumbled over: say what is done by whom; broken strands are *broken*."""


def test_the_page_has_no_word_that_newcomers_stumbled_over() -> None:
    folders = [ROOT / "app" / "trainer", ROOT / "app" / "classroom"]
    found = [
        each
        for folder in folders
        for path in sorted(folder.rglob("*.py"))
        for each in prose(path)
        if OBSCURE.search(each.partition(": ")[2])
    ]
    for path in [each for folder in folders for each in folder.rglob("*.html")]:
        found += [f"{path.name}: {each[0]}" for each in OBSCURE.finditer(path.read_text())]
    assert not found, "\n".join(found)


NOT_SI = re.compile(
    r"\d ?(u[msJN]|secs?|hrs?|Newtons?|msec|KPa|Mpa|MPA|mpa|khz|KHz|hz|cc)\b"
    r"|\d(mm|ms|kPa|MPa|kHz|Hz|mJ|ml)\b|\b(mm|cm|m)\^?[234]\b"
)
"""Units as the SI does not write them: no space before one, u for µ, a 2 for a raised one."""


def test_units_are_written_as_the_si_writes_them() -> None:
    found: list[str] = []
    for folder in ("trainer", "classroom"):
        for path in sorted((ROOT / "app" / folder).rglob("*.py")):
            found += [each for each in prose(path) if NOT_SI.search(each.partition(": ")[2])]
    for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]:
        text = re.sub(r"^```.*?^```|`[^`]*`", "", path.read_text(), flags=re.MULTILINE | re.DOTALL)
        text = re.sub(
            r"\$\$.*?\$\$|\$[^$\n]+\$|https?://\S+|\]\([^)]*\)", "", text, flags=re.DOTALL
        )
        for line in text.splitlines():
            found += [f"{path.name}: {each[0]} in {line[:90]}" for each in NOT_SI.finditer(line)]
    assert not found, "\n".join(found)


def test_the_teacher_s_page_says_it_in_short_sentences() -> None:
    for path in (ROOT / "app" / "trainer").rglob("*.html"):
        html = re.sub(r"<(script|style).*?</\1>", "", path.read_text(), flags=re.DOTALL)
        text = re.sub(r"</?(b|i|em|a|code|span|output|label|input|button)\b[^>]*>", " ", html)
        lines = re.sub(r"[ \n]+", " ", re.sub(r"<[^>]*>", "\0", text)).split("\0")
        for each in (one for line in lines for one in sentences(line)):
            assert len(words(each)) <= MOST_WORDS, (path.name, each)


def test_a_measure_has_one_name() -> None:
    """In results, tables and read-outs, in files, and in the docs that define it."""
    page = (ROOT / "docs" / "measures.md").read_text().lower()
    under_another = {"strands", "strands_broken_by_hand", "strands_broken_by_instrument",
                     "peak_stress_station_mm", "time_over_threshold_s"}  # fmt: skip
    for metric in METRICS:
        if metric.key not in under_another:
            assert metric.title.partition(" {")[0].lower() in page, metric.key
    older = ROOT / "app" / "simulation" / "runs" / "older_runs.py"
    for path in [*(ROOT / "app").rglob("*.py"), *(ROOT / "physics").rglob("*.py")]:
        if path != older:
            assert not re.search(r"[Ss]trands_parted|peak_stress_share", path.read_text()), path


@pytest.mark.parametrize(
    "page", sorted((ROOT / "docs").glob("**/*.md")), ids=lambda page: page.stem
)
def test_a_page_begins_with_whom_it_is_for_and_what_comes_of_it(page: Path) -> None:
    if page.parent.name == "api" or page.stem == "index":
        return
    start = page.read_text().split("\n\n")[1]
    assert start.startswith("For ")
    assert re.search(r"[Aa]t (its|the) end|[Ii]n ten minutes", start)


def test_few_sentences_of_the_docs_are_very_long() -> None:
    """At most ten of over 40 words; tables, code, equations and headings apart."""
    found: list[str] = []
    for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        text = re.sub(
            r"^```.*?^```|^\$\$.*?\$\$$", "", path.read_text(), flags=re.MULTILINE | re.DOTALL
        )
        for piece in re.split(r"\n\s*\n|\n(?=\s*[-*] |\s*\d+\. |#|\|)", text):
            if not piece.lstrip().startswith(("|", "#", "!", "<", ":::", "    ")):
                line = " ".join(re.sub(r"!\[.*?\]\(.*?\)", "", piece, flags=re.DOTALL).split())
                pieces = re.split(r"(?<=[.!?:])\s+(?=[A-Z*`(\"'0-9])", line)
                found += [f"{path.name}: {each}" for each in pieces if len(each.split()) > 40]
    assert len(found) <= 10, "\n".join(found)


def test_a_translator_finds_every_word_of_the_page_in_one_file() -> None:
    """Titles of measures, labels, hints, scripts and the teacher's page, each with its place."""
    text = catalogue(ROOT)
    for metric in METRICS:
        assert json.dumps(metric.title) in text, metric.key
    for each in ("Take hold or let go", "Not clinically validated, not a medical device.",
                 "Nobody has joined yet.", "Held ahead of the front"):  # fmt: skip
        assert f'msgid "{each}"' in text, each
    assert "app/trainer/classroom/teacher.html:" in text
    assert text.count("msgid ") == len(set(re.findall(r"^msgid .*$", text, flags=re.MULTILINE)))
