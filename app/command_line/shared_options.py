"""Options that commands share: declared once, as the arguments of a function or a class."""

import inspect
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import typer

Command = TypeVar("Command", bound=Callable[..., Any])


def given_options(context: typer.Context, names: Iterable[str]) -> list[str]:
    """Return those of some parameters that the command line gives, by their options' names."""
    sources = {each: context.get_parameter_source(each) for each in names}
    given = {name for name, source in sources.items() if source and source.name == "COMMANDLINE"}
    return [each.opts[0] for each in context.command.params if each.name in given]


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
