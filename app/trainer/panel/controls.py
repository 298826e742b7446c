"""What the tabs share: callbacks of inputs, and pieces of HTML."""

import asyncio
import html
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any, Generic, TypeVar

import viser

from app.trainer.stage.heat_map import KPA_PER_MPA as KPA_PER_MPA
from app.trainer.viser_bridge.private_api import page_number


def on_input(handle: Any, take: Callable[[Any], None]) -> None:
    """Call back with values set in the browser, in order; not with those set by the server."""
    # It runs on the server's event loop, so `take` must be quick.

    @handle.on_update
    async def _(event: viser.GuiEvent[Any]) -> None:
        if event.client_id is not None and handle.visible and not handle.disabled:
            take(handle.value)


def on_work(handle: Any, take: Callable[[Any], None]) -> None:
    """Call back with values set in the browser, in a thread of its own, for slow work."""
    # The value is read at once: until a thread is free, a panel may show the present one again.

    @handle.on_update
    async def _(event: viser.GuiEvent[Any]) -> None:
        if event.client_id is not None and handle.visible:
            asyncio.get_running_loop().run_in_executor(None, take, handle.value)


def on_click(handle: viser.GuiButtonHandle, do: Callable[[], object]) -> None:
    """Call back when a button is pressed, in a thread of its own."""
    # A disabled or hidden button is never pressed, whatever a browser sends.

    @handle.on_click
    def _(_: object) -> None:
        if handle.visible and not handle.disabled:
            do()


def command(
    gui: viser.GuiApi, name: str, hint: str, take: Callable[[], object], *, slow: bool
) -> viser.CommandHandle:
    """Add a command, which what has its `page_number` as `data-command` runs when pressed."""
    made = gui.add_command(name, description=hint)
    if slow:

        @made.on_trigger
        def _(_: object) -> None:
            take()
    else:

        @made.on_trigger
        async def _(_: object) -> None:
            take()

    return made


def set_if_changed(handle: Any, **values: object) -> None:
    """Set only those properties of a widget that differ: each one set is sent to the page."""
    for name, value in values.items():
        if getattr(handle, name) != value:
            setattr(handle, name, value)


def number(value: object) -> float:
    """Return a value from the browser as a number, NaN if it is not one."""
    return float(value) if isinstance(value, int | float) else float("nan")


def slider_step(limit: float) -> float:
    """Return the power of ten that divides a scale into 100 to 1000 steps."""
    return float(10.0 ** (math.floor(math.log10(limit)) - 2.0))


def figure(value: float | None) -> str:
    """Return a figure as text with few digits, for reading at a glance."""
    if value is None:
        return "–"
    size = abs(value)
    if size >= 100.0:
        return f"{value:,.0f}"
    return f"{value:.1f}" if size >= 10.0 else f"{value:.2f}"


def term(name: str, meaning: str) -> str:
    """Return a term of art with its meaning as a tooltip, as HTML."""
    return (
        f"<span title='{meaning}' style='cursor:help;text-decoration:underline dotted "
        f"rgba(255,255,255,.35);text-underline-offset:3px'>{name}</span>"
    )


def heading(text: str) -> str:
    """Return a heading inside a tab, as HTML."""
    return f"<div style='padding:10px 12px 4px;font-size:13px;font-weight:600'>{text}</div>"


def note(text: str, name: str = "") -> str:
    """Return a paragraph inside a tab, as HTML."""
    found = f" data-testid='{name}'" if name else ""
    return (
        f"<div{found} style='padding:2px 12px 8px;font-size:13px;line-height:1.4;opacity:.9'>"
        f"{text}</div>"
    )


def rows_html(rows: Iterable[Sequence[str]], *styles: str) -> str:
    """Return a table's rows of HTML, each column in its style, as HTML."""
    cells = [f"<td style='{style}'>" if style else "<td>" for style in styles]
    return "".join(
        f"<tr>{''.join(f'{cell}{text}</td>' for cell, text in zip(cells, row, strict=True))}</tr>"
        for row in rows
    )


def paragraphs_html(*paragraphs: tuple[str, str]) -> str:
    """Return paragraphs of plain text inside a tab, each with its title, as HTML."""
    return "".join(
        f"<div style='padding:6px 12px;font-size:13px'><b>{html.escape(title)}</b>"
        f"<div style='opacity:.85;margin-top:2px'>{html.escape(text)}</div></div>"
        for title, text in paragraphs
    )


Value = TypeVar("Value", bound=str)


class Choice(Generic[Value]):
    """Buttons in a row of which one is chosen; each runs a command, which all commands list too.

    `options` has their labels and hints by value; `hidden` says the row's name to screen readers
    only. `take` is called with a value, in a thread of its own if it is slow.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        label: str,
        options: Mapping[Value, tuple[str, str]],
        take: Callable[[Value], object],
        *,
        slow: bool = False,
        hidden: bool = False,
        large: bool = False,
    ) -> None:
        self._label, self._hidden, self._large = label, hidden, large
        self._options = [
            (
                value,
                text,
                hint,
                page_number(
                    command(gui, f"{label}: {text}", hint, partial(take, value), slow=slow)
                ),
            )
            for value, (text, hint) in options.items()
        ]
        self._row = gui.add_html("")
        self._shown: tuple[Value, bool] | None = None

    def show(self, chosen: Value, *, active: bool = True) -> None:
        """Show which one is chosen, and whether this row is the one in use."""
        if self._shown == (chosen, active):
            return
        self._shown = chosen, active
        buttons = "".join(
            f"<button type='button' data-command='{number}' title='{html.escape(hint, quote=True)}'"
            f" aria-pressed='{'true' if value == chosen else 'false'}'>{html.escape(text)}</button>"
            for value, text, hint, number in self._options
        )
        look = f"bd-choice{'' if active else ' bd-idle'}{' bd-large' if self._large else ''}"
        name = "" if self._hidden else f"<span>{html.escape(self._label)}</span>"
        self._row.content = (
            f"<div class='{look}' role='group' aria-label='{html.escape(self._label)}'>"
            f"{name}<div>{buttons}</div></div>"
        )
