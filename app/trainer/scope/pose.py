"""The pose of a laparoscope in its trocar, and what it sees from there.

A scope has five freedoms: it pans, tilts and slides in its trocar, its cable turns the direction of
view about the shaft where its tip is oblique, and the camera's head turns by itself. `page/pose.js`
has the same algebra.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from app.simulation import FIELD_OF_VIEW

Floats = NDArray[np.float64]

OBLIQUE = math.radians(30.0)
"""Angle between shaft and optical axis of the usual oblique scope, rad."""
# rad and mm, within which a trocar lets the scope move.
MOST_PAN, MOST_TILT = 0.95, 0.80
SHALLOWEST, DEEPEST = 20.0, 205.0


@dataclass(frozen=True, slots=True)
class Pose:
    """How a scope is held: rad, and mm from trocar to tip."""

    pan: float = 0.0  # to the right
    tilt: float = 0.0  # up
    depth: float = 150.0
    cable: float = 0.0  # where an oblique tip looks: 0 up, then clockwise
    head: float = 0.0  # of the camera, clockwise

    def moved(
        self,
        pan: float = 0.0,
        tilt: float = 0.0,
        depth: float = 0.0,
        cable: float = 0.0,
        head: float = 0.0,
    ) -> "Pose":
        """Return the pose after a move, within what the trocar allows."""
        whole = 2.0 * math.pi
        return Pose(
            min(max(self.pan + pan, -MOST_PAN), MOST_PAN),
            min(max(self.tilt + tilt, -MOST_TILT), MOST_TILT),
            min(max(self.depth + depth, SHALLOWEST), DEEPEST),
            math.remainder(self.cable + cable, whole),
            math.remainder(self.head + head, whole),
        )

    def towards(self, other: "Pose", *, turn: float, slide: float) -> "Pose":
        """Return a pose on a straight path to another, at most so much of each turn and mm on.

        Returns
        -------
        Pose
            `other` itself where that is as near.
        """
        whole = 2.0 * math.pi
        far = (
            other.pan - self.pan,
            other.tilt - self.tilt,
            other.depth - self.depth,
            math.remainder(other.cable - self.cable, whole),
            math.remainder(other.head - self.head, whole),
        )
        steps = max(abs(far[2]) / slide, *(abs(far[each]) / turn for each in (0, 1, 3, 4)))
        return other if steps <= 1.0 + 1e-9 else self.moved(*(each / steps for each in far))

    @property
    def numbers(self) -> tuple[float, float, float, float, float]:
        """Pan, tilt, depth, cable and head."""
        return self.pan, self.tilt, self.depth, self.cable, self.head


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Where a scope's camera is, and how it is turned."""

    tip: Floats  # (3,) mm
    axes: Floats  # (3, 3) columns: right, up and back of the picture
    shaft: Floats  # (3,) from the trocar to the tip

    def seen(self, place: Floats) -> tuple[float, float]:
        """Return a place's distance from the middle, 1 at the picture's edge, and its depth, mm."""
        right, up, back = self.axes.T @ (place - self.tip)
        if back >= 0.0:
            return math.inf, -float(back)
        wide = math.tan(0.5 * FIELD_OF_VIEW)
        return math.hypot(right, up) / (-float(back) * wide), -float(back)


@dataclass(frozen=True, slots=True, eq=False)
class Laparoscope:
    """A scope in a trocar.

    Parameters
    ----------
    pivot
        (3,) where the trocar holds the shaft, mm.
    base
        (3, 3) columns: right, up and along the shaft, of the pose without pan and tilt.
    angle
        Between shaft and optical axis, rad: 0, or `OBLIQUE`.
    """

    pivot: Floats
    base: Floats
    angle: float = 0.0

    @classmethod
    def towards(
        cls, target: Floats, direction: Floats, up: Floats, *, outside: float
    ) -> "Laparoscope":
        """Return a scope `outside` mm before a target along a way; `up` is up in its picture."""
        s = direction / math.sqrt(float((direction * direction).sum()))
        v = up - float((up * s).sum()) * s
        v = v / math.sqrt(float((v * v).sum()))
        return cls(target - outside * s, np.stack([cross(s, v), v, s], axis=1))

    def camera(self, pose: Pose) -> Camera:
        """Return the camera of a pose; its arrays are shared."""
        return _camera(self, pose)

    def look(self, target: Floats, distance: float, pose: Pose) -> Pose:
        """Return the pose that has a target in the middle, at a distance, mm, and level."""
        # The cable stays as it is in `pose`, from which Newton's method finds the new one. A target
        # out of reach is met as far as the trocar lets the scope.
        for _ in range(12):
            missed = self._missed(target, distance, pose)
            steps = (1e-5, 1e-5, 1e-3)
            nudged = (
                replace(pose, pan=pose.pan + steps[0]),
                replace(pose, tilt=pose.tilt + steps[1]),
                replace(pose, depth=pose.depth + steps[2]),
            )
            slopes = [
                (self._missed(target, distance, each) - missed) / step
                for each, step in zip(nudged, steps, strict=True)
            ]
            pan, tilt, depth = -_solved(slopes, missed)
            roll = self.roll(pose)
            pose = pose.moved(float(pan), float(tilt), float(depth), head=roll)
            if abs(pan) + abs(tilt) + abs(roll) < 1e-13 and abs(depth) < 1e-11:
                break
        return pose

    def roll(self, pose: Pose) -> float:
        """Return how far the picture's horizon is turned, rad."""
        axes, level = self.camera(pose).axes, self.base[:, 1]
        return math.atan2(float((axes[:, 0] * level).sum()), float((axes[:, 1] * level).sum()))

    def _missed(self, target: Floats, distance: float, pose: Pose) -> Floats:
        camera = self.camera(pose)
        return camera.tip - distance * camera.axes[:, 2] - target


@lru_cache(maxsize=256)  # asked for several times a tick, by each page
def _camera(scope: Laparoscope, pose: Pose) -> Camera:
    turned: Floats = scope.base @ _turn((0, 1, 0), pose.pan) @ _turn((1, 0, 0), -pose.tilt)
    u, v, s = turned[:, 0], turned[:, 1], turned[:, 2]
    sight = math.cos(pose.cable) * v + math.sin(pose.cable) * u
    up = math.cos(pose.head) * v + math.sin(pose.head) * u
    # The prism's is the least turn from the shaft to the optical axis.
    prism = _turn(_unit(cross(s, sight)), scope.angle)
    axes = prism @ np.stack([cross(s, up), up, -s], axis=1)
    return Camera(scope.pivot + pose.depth * s, axes, s)


def cross(a: Floats, b: Floats) -> Floats:
    """Return the cross product of two vectors; numpy's takes 15 us, this one 0.6."""
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def _solved(columns: list[Floats], right: Floats) -> Floats:
    """Return what solves three equations, by Cramer's rule: no library's own order of sums."""
    a, b, c = columns
    whole = float((cross(b, c) * a).sum())
    return (
        np.array(
            [
                float((cross(b, c) * right).sum()),
                float((cross(c, a) * right).sum()),
                float((cross(a, b) * right).sum()),
            ]
        )
        / whole
    )


def _unit(vector: Floats) -> Floats:
    return vector / math.sqrt(float((vector * vector).sum()))


def _turn(axis: tuple[float, float, float] | Floats, angle: float) -> Floats:
    """Return the matrix of a turn about a unit axis (Rodrigues)."""
    x, y, z = (float(each) for each in axis)
    c, s = math.cos(angle), math.sin(angle)
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + s * k + (1.0 - c) * (k @ k)
