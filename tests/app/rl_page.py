"""Write its page's tables from the code: `python tests/app/rl_page.py docs/rl-spaces.md`."""

import sys
from pathlib import Path

from app.rl.task import ACTIONS, AT_ANATOMY, OBSERVATIONS, REWARDS, Number, Task

SHAPES = {"hands": "(hands, 12)", "duct": "(41, 3)", "strands": "(51,)"}
SHAPES_AT_ANATOMY = {
    "hands": "(hands, 16)",
    "duct": "(95, 3)",
    "strands": "(219,)",
    "tubes": "(5, 2)",
    "fluids": "(2, 2)",
}
START, END = "<!-- from the code -->\n", "<!-- to here -->\n"


def tables() -> str:
    """The tables, as Markdown."""
    lines: list[str] = []
    for key, numbers in OBSERVATIONS.items():
        shape = SHAPES.get(key, f"({len(numbers)},)")
        lines += [f"### `{key}`, {shape} float32", "", *_rows(numbers), ""]
    lines += ["### Actions, (hands x 5,) float32", ""]
    lines += [
        "With free instruments there are 6 for each hand, at an anatomy 6, and with both 7.",
        "",
        *_rows(ACTIONS),
        "",
        "### Reward",
        "",
        "| term | weight | times |",
        "|---|---|---|",
    ]
    lines += [f"| {name} | {weight:g} | {what} |" for name, (weight, what) in REWARDS.items()]
    lines += ["", "### At an anatomy", ""]
    for key, numbers in AT_ANATOMY.items():
        shape = SHAPES_AT_ANATOMY.get(key, f"({len(numbers)},)")
        in_bed = OBSERVATIONS.get(key, ())
        others = tuple(each for each in numbers if each not in in_bed)
        if not others:
            lines += [f"`{key}`, {shape} float32, has the same numbers as in a bed.", ""]
        else:
            beside = ": as in a bed; these differ or follow" if len(others) < len(numbers) else ""
            lines += [f"`{key}`, {shape} float32{beside}", "", *_rows(others), ""]
    return "\n".join(lines).rstrip() + "\n"


def _rows(numbers: tuple[Number, ...]) -> list[str]:
    span = Task().duct.beam.span
    return [
        "| number | unit | from | to | what |",
        "|---|---|---|---|---|",
        *(
            f"| {n.name} | {n.unit} | {n.low:g} | {n.high + span * n.with_span:g} | {n.meaning} |"
            for n in numbers
        ),
    ]


def renewed(page: str) -> str:
    """A page with its tables made anew."""
    before, rest = page.split(START)
    return before + START + "\n" + tables() + "\n" + END + rest.split(END)[1]


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(renewed(path.read_text(encoding="utf-8")), encoding="utf-8")
