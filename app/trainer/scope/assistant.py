"""The assistant who holds the scope: both tips in view, a steady horizon, no jumps."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from app.trainer.scope.pose import Laparoscope, Pose

__all__ = ["Assistant"]

Floats = NDArray[np.float64]

INNER = 0.55
"""Part of the picture, from its middle, within which tips move without the scope following."""
NEAREST, FARTHEST = 42.0, 95.0
"""Distances at which the assistant holds what is worked at, mm."""
SPEED, RATE = 28.0, 2.2
"""mm/s at most, and 1/s, at which the place that is looked at follows the tips."""


class Assistant:
    """Looks at a place at a distance, and follows tips that leave the middle of the picture."""

    def __init__(self, scope: Laparoscope, pose: Pose, target: Floats, distance: float) -> None:
        self.scope = scope
        self.aim(pose, target, distance)

    def aim(self, pose: Pose, target: Floats, distance: float) -> None:
        """Hold the scope so from now on, at once."""
        self._target, self._distance = np.array(target, dtype=np.float64), float(distance)
        self.pose = self.scope.look(self._target, self._distance, pose)

    def follow(self, tips: Sequence[Floats], seconds: float) -> Pose:
        """Return the pose a moment later, s, with tips, (3,) mm each, where they are."""
        if not tips:
            return self.pose
        camera = self.scope.camera(self.pose)
        farthest = max(camera.seen(tip)[0] for tip in tips)
        middle = np.mean(np.stack(list(tips)), axis=0)
        if farthest > INNER:
            # As fast as they leave: at the edge with all speed, at the inner part's not at all.
            haste = min(1.0, (farthest - INNER) / (1.0 - INNER))
            self._step(middle, haste, seconds)
            apart = max(math.sqrt(float(((tip - middle) ** 2).sum())) for tip in tips)
            wanted = min(max(self._distance, 2.4 * apart), FARTHEST)
            far = wanted - self._distance
            most = SPEED * seconds * haste
            self._distance += min(max(far, -most), most)
            self._distance = max(self._distance, NEAREST)
            self.pose = self.scope.look(self._target, self._distance, self.pose)
        return self.pose

    def _step(self, middle: Floats, haste: float, seconds: float) -> None:
        offset = middle - self._target
        far = math.sqrt(float((offset * offset).sum()))
        if far == 0.0:
            return
        step = min(far * min(1.0, RATE * haste * seconds), SPEED * haste * seconds)
        self._target = self._target + (step / far) * offset
