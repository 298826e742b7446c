"""Scene nodes that are shown, hidden and removed together."""

from typing import Any

__all__ = ["Drawn"]


class Drawn:
    """Scene nodes, added hidden, that are handled as one; `parts` are their handles."""

    def __init__(self, *parts: Any) -> None:
        self._parts = parts
        self._visible = False

    @property
    def visible(self) -> bool:
        """Whether it is shown."""
        return self._visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        if visible != self._visible:
            self._visible = visible
            for part in self._parts:
                part.visible = visible

    def remove(self) -> None:
        """Remove it from the scene."""
        for part in self._parts:
            part.remove()
