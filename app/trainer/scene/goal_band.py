"""The goal of an exercise in the picture: a band over the duct, or a stretch of its bed."""

import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.drawn import Drawn, add_mesh

GOAL_COLOR = (92, 200, 255)
HALF_LENGTH = 0.3
"""Half the band's length over the span: its ends show beside the hook and a raised duct."""
# Gap between label and hook, in half lengths; the force is written on the hook's other side.
LABEL_ASIDE = 0.15
# px.
LINE_WIDTH = 2.5
RING_MM, RING_SIDES = 1.5, 24
LIT_MM, LIT_COLOR = 3.5, (255, 255, 255)
"""Of the ring round a hand that has made an error: white, so that no colour needs to be told."""


def _lines(
    scene: viser.SceneApi, name: str, segments: NDArray[np.float32]
) -> viser.LineSegmentsHandle:
    """Add (L, 2, 3) segments, mm, in the goal's colour and as wide in any view."""
    return scene.add_line_segments(
        name, segments, GOAL_COLOR, thickness=LINE_WIDTH, thickness_units="screen"
    )


class GoalBand(Drawn):
    """A band into which the duct's upper edge is to be brought at the hook."""

    def __init__(self, scene: viser.SceneApi) -> None:
        corners = np.zeros((4, 3), np.float32)
        self._area = add_mesh(
            scene,
            "/organ/goal/area",
            corners,
            np.array([[0, 1, 2], [0, 2, 3]]),
            color=GOAL_COLOR,
            opacity=0.3,
            material="standard",
            side="double",
        )
        self._edges = _lines(scene, "/organ/goal/edges", np.zeros((2, 2, 3), np.float32))
        self._label = scene.add_label("/organ/goal/label", "Goal", anchor="bottom-right")
        super().__init__(self._area, self._edges, self._label)
        self._place: tuple[bytes, bytes] | None = None

    def show(
        self,
        low: NDArray[np.float64],
        high: NDArray[np.float64],
        along: NDArray[np.float64],
    ) -> None:
        """Draw the band from `low` to `high`, (3,) mm; `along` is half its length, (3,) mm."""
        place = low.tobytes(), high.tobytes()
        if place == self._place:
            return
        self._place = place
        ends = np.array([low - along, low + along, high + along, high - along], np.float32)
        self._area.vertices = ends
        self._edges.points = ends[[0, 1, 2, 3]].reshape(2, 2, 3)
        self._label.position = high - LABEL_ASIDE * along

    def say(self, text: str) -> None:
        """Write beside the band what to do now."""
        if text != self._label.text:
            self._label.text = text


class GoalStretch(Drawn):
    """A bracket before the duct, from and to where it is to be freed, mm from the first clamp."""

    def __init__(self, scene: viser.SceneApi, low: float, high: float, radius: float) -> None:
        front, foot, tick = -1.5 * radius, -radius, 0.4 * radius
        places = [(low, foot + tick), (low, foot), (high, foot), (high, foot + tick)]
        corners = np.array([(along, front, up) for along, up in places], np.float32)
        lines = _lines(scene, "/bed/goal", corners[[0, 1, 1, 2, 2, 3]].reshape(3, 2, 3))
        label = scene.add_label(
            "/bed/goal_label", "Free this", position=corners[1:3].mean(axis=0), anchor="top-center"
        )
        super().__init__(lines, label)


class HoldMark(Drawn):
    """How many strands still hold a duct next to what is free of it, at a tick over it there."""

    def __init__(self, scene: viser.SceneApi, radius: float) -> None:
        self._foot, self._tip = 1.1 * radius, 2.0 * radius
        self._tick = _lines(scene, "/bed/holds", np.zeros((1, 2, 3), np.float32))
        self._label = scene.add_label("/bed/holds_label", "", anchor="bottom-center")
        self._shown: tuple[int, float] | None = None
        super().__init__(self._tick, self._label)

    def show(self, strands: int, station: float) -> None:
        """Show so many strands at a station, mm from the first clamp."""
        if self._shown == (strands, station):
            return
        self._shown = strands, station
        ends = np.array([[(station, 0.0, self._foot), (station, 0.0, self._tip)]], np.float32)
        self._tick.points = ends
        self._label.position = ends[0, 1]
        self._label.text = f"{strands} hold{'s' * (strands == 1)} here"


class LitHand(Drawn):
    """A ring round the tip of the hand that has made an error, and whose it is in words."""

    def __init__(self, scene: viser.SceneApi) -> None:
        angles = np.linspace(0.0, 2.0 * np.pi, RING_SIDES + 1)
        around = LIT_MM * np.stack([np.cos(angles), 0.0 * angles, np.sin(angles)], axis=1)
        ring = np.stack([around[:-1], around[1:]], axis=1).astype(np.float32)
        self._frame = scene.add_frame("/lit", show_axes=False)
        scene.add_line_segments(
            "/lit/ring", ring, LIT_COLOR, thickness=2.0 * LINE_WIDTH, thickness_units="screen"
        )
        self._label = scene.add_label(
            "/lit/label", "", position=(0.0, 0.0, LIT_MM), anchor="bottom-center"
        )
        super().__init__(self._frame)

    def show(self, tip: NDArray[np.float64], words: str) -> None:
        """Show it at a tip, (3,) mm."""
        self._frame.position = tip
        if self._label.text != words:
            self._label.text = words


class MoveMark(Drawn):
    """A ring where the tip of an instrument is to be led, and a line to it."""

    def __init__(self, scene: viser.SceneApi) -> None:
        angles = np.linspace(0.0, 2.0 * np.pi, RING_SIDES + 1)
        around = RING_MM * np.stack([np.cos(angles), 0.0 * angles, np.sin(angles)], axis=1)
        self._ring = np.stack([around[:-1], around[1:]], axis=1)
        self._ends = np.zeros((RING_SIDES + 1, 2, 3), np.float32)
        self._shown: tuple[float, ...] = ()
        self._lines = _lines(scene, "/bed/move", self._ends)
        super().__init__(self._lines)

    def show(self, tip: NDArray[np.float64], to: tuple[float, float, float]) -> None:
        """Show the ring, mm, and the line from a tip, (3,) mm."""
        if self._shown == (shown := (*tip.tolist(), *to)):
            return
        self._shown = shown
        self._ends[:-1] = self._ring + to
        self._ends[-1] = tip, to
        self._lines.points = self._ends.copy()  # viser keeps what it is given
