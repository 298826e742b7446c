"""Write docs/errors.md from the table of error classes: `python tests/app/errors_page.py FILE`."""

import re
import sys
from pathlib import Path

from simulated import phantom

from app.simulation import (
    ERROR_CLASSES,
    EXERCISES,
    MODES,
    Conditions,
    ErrorClass,
    Specimen,
    bed_named,
    default_preset,
)
from app.simulation.exercises.errors import CLOSED_AFTER
from benchmarks.cheat_scripts import CHEATS
from benchmarks.faults import FAULTS

HEAD = """\
# Errors

For teachers and researchers. At its end you know when an error is counted, why at that value, and
what the trainee is told.

A run's errors are found tick by tick from the state of duct, tissue and hands. A run file holds
none: `bluntdissect replay run.json` finds those of any run again from its inputs.

Raters count errors of technique in recordings (OCHRA, observational clinical human reliability
analysis): 11 in a cholecystectomy, 4 of them with a consequence, most where tissue is teased or
bluntly dissected (1). What keeps the method rare is the raters' time (2). Here as there an error
is an *incident*: it opens with its condition and closes when that has not held for {closed:g} s.
Its mode is one of OCHRA's external error modes. Its consequence is measured up to 1 s after it:

| consequence | when |
|---|---|
| near miss | the stress passed the exercise's limit, or the break was nearer than a reaction time |
| minor | strands parted out of sight, a wall tore in part, or up to 2 ml of blood were lost |
| injury | a tube tore, is torn through its wall, or more blood was lost |

An incident names its tube where there are several. An exercise names the classes that fail it,
with the most incidents that do not; a teacher's exercise file may change them (`[errors]`,
[class](class.md)). Where a limit fails it, the verdict names the incident of the last second that
stands first below; a result of others only if none began before it. The verdict on a tear of one of
several tubes is the tear's own, which names what the hand did. In the trainer's own
exercises no incident is allowed of these:

| exercise | classes that fail it |
|---|---|
{failing}

## Classes

**None of these numbers is a published limit of force or speed for blunt dissection: a search found
none.** Each follows from the bed, the duct and a reaction time, or is a choice, as it says beside
it. Values are for the thesis's duct in the bed *normal*, without an exercise. Errors of a front,
of leaning and of lifting are found at a duct in one bed only.

| error | an incident begins when | the trainee reads |
|---|---|---|
"""

TAIL = """
## How well they are found

Scripted faults (`benchmarks/faults.py`) are {faults} ways to do an exercise wrongly, at three
speeds each. Another {cheats} scripts (`benchmarks/cheat_scripts.py`) look for a pass without what
an exercise teaches: none finds one. [How the exercises were tested](exercises-tested.md) has the
figures of each class. To find errors takes 6 to 8 µs of a tick in the median
while good hands do an exercise at one duct. While the recorded hands do *Critical view* it takes
10 µs, and 15 µs in the mean (`python -m benchmarks finder`, two quiet cores, 30 November 2026).

One author wrote the faults and their finder, and every hand here is a script: whether raters see
the same errors in people's runs has not been measured. Holds slip, and walls tear in part, at
anatomies with the ureter's wall only: of their own walls the artery tears first, and at once. What
is freed away from the goal is no error: the exercise says that it does not count. Jaws that do not
pass a tube's whole width close nothing.

## Sources

1. Tang, Hanna, Joice and Cuschieri 2004, Arch Surg 139:1215: OCHRA of 200 laparoscopic
   cholecystectomies.
2. Tang and Cuschieri 2020: a systematic review of OCHRA, 26 studies.
3. Heijnsdijk, Pasdeloup, van der Pijl and others 2004, Surg Endosc 18:980: at a pull of 5 N
   people pinched pig bowel with 6.8 N, where 3.0 N kept it from slipping. So what they pinch
   slips at 5 N x 6.8 / 3.0 = 11.3 N. Of holds on gallbladders 17 % slipped (Heijnsdijk, Dankelman
   and Gouma 2002, Surg Endosc 16:1329).
"""


def page() -> str:
    """The page, as Markdown."""
    specimen = Specimen(default_preset(phantom()), phantom(), bed_named("normal"))
    assert specimen.bed is not None
    beam = specimen.space_beam(elements=2)
    tissue = Conditions(
        specimen.bed.yield_mm, specimen.bed.failure_mm, float(beam.radius.mean()), None, None
    )
    failing = "\n".join(
        f"| {name.replace('_', ' ')} | {', '.join((*kind.errors, *kind.errors_at_end))} |"
        for name, kind in EXERCISES.items()
    )
    return (
        HEAD.format(closed=CLOSED_AFTER, failing=failing)
        + "\n".join(_row(each, tissue) for each in ERROR_CLASSES.values())
        + "\n"
        + TAIL.format(faults=len(FAULTS), cheats=len(CHEATS))
    )


def _row(each: ErrorClass, tissue: Conditions) -> str:
    # What is joined to the word before it, as what did it, is there in some incidents only.
    happened = re.sub(r"(?<=[^ ])\{\w+\}", "", each.happened)
    happened = re.sub(r"\{\w+(:[^}]*)?\}", "...", happened)
    instead = re.sub(r"\{\w+(:[^}]*)?\}", "...", each.instead)
    only = " Only in an exercise that names it." if each.if_named else ""
    only += " A result of others." * each.is_result
    values = "".join(
        f"<br>{p.key} = " + f"{p.of(tissue):.3g} {p.unit}".rstrip() + f" ({p.why})"
        for p in each.parameters
    )
    return (
        f"| **{each.title}**<br>`{each.key}`<br>mode {each.mode}: {MODES[each.mode]} "
        f"| {each.begins}.{only}{values} | {happened[0].upper()}{happened[1:]}. {instead} |"
    )


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), encoding="utf-8")
