"""Every string that a user may read, with its place, as a gettext catalogue: `make strings`."""

import ast
import html
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

FOLDERS = ("trainer", "classroom", "command_line", "simulation", "haptics")
HEAD = 'msgid ""\nmsgstr "Content-Type: text/plain; charset=UTF-8\\n"\n'


def strings(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and text of each string that is no docstring; what is filled in stands as a word."""
    docs = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef))
        and node.body and isinstance(node.body[0], ast.Expr)
    }  # fmt: skip
    docs |= {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    inside = {
        id(fraction) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr)
        for fraction in ast.walk(node) if fraction is not node
    }  # fmt: skip
    for node in ast.walk(tree):
        if id(node) in docs or id(node) in inside:
            continue
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value
        elif isinstance(node, ast.JoinedStr):
            pieces = (
                piece.value if isinstance(piece, ast.Constant) and isinstance(piece.value, str)
                else "X" for piece in node.values
            )  # fmt: skip
            yield node.lineno, "".join(pieces)


def script_strings(path: Path) -> Iterator[str]:
    """What stands in quotes in a script, without its comments, styles and shaders."""
    text = re.sub(r"/\*.*?\*/|^\s*//.*?$", "", path.read_text(), flags=re.DOTALL | re.MULTILINE)
    for found in re.finditer(r'"((?:[^"\\\n]|\\.)*)"|`([^`]*)`', text):
        each = found[1] if found[1] is not None else found[2]
        if re.search(r"[A-Za-z]{2,} [A-Za-z]{2,}", each) and not re.search(r"[{};]\s*\n", each):
            yield each


def page_strings(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of what stands between the tags of a page, and of its hints."""
    text = path.read_text(encoding="utf-8")
    for tag in ("script", "style"):
        text = re.sub(
            rf"<{tag}.*?</{tag}>", lambda found: "\n" * found[0].count("\n"), text, flags=re.DOTALL
        )
    for found in re.finditer(r">([^<>]+)<|(?:title|placeholder|aria-label|alt)=\"([^\"]+)\"", text):
        words = " ".join(html.unescape(found[1] or found[2]).split())
        if re.search(r"[A-Za-z]{2,}", words):
            yield text.count("\n", 0, found.start()) + 1, words


def catalogue(root: Path) -> str:
    """Return the catalogue; what the program fills in stands as X."""
    places: dict[str, list[str]] = {}
    for folder in FOLDERS:
        for path in sorted((root / "app" / folder).rglob("*")):
            if path.suffix == ".py":
                found = strings(ast.parse(path.read_text(encoding="utf-8")))
            elif path.suffix == ".js":
                found = ((1, each) for each in script_strings(path))
            elif path.suffix == ".html":
                found = page_strings(path)
            else:
                continue
            for line, text in found:
                name = re.fullmatch(r"(?:[A-Z][a-z]+){2,}", text)  # of a class, in __all__
                if re.search(r"[A-Za-z]{2,} |^[A-Z][a-z]{2,}", text) and not name:
                    where = f"{path.relative_to(root).as_posix()}:{line}"
                    places.setdefault(text, []).append(where)
    entries = (
        f'#: {" ".join(where)}\nmsgid {json.dumps(text, ensure_ascii=False)}\nmsgstr ""\n'
        for text, where in places.items()
    )
    return "\n".join((HEAD, *entries))


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(catalogue(Path(__file__).parents[2]), encoding="utf-8")
