"""The assistant who holds the scope: both tips in view, a steady horizon, no jumps."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from app.trainer.scope.pose import Laparoscope, Pose

Floats = NDArray[np.float64]

INNER = 0.75
"""Part of the picture, from its middle, within which tips move and the picture stands still."""
FARTHEST = 95.0
"""Distance at which the assistant holds what is worked at, at most, mm."""
SPEED, RATE = 28.0, 4.0
"""mm/s at most, and 1/s, at which the scope goes after tips that leave the inner part."""
ROOM = 2.4
"""Distance over that of a tip from the middle of both, at which they are in the inner part."""


class Assistant:
    """Looks at a place at a distance, and goes after tips only as far as they leave the picture.

    So a drag within the inner part is aimed at a picture that stands still.
    """

    def __init__(self, scope: Laparoscope, pose: Pose, target: Floats, distance: float) -> None:
        self.scope, self._target = scope, np.array(target, dtype=np.float64)
        self._nearest = self._distance = float(distance)
        self.pose = scope.look(self._target, self._distance, pose)

    def follow(self, tips: Sequence[Floats], seconds: float) -> Pose:
        """Return the pose a moment later, s, with tips, (3,) mm each, where they are."""
        camera = self.scope.camera(self.pose)
        out = [max(0.0, 1.0 - INNER / max(camera.seen(tip)[0], INNER)) for tip in tips]
        if any(out):
            places = np.stack(list(tips))
            beyond = np.array(out) @ (places - self._target) / np.count_nonzero(out)
            beyond -= float((beyond * camera.axes[:, 2]).sum()) * camera.axes[:, 2]
            self._target = self._target + _step(beyond, seconds)
            middle = np.mean(places, axis=0)
            apart = max(math.sqrt(float(((tip - middle) ** 2).sum())) for tip in tips)
            wanted = min(max(self._nearest, ROOM * apart), FARTHEST)
            far = max(out) * np.array([wanted - self._distance])
            self._distance += float(_step(far, seconds)[0])
            self.pose = self.scope.look(self._target, self._distance, self.pose)
        return self.pose


def _step(path: Floats, seconds: float) -> Floats:
    """Return how much of a path, mm, is gone in a moment, s."""
    far = math.sqrt(float((path * path).sum()))
    return path * min(1.0, RATE * seconds, SPEED * seconds / far if far > 0.0 else 1.0)
