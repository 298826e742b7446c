"""The command line, `bluntdissect`."""

from app.command_line.program import main

__all__ = ["main"]
