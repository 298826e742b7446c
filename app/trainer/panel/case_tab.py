"""Build: the tubes that were found in labels, how they join, and the case that is made of them."""

import base64
import html
from collections.abc import Callable
from typing import Literal, get_args

import viser

from app.anatomy import Anatomy, CaseWorkbench, TubeEndName
from app.trainer.client.page_state import PageState
from app.trainer.panel.controls import note, on_click, on_work, rows_html
from physics.bed import End

_TELLING = (
    "Tubes that were found in the labels. Choose one: leave it out, or choose what its ends join. "
    "Then save the case, and practise on it."
)
_JOINS = "joins "
_ENDS: tuple[Literal[0, 1], ...] = (0, 1)
_ARTERY = "Draw a cystic artery (assumed)"


class CaseTab:
    """The tab in which a case is chosen; `practise` shows an anatomy."""

    def __init__(
        self,
        gui: viser.GuiApi,
        state: PageState,
        case: CaseWorkbench,
        practise: Callable[[Anatomy], None],
    ) -> None:
        self._state, self._case, self._practise = state, case, practise
        gui.add_html(note(_TELLING))
        self._picture = gui.add_html("")
        self._tube = gui.add_dropdown("Tube", case.tubes, hint="Its ends are marked 0 and 1")
        self._included = gui.add_checkbox("Part of the case", True)
        self._ends = [
            gui.add_dropdown(f"End {end}", ["free"], hint="How it is held, or what it joins")
            for end in _ENDS
        ]
        self._artery = gui.add_checkbox(
            _ARTERY,
            case.choices.draw_artery,
            visible=case.takes_artery,
            hint="By published frequencies: no image shows it",
        )
        self._standing = gui.add_html("")
        self._save = gui.add_button(
            "Save the case", icon=viser.Icon.DEVICE_FLOPPY, hint=f"Into {case.folder}"
        )
        self._practise_on = gui.add_button("Practise on it", icon=viser.Icon.HAND_GRAB)
        self._saved = gui.add_html("")
        self.show()
        on_work(self._tube, lambda _: self.show())
        on_work(self._included, self._include)
        on_work(self._artery, lambda on: self._change(lambda: case.draw_artery(on is True)))
        for end, field in zip(_ENDS, self._ends, strict=True):
            on_work(field, lambda value, end=end: self._choose_end(end, value))
        on_click(self._save, self._write)
        on_click(self._practise_on, self._show_it)

    def show(self) -> None:
        """Show the case as it is now."""
        case, tube = self._case, self._tube.value
        there = tube not in case.choices.without
        self._included.value = there
        others = [f"{_JOINS}{name}" for name in case.tubes if name != tube]
        others = [each for each in others if each.removeprefix(_JOINS) not in case.choices.without]
        for end, field in zip(_ENDS, self._ends, strict=True):
            field.visible = there
            if there:
                field.options = [*get_args(End), *others]
                field.value = case.end((tube, end))
        self._artery.value = case.choices.draw_artery
        data = base64.b64encode(case.picture(tube if there else None)).decode()
        joins = [f"{join.tube} joins {join.to}" for join in case.case.anatomy.join]
        described = html.escape(f"Tubes from the front and the right: {'; '.join(joins)}")
        self._picture.content = (
            f"<div style='padding:2px 12px'><img data-testid='case-picture' alt='{described}' "
            f"src='data:image/png;base64,{data}' style='display:block;width:100%'></div>"
        )
        self._standing.content = _standing(case)
        self._saved.content = ""

    def _include(self, value: object) -> None:
        tube = self._tube.value
        self._change(lambda: self._case.leave_out(tube, value is not True))

    def _choose_end(self, end: Literal[0, 1], value: str) -> None:
        case = self._case
        name: TubeEndName = (self._tube.value, end)
        if value == case.end(name):
            return
        if value.startswith(_JOINS):
            self._change(lambda: case.join(name, value.removeprefix(_JOINS)))
        else:
            how: End = next(each for each in get_args(End) if each == value)
            self._change(lambda: case.hold(name, how))

    def _change(self, change: Callable[[], object]) -> None:
        """Change the case, and show it; what cannot be is said and leaves it as it was."""
        self._state.attempt("Finding the tubes' ends.", change)
        self.show()

    def _write(self) -> None:
        def write() -> None:
            files = self._case.save()
            where = html.escape(str(self._case.folder))
            self._saved.content = note(f"{len(files)} files are in {where}.", "case-saved")

        self._state.attempt("Saving the case.", write)

    def _show_it(self) -> None:
        self._case.practised = True
        self._practise(self._case.case.anatomy)


def _standing(case: CaseWorkbench) -> str:
    """Return the joins and doubts, as HTML."""
    rows: list[tuple[str, str]] = []
    for join in case.case.anatomy.join:
        where = join.at_mm if isinstance(join.at_mm, str) else f"{join.at_mm:.1f} mm"
        assumed = case.case.anatomy.tube_named(join.tube).confidence == "assumed"
        words = f"end {join.end} of {join.tube} at {where} of {join.to}"
        rows.append(("join", html.escape(words) + (", assumed" if assumed else "")))
    rows += [("doubt", html.escape(doubt)) for doubt in case.case.doubts]
    table = rows_html(rows, "padding:1px 10px 1px 0;opacity:.75;vertical-align:top", "")
    return (
        f"<table data-testid='case-standing' data-joins='{len(case.case.anatomy.join)}' "
        f"data-tubes='{len(case.case.anatomy.tube)}' style='margin:2px 12px 6px;font-size:13px'>"
        f"{table}</table>"
    )
