"""Whether somebody is told that kernels are compiled; it loads none itself."""

import logging


def say_when_compiling() -> None:
    """Log a line when a kernel is next compiled, as a first start is silent for long otherwise."""
    logging.getLogger("kernel_cache").setLevel(logging.INFO)
