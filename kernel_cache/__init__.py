"""When the machine code that numba keeps of our kernels is out of date; numba's `njit` with that.

Numba compiles a kernel anew when its own file has changed, but the machine code holds that of the
kernels it calls as well, and the constants that it reads. Here the stamp of a kernel is a hash of
its file and of all files of ours that it imports, directly or through others. All kernels take
`njit` from here, so that none is compiled before numba knows of it.

While a kernel is compiled, Python collects no cycles: the compiler makes objects by the million,
and looking through them again and again was a sixth of its time.
"""

import gc
import hashlib
import logging
import os
import re
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

# Else numba, as it compiles, colours its messages by exchanging sys.stdout and sys.stderr, and then
# sets them to what they were before: what another thread has redirected meanwhile is lost.
os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")

import numba
from numba import njit
from numba.core import caching, config, event

__all__ = ["SameTypes", "kernel", "njit", "side_by_side", "sources"]

F = TypeVar("F", bound=Callable[..., object])

ROOT = Path(__file__).parents[1]
PACKAGES = ("physics", "organ_geometry", "app")
"""The packages that have kernels."""
IMPORT = re.compile(
    rf"^\s*from ((?:{'|'.join(PACKAGES)})\b[\w.]*) import (\([^)]*\)|[^\n]*)",
    re.MULTILINE | re.ASCII,
)


@cache
def sources(file: Path) -> frozenset[Path]:
    """Return a file of ours and all others of ours that it imports."""
    found, waiting = {file}, [file]
    while waiting:
        for module, names in IMPORT.findall(waiting.pop().read_text("utf-8")):
            place = ROOT.joinpath(*module.split("."))
            for each in (place, *(place / name for name in re.findall(r"\w+", names))):
                for source in (each.with_suffix(".py"), each / "__init__.py"):
                    if source.is_file() and source not in found:
                        found.add(source)
                        waiting.append(source)
    return frozenset(found)


@cache
def _stamp(file: Path) -> bytes:
    digest = hashlib.sha256()
    for source in sorted(sources(file)):
        digest.update(source.read_bytes())
    return digest.digest()


def _stamped_locators() -> str:
    """Make numba's locators for our files, by the stamp of all sources; return their names."""
    # They rest on names of numba's that are not public: where these are missing or have changed, an
    # `AttributeError` or a `TypeError` says so here.

    class Stamped(caching._CacheLocator):  # pyright: ignore[reportPrivateUsage, reportUntypedBaseClass]
        _py_file: str

        @classmethod
        def from_function(cls, py_func: object, py_file: str) -> Any:
            """Return the locator of a function's machine code, None if it is not ours."""
            if not any(Path(py_file).is_relative_to(ROOT / package) for package in PACKAGES):
                return None
            return super().from_function(py_func, py_file)  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType]

        def get_source_stamp(self) -> Any:
            """Return what changes with anything that the machine code comes from."""
            return _stamp(Path(self._py_file))

    names: list[str] = []
    # In the folder that NUMBA_CACHE_DIR names, in the `__pycache__` beside the source, and in the
    # user's own folder, where the source's cannot be written.
    for base in ("UserProvidedCacheLocator", "InTreeCacheLocator", "UserWideCacheLocator"):
        parent = getattr(caching, base)
        for needed in ("from_function", "get_source_stamp"):
            if not callable(getattr(parent, needed)):
                raise TypeError(f"numba's {base}.{needed} is no function")
        globals()[f"Stamped{base}"] = type(
            f"Stamped{base}", (Stamped, parent), {"__module__": __name__}
        )
        names.append(f"{__name__}.Stamped{base}")
    return ",".join(names)


try:
    _own = _stamped_locators()
    _given: str = getattr(config, "CACHE_LOCATOR_CLASSES")  # noqa: B009
except (AttributeError, TypeError) as _error:
    warnings.warn(
        f"numba {numba.__version__} keeps machine code in a manner that is not known here "
        f"({_error}): kernels are compiled anew at each start",
        RuntimeWarning,
        stacklevel=2,
    )

    def _uncached(**options: Any) -> Any:
        """Compile a kernel; its machine code is not kept."""
        return cast(Any, numba.njit)(**(options | {"cache": False}))

    njit = cast(Any, _uncached)
else:
    # Numba asks these first, and its own for all other files.
    _others = (
        "UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator,"
        "IPythonCacheLocator,ZipCacheLocator"
    )
    config.CACHE_LOCATOR_CLASSES = f"{_own},{_given or _others}"  # pyright: ignore[reportAttributeAccessIssue]


def kernel(**options: Any) -> Callable[[F], F]:
    """Return what compiles a kernel that makes no array."""
    # Numba counts the references to each array, at each call: of a state's sixty arrays they were a
    # quarter of a bed's step. A kernel that makes none need not; what it calls and makes some says
    # `_nrt=True`, as else it is compiled likewise.
    return cast(Any, njit)(**({"cache": True, "_nrt": False} | options))


_type_of = cast(Callable[[object], Any], numba.typeof)  # pyright: ignore[reportUnknownMemberType]


class SameTypes:
    """A kernel whose arguments are always of the same types: these are looked up once.

    Of a named tuple of fifty arrays numba's look at each takes ten times as long as the call.
    """

    def __init__(self, kernel: Any) -> None:
        self._kernel, self._compiled = kernel, None

    def __call__(self, *arguments: Any) -> Any:
        """Run the kernel."""
        if self._compiled is None:
            self._compiled = self._kernel.compile(tuple(map(_type_of, arguments)))
        return self._compiled(*arguments)


_SIDE_BY_SIDE: set[Any] = set()


def side_by_side(kernel: F) -> F:
    """Mark a kernel to be compiled with neighbouring numbers in one instruction; the same bits."""
    # LLVM's vectors of scalars (SLP), which numba leaves off: they cost a quarter of the speed of
    # kernels of long expressions, and make one of small matrices some three times as fast.
    _SIDE_BY_SIDE.add(cast(Any, kernel).py_func)
    return kernel


_LOGGER = logging.getLogger(__name__)


class _Compilation(event.Listener):
    """What holds while a kernel and all that it calls are compiled.

    Cycles are not collected, and neighbouring numbers are taken together in kernels marked so.
    """

    # Numba's compiler lock is held while these are called.
    def __init__(self) -> None:
        self._was: list[Any] = []
        self._collected = False

    def on_start(self, event: Any) -> None:
        if not self._was:
            if _LOGGER.isEnabledFor(logging.INFO):  # somebody asked to be told, once
                _LOGGER.setLevel(logging.WARNING)
                _LOGGER.warning(
                    "Compiling, which takes up to some two minutes on a first start; the machine "
                    "code is kept for later ones."
                )
            self._collected = gc.isenabled()
            gc.disable()
        self._was.append(getattr(config, "SLP_VECTORIZE", 0))
        kernel = event.data["dispatcher"].py_func
        config.SLP_VECTORIZE = int(kernel in _SIDE_BY_SIDE)  # pyright: ignore[reportAttributeAccessIssue]

    def on_end(self, event: Any) -> None:
        config.SLP_VECTORIZE = self._was.pop()  # pyright: ignore[reportAttributeAccessIssue]
        if not self._was and self._collected:
            gc.enable()


event.register("numba:compile", _Compilation())  # pyright: ignore[reportUnknownMemberType]
