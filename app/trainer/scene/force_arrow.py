"""A hand's force: an arrow with a number where it pulls."""

import math

import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.drawn import Drawn
from app.trainer.viser_bridge.fast_transport import place_node, stream

FORCE_COLOR = (255, 196, 60)


class ForceArrow(Drawn):
    """An arrow with a number: a hand's force. Hidden until it is made visible.

    `span`, between the clamps, mm: the force at break is drawn a fifth as long.
    """

    def __init__(self, scene: viser.SceneApi, span: float, name: str) -> None:
        self._length = 0.2 * span
        self._arrow = scene.add_arrows(
            name,
            np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]], np.float32),
            FORCE_COLOR,
            shaft_radius=0.008 * span,
            head_radius=0.020 * span,
            head_length=0.045 * span,
            visible=False,
        )
        self._label = scene.add_label(f"{name}_label", "", visible=False)
        super().__init__(self._arrow, self._label)

    def show(
        self, foot: NDArray[np.float64], force: NDArray[np.float64], *, at_break: float
    ) -> None:
        """Draw a force, (3,) N, from its foot, (3,) mm; `at_break`, N, sets the scale."""
        size = math.hypot(*force.tolist())
        length = self._length * min(size / at_break, 1.5) if at_break > 0.0 else 0.0
        drawn = self._visible and size > 0.0
        if drawn:
            tip = foot + force * (max(length, 0.3 * self._length) / size)
            stream(self._arrow, "points", np.array([[foot, tip]], np.float32))
            place_node(self._label, *tip.tolist())
            stream(self._label, "text", f"{size:.2f} N")
        if drawn != self._arrow.visible:
            self._arrow.visible = self._label.visible = drawn
