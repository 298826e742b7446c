"""The program `bluntdissect`: its commands, and its error messages."""

import os
import sys
from typing import Annotated

import typer

from app.command_line import (
    anatomy,
    classroom,
    compress,
    dataset,
    export,
    fit,
    haptics,
    info,
    peel,
    perform,
    replay,
    solve,
    study,
    trainer,
    validate,
)
from app.compiling import say_when_compiling

WRONG_INPUT, OUR_FAULT, STOPPED = 2, 1, 130
# Environment variable with which an error shows where it comes from.
TRACEBACK = "BLUNTDISSECT_TRACEBACK"

program = typer.Typer(
    name="bluntdissect",
    invoke_without_command=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@program.callback()
def versions(
    version: Annotated[
        bool, typer.Option("--version", help="Show the version and exit.", is_eager=True)
    ] = False,
) -> None:
    """Blunt dissection of a tubular organ, solved as a beam.

    Not clinically validated, not a medical device.
    """
    if version:
        from importlib.metadata import version as installed

        print(f"bluntdissect {installed('bluntdissect')}")
        raise typer.Exit


program.command("trainer")(trainer.trainer)
program.add_typer(classroom.program, name="class")
program.command("compress")(compress.compress)
program.command("anatomy")(anatomy.anatomy)
program.command("info")(info.info)
program.command("export")(export.export)
program.command("replay")(replay.replay)
program.command("haptics")(haptics.haptics)
program.command("solve")(solve.solve)
program.command("peel")(peel.peel)
program.command("perform")(perform.perform)
program.command("validate")(validate.validate)
program.command("fit")(fit.fit)
program.add_typer(study.study, name="study")
program.command("dataset")(dataset.dataset)


def main() -> None:
    """Run the command line and exit: 0 done, 2 wrong input, 1 a fault of ours."""
    if sys.stderr.isatty():  # what is not a person takes a line there for an error
        say_when_compiling()
    sys.exit(_status())


def _status() -> int:
    try:
        status = int(program(sys.argv[1:] or ["--help"], standalone_mode=False) or 0)
        return _stopped() if status == STOPPED else status
    except typer.TyperException as error:
        words = error.format_message().rstrip(".")
        # Without arguments a group has printed its help, and its error says nothing.
        return _say(f"{words}; --help says what is right", WRONG_INPUT) if words else WRONG_INPUT
    except (ValueError, OSError) as error:
        if os.environ.get(TRACEBACK):
            raise
        return _say(str(error), WRONG_INPUT)
    except (KeyboardInterrupt, typer.Abort):
        return _stopped()
    except Exception as error:  # the last resort: one line instead of a traceback
        if _interrupted(error):
            return _stopped()
        return _say(f"internal error, please report it: {type(error).__name__}: {error}", OUR_FAULT)


def _interrupted(error: BaseException) -> bool:
    """Return whether an error comes of an interrupt: compiled kernels make others of it."""
    cause = error.__cause__
    return cause is not None and (isinstance(cause, KeyboardInterrupt) or _interrupted(cause))


def _stopped() -> int:
    return _say("stopped; no file is left half-written", STOPPED)


def _say(message: str, status: int) -> int:
    """Print a message as one line on stderr and return the status."""
    print(f"bluntdissect: {' '.join(message.split())}", file=sys.stderr)
    return status
