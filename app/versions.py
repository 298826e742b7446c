"""Versions of what results are computed with."""

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version


def versions(*more: str) -> dict[str, str]:
    """Return the versions of Python, of this program, numpy and numba, and of more packages."""
    found = {"python": platform.python_version()}
    return found | {name: _version(name) for name in ("bluntdissect", "numpy", "numba", *more)}


@cache  # looking through all packages takes 20 ms
def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"
