"""What is drawn of several scene nodes, which are shown, hidden and removed together."""

from typing import Any

__all__ = ["Drawn"]


class Drawn:
    """Scene nodes that were added hidden: one thing to whoever looks.

    Parameters
    ----------
    parts
        Their handles.
    """

    def __init__(self, *parts: Any) -> None:
        self._parts = parts
        self._visible = False

    @property
    def visible(self) -> bool:
        """Whether it is drawn."""
        return self._visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        if visible != self._visible:
            self._visible = visible
            for part in self._parts:
                part.visible = visible

    def remove(self) -> None:
        """Take it off the scene."""
        for part in self._parts:
            part.remove()
