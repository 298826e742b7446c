"""Whether somebody is told that kernels are compiled; it loads none itself."""

import logging

__all__ = ["say_when_compiling"]


def say_when_compiling() -> None:
    """Log a line when a kernel is next compiled, as a first start is silent for long otherwise."""
    logging.getLogger("kernel_cache").setLevel(logging.INFO)
