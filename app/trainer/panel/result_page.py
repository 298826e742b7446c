"""The result page: how a run has ended, its measures, its plots, and what can be done with it."""

from collections.abc import Callable

import viser

from app.simulation.exercise import HoldStretch
from app.simulation.replay import Replay, Series, series_csv
from app.simulation.run_log import RunFile, run_json
from app.trainer.panel.controls import heading, on_click
from app.trainer.panel.measures_table import measures_html, outcome_html
from app.trainer.panel.plots import add_series_plots
from app.trainer.workplace import Workplace

__all__ = ["ResultPage", "run_csv"]

FEW = 300
"""Vertices of a duct that is only measured."""


def _series(run: RunFile, workplace: Workplace) -> Series:
    organ = workplace.session.dissection.organ
    return Replay(run.log, organ, vertices=FEW).series()


def run_csv(run: RunFile, workplace: Workplace) -> bytes:
    """Return a run tick by tick, as comma-separated values.

    Parameters
    ----------
    run
        The run.
    workplace
        Whose organ it was made on.

    Returns
    -------
    bytes
        UTF-8.
    """
    return series_csv(_series(run, workplace)).encode()


class ResultPage:
    """A page over the trainer with one run's result, until it is closed.

    Parameters
    ----------
    workplace
        The client's workplace.
    run
        The run.
    again
        Starts the same exercise again; None for a run without one.
    replay
        Shows the run again.
    """

    def __init__(
        self,
        workplace: Workplace,
        run: RunFile,
        *,
        again: Callable[[], object] | None,
        replay: Callable[[], object],
    ) -> None:
        gui, client = workplace.client.gui, workplace.client
        series = _series(run, workplace)
        exercise = run.log.exercise
        title = "Free pull" if exercise is None else exercise.title
        self._open = True
        self._modal = gui.add_modal("Result")
        with self._modal:
            gui.add_html(outcome_html(run.outcome, title) + measures_html(run.measures))
            gui.add_html(heading("Over time"))
            limit = exercise.force_limit_N if isinstance(exercise, HoldStretch) else None
            add_series_plots(gui, series, force_line=limit)
            buttons: list[tuple[str, viser.IconName, Callable[[], object], str]] = [
                ("Watch it again", viser.Icon.PLAYER_PLAY, replay, "gray"),
                (
                    "Download CSV",
                    viser.Icon.TABLE_EXPORT,
                    lambda: client.send_file_download(
                        "run.csv", series_csv(series).encode(), save_immediately=True
                    ),
                    "gray",
                ),
                (
                    "Download JSON",
                    viser.Icon.DOWNLOAD,
                    lambda: client.send_file_download(
                        "run.json", run_json(run), save_immediately=True
                    ),
                    "gray",
                ),
            ]
            if again is not None:
                buttons.append(("Try again", viser.Icon.REFRESH, again, "teal"))
            for label, icon, action, colour in buttons:
                button = gui.add_button(label, icon=icon, color=colour)  # pyright: ignore[reportArgumentType]
                closes = not label.startswith("Download")
                on_click(button, lambda action=action, closes=closes: self._do(action, closes))
            on_click(gui.add_button("Close", icon=viser.Icon.X, color="gray"), self.close)

    def close(self) -> None:
        """Close the page."""
        if self._open:
            self._open = False
            self._modal.close()

    def _do(self, action: Callable[[], object], closes: bool) -> None:
        if closes:
            self.close()
        action()
