"""Machine code that is kept: it follows every file that it comes from, and is used again."""

import ast
import contextlib
import gc
import io
import re
import shutil
import subprocess
import sys
import threading
from functools import partial
from pathlib import Path

import pytest
from numba.core import errors

import kernel_cache
from organ_geometry.encoder import jacobian
from physics.exact import newton

ROOT = Path(kernel_cache.__file__).parents[1]
CALLER = """from kernel_cache import njit

from physics.callee import twice
@njit(cache=True)
def asked(x):
    return twice(x)
"""
CALLEE = """from kernel_cache import njit

from physics.constants import *
@njit(cache=True)
def twice(x):
    return FACTOR * x
"""
MAIN = """import os, sys
import numba
sys.dont_write_bytecode = True  # by its second a file that has changed may be the one before
sys.path.insert(0, sys.argv[1])
for line in sys.stdin:
    if child := os.fork():
        if os.waitpid(child, 0)[1]:
            print("no answer", flush=True)
        continue
    from physics.caller import asked
    print(asked(3.0), sum(asked.stats.cache_hits.values()), flush=True)
    os._exit(0)
"""
"""For each line a process of its own runs the kernel; all share one import of numba."""


def test_machine_code_follows_the_files_that_its_kernel_calls(tmp_path: Path) -> None:
    shutil.copytree(Path(kernel_cache.__file__).parent, tmp_path / "kernel_cache")
    package = tmp_path / "physics"
    package.mkdir()
    (package / "caller.py").write_text(CALLER)
    (package / "callee.py").write_text(CALLEE)
    main = tmp_path / "main.py"
    main.write_text(MAIN)
    with subprocess.Popen(
        [sys.executable, "-I", main, tmp_path],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        given, message = process.stdin, process.stdout
        assert given is not None
        assert message is not None

        def run() -> str:
            print(file=given, flush=True)
            return message.readline().strip()

        (package / "constants.py").write_text("FACTOR = 2.0\n")
        assert run() == "6.0 0"
        assert run() == "6.0 1"
        (package / "constants.py").write_text("FACTOR = 5.0\n")
        assert run() == "15.0 0"
        (package / "callee.py").write_text(CALLEE.replace("* x", "+ x"))
        assert run() == "8.0 0"
        assert run() == "8.0 1"


def test_kernels_are_stamped_by_all_that_they_call() -> None:
    names = {each.name for each in kernel_cache.sources(Path(newton.__file__))}
    assert names >= {"newton.py", "points.py", "linear_law.py", "fibre_laws.py", "symbols.py"}
    names = {each.name for each in kernel_cache.sources(Path(jacobian.__file__))}
    assert "outline_distance.py" in names


def test_every_kernel_s_machine_code_is_kept_so() -> None:
    """None takes `njit` from numba itself, before the cache of ours is known to it."""
    root = Path(kernel_cache.__file__).parents[1]
    for package in kernel_cache.PACKAGES:
        for file in (root / package).rglob("*.py"):
            assert not re.search(r"^(import|from) numba\b", file.read_text(), re.MULTILINE), file
    locator = newton.newton._cache._impl.locator  # pyright: ignore[reportAttributeAccessIssue]
    assert type(locator).__module__ == kernel_cache.__name__


@kernel_cache.njit
def _inner(x: float) -> float:
    return x + 1.0


@kernel_cache.njit
def _outer(x: float) -> float:
    return _inner(x)


@kernel_cache.njit
def _no_kernel(x: float) -> float:
    return x + "one"  # pyright: ignore


@kernel_cache.njit
def _doubled(x: float) -> float:
    return x + x


def test_of_arguments_of_the_same_types_those_of_the_first_call_are_looked_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looks: list[object] = []
    type_of = kernel_cache._type_of
    monkeypatch.setattr(
        kernel_cache, "_type_of", lambda each: (looks.append(each), type_of(each))[1]
    )
    doubled = kernel_cache.SameTypes(_doubled)
    assert [doubled(each) for each in (1.0, 2.5, -3.0)] == [2.0, 5.0, -6.0]
    assert looks == [1.0]


def test_cycles_are_not_collected_while_a_kernel_is_compiled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And are again after it, also after one that cannot be compiled."""
    calls: list[str] = []
    mine = threading.get_ident()  # another test's trainer may be compiling, too

    def note(name: str) -> None:
        if threading.get_ident() == mine:
            calls.append(name)

    for name in ("disable", "enable"):
        monkeypatch.setattr(gc, name, partial(note, name))
    assert _outer(1.0) == 2.0
    assert calls == ["disable", "enable"]
    with pytest.raises(errors.TypingError):
        _no_kernel(1.0)
    assert calls == ["disable", "enable"] * 2


@pytest.mark.parametrize(
    "change",
    [
        "del caching._CacheLocator",
        "del caching._SourceFileBackedLocatorMixin.get_source_stamp, "
        "caching._CacheLocator.get_source_stamp",
        "del config.CACHE_LOCATOR_CLASSES",
    ],
)
def test_another_numba_costs_time_and_one_warning(change: str) -> None:
    """Where numba's private names are others, kernels are compiled and not kept."""
    main = f"""from numba.core import caching, config
{change}
from kernel_cache import njit

@njit(cache=True, nogil=True)
def twice(x):
    return 2.0 * x

print(twice(21.0), type(twice._cache).__name__)
"""
    found = subprocess.run(
        [sys.executable, "-c", main], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert found.stdout == "42.0 NullCache\n"
    assert found.stderr.count("RuntimeWarning: numba ") == 1


def test_a_thread_that_compiles_leaves_the_screen_to_others() -> None:
    """By colours in numba's messages what one thread had redirected went to the screen."""
    over = threading.Event()

    def write_messages() -> None:
        while not over.is_set():
            errors.termcolor().errmsg("a message of the compiler")

    with contextlib.redirect_stdout(io.StringIO()) as mine:
        writer = threading.Thread(target=write_messages)
        writer.start()
        try:
            assert all(sys.stdout is mine for _ in range(300_000))
        finally:
            over.set()
            writer.join()


def test_no_module_imports_in_a_manner_that_its_stamp_misses() -> None:
    """What Python's own parser finds that a module imports of ours is among its sources."""
    files = [file for package in kernel_cache.PACKAGES for file in (ROOT / package).rglob("*.py")]
    marked = re.compile(r"^@(njit|kernel|outer|inner|inlined)\b", re.MULTILINE)
    kernels = [file for file in files if marked.search(file.read_text("utf-8"))]
    assert len(kernels) > 40
    for file in {source for kernel in kernels for source in kernel_cache.sources(kernel)}:
        named: set[str] = set()
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                named |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{file} imports from a relative module"
                module = node.module or ""
                named |= {module} | {f"{module}.{alias.name}" for alias in node.names}
        read = kernel_cache.sources(file)
        for name in named:
            if name.split(".")[0] not in kernel_cache.PACKAGES:
                continue
            place = ROOT.joinpath(*name.split("."))
            for source in (place.with_suffix(".py"), place / "__init__.py"):
                assert not source.is_file() or source in read, f"{file} imports {name}"
