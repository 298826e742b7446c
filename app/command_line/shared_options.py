"""Options that commands share: declared once, as the arguments of a function or a class."""

import inspect
from collections.abc import Callable
from typing import Any, TypeVar

__all__ = ["options_of"]

Command = TypeVar("Command", bound=Callable[..., Any])


def options_of(shared: Callable[..., object]) -> Callable[[Command], Command]:
    """Return what gives a command the options of a function or a class for its `**options`."""
    passed = inspect.signature(shared).parameters.values()

    def give(command: Command) -> Command:
        own = [
            each
            for each in inspect.signature(command).parameters.values()
            if each.kind is not each.VAR_KEYWORD
        ]
        vars(command)["__signature__"] = inspect.Signature([*own, *passed])
        command.__annotations__ = {each.name: each.annotation for each in (*own, *passed)}
        return command

    return give
