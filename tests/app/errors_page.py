"""Write docs/errors.md from the table of error classes: `python tests/app/errors_page.py FILE`."""

import re
import sys
from pathlib import Path

from faults import FAULTS
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
from app.simulation.errors import CLOSED_AFTER

HEAD = """\
# Errors

For teachers and researchers who want to know when an error is counted, and why at that value.

A run's errors are found from the state of duct, tissue and hands, tick by tick, and told in words:
what you did, where, and what to do instead. `bluntdissect replay run.json` prints those of a run,
also of one that was recorded before there were any: a run file holds no errors, they are found
again from its inputs.

Errors of technique in laparoscopic surgery are counted by raters who watch recordings (OCHRA,
observational clinical human reliability analysis): 11 in a cholecystectomy, 4 of them with a
consequence, and most of them where tissue is teased or bluntly dissected (1). What keeps the
method rare is the raters' time (2). Here as there an error is an *incident*: it opens with its
condition and closes when that has not held for {closed:g} s, however many ticks it lasts. Modes
are the external error modes of OCHRA.

The consequence is measured, up to 1 s after the incident: *near miss*, the stress passed the
exercise's limit or the break was nearer than a reaction time; *minor*, strands parted out of
sight; *injury*, a tube tore. A bleeding is *minor* up to 2 ml of blood and an *injury* beyond.

In an anatomy of several tubes an incident names its tube; errors of a front and of leaning are of
a duct in one bed only.

An exercise, of a free duct too, names the classes that fail it, with the most incidents that do
not; a teacher's exercise file may change them (`[errors]`, [class](class.md)). Where a limit fails
it, the verdict names the incident of the last second that stands first in the table below. In the
trainer's own exercises no incident is allowed of these:

| exercise | classes that fail it |
|---|---|
{failing}

**None of these numbers is a published limit of force or speed for blunt dissection: a search found
none.** They follow from the bed, the duct and a reaction time, or are choices of this program, as
it says beside each. Values are for the thesis's duct in the bed *normal*, without an exercise.

"""

TAIL = """\
## How well they are found

Scripted faults (`tests/app/faults.py`): {faults} ways to do an exercise wrongly at three speeds
each, in beds 41 and 42 of *loose*, *normal*, *firm* and *inflamed* tissue, which no parameter
was set by, with steady hands and with a tremor of 0.15 and 0.3 mm: 2734 of 2736 have an incident
of the class that is meant, and none passes. Of 240 runs of good hands in beds 41 to 60 there are
0 incidents where they are steady, 3 with a tremor of 0.15 mm and 40 with 0.3 mm.

The same author wrote the faults and their finder, and every hand here is a script: whether
raters see the same errors in people's runs has not been measured. Errors of several tubes are
tried by a few scripts only. Errors of a grasper that slips and of instruments outside a
laparoscope's picture are not found yet.

## Sources

1. Tang, Hanna, Joice and Cuschieri 2004, Arch Surg 139:1215: OCHRA of 200 laparoscopic
   cholecystectomies.
2. Tang and Cuschieri 2020: a systematic review of OCHRA, 26 studies.
"""


def page() -> str:
    """The page, as Markdown."""
    specimen = Specimen(default_preset(phantom()), phantom(), bed_named("normal"))
    assert specimen.bed is not None
    beam = specimen.space_beam(elements=2)
    tissue = Conditions(
        specimen.bed.yield_mm, specimen.bed.part_mm, float(beam.radius.mean()), None, None
    )
    failing = "\n".join(
        f"| {name.replace('_', ' ')} | {', '.join(kind.errors)} |"
        for name, kind in EXERCISES.items()
    )
    return (
        HEAD.format(closed=CLOSED_AFTER, failing=failing)
        + "\n".join(_section(each, tissue) for each in ERROR_CLASSES.values())
        + "\n"
        + TAIL.format(faults=len(FAULTS))
    )


def _section(each: ErrorClass, tissue: Conditions) -> str:
    happened = re.sub(r"\{\w+(:[^}]*)?\}", "...", each.happened)
    instead = re.sub(r"\{\w+(:[^}]*)?\}", "...", each.instead)
    only = " Only in an exercise that names it." if each.if_named else ""
    lines = [
        f"## {each.title}",
        "",
        f"`{each.key}`, mode {each.mode}: {MODES[each.mode]}. An incident begins when "
        f"{each.begins}.{only}",
        "",
        f"> {happened[0].upper()}{happened[1:]}. {instead}",
        "",
    ]
    if each.parameters:
        lines += ["| parameter | value | why |", "|---|---|---|"]
        lines += [
            f"| {p.key} | {p.of(tissue):.3g} {p.unit}".rstrip() + f" | {p.why} |"
            for p in each.parameters
        ]
        lines.append("")
    return "\n".join(lines)


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), encoding="utf-8")
