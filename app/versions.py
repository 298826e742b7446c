"""Versions of what results are computed with."""

import platform
from importlib.metadata import PackageNotFoundError, version

__all__ = ["versions"]


def versions(*more: str) -> dict[str, str]:
    """Return the versions of Python, of this program, numpy and numba, and of more packages."""
    found = {"python": platform.python_version()}
    for name in ("bluntdissect", "numpy", "numba", *more):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "unknown"
    return found
