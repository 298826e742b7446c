"""A scope and who holds it: the assistant, or the trainee."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from app.anatomy import AnatomyNetwork
from app.simulation import TICK_SECONDS
from app.trainer.scope.assistant import Assistant
from app.trainer.scope.pose import OBLIQUE, Camera, Laparoscope, Pose
from app.trainer.scope.surroundings import working_place

Floats = NDArray[np.float64]

# From the navel to the triangle, and what is up in the picture: towards the head.
DIRECTION, UP = np.array([0.76, 0.06, -0.66]), np.array([1.0, 0.0, 0.0])
OUTSIDE = 215.0
"""From the scope's trocar to the triangle, mm."""
HOME = 66.0
"""At which it is seen first, mm."""
RETURNS_RAD_S, RETURNS_MM_S = 1.0, 60.0
"""Of each turn and along the shaft, at most, of a scope that is given back to the assistant."""
SCOPED = slice(6, 12)
"""Of a view's numbers, as an `Input` has it: those of the scope."""


class HeldScope:
    """The scope at an anatomy; `assisted` while the assistant holds it."""

    def __init__(self, made: AnatomyNetwork) -> None:
        self.made = made
        self._target = working_place(made)
        self.scope = Laparoscope.towards(self._target, DIRECTION, UP, outside=OUTSIDE)
        self.home()

    def home(self) -> None:
        """Give the scope to the assistant, who looks at the triangle."""
        # Turned down, an oblique scope looks at the triangle from the patient's head.
        pose = Pose(depth=OUTSIDE - HOME, cable=math.pi if self.scope.angle else 0.0)
        self.assisted, self._returns = True, False
        self._assistant = Assistant(self.scope, pose, self._target, HOME)
        self.pose = self._assistant.pose

    def give_back(self) -> None:
        """Give the scope to the assistant, who leads it back to the triangle without a jump."""
        held = self.pose
        self.home()
        self.pose, self._returns = held, True

    @property
    def oblique(self) -> bool:
        """Whether it looks 30 degrees aside."""
        return self.scope.angle > 0.0

    def change(self) -> None:
        """Take the other scope: straight or oblique."""
        angle = 0.0 if self.oblique else OBLIQUE
        self.scope = Laparoscope(self.scope.pivot, self.scope.base, angle)
        self.home()

    def move(self, *by: float, **named: float) -> None:
        """Move the scope oneself, as `Pose.moved`; the assistant has let go of it from then on."""
        self.assisted = False
        self.pose = self.pose.moved(*by, **named)

    def advance(self, tips: Sequence[Floats]) -> bool:
        """Let the assistant follow tips for a tick; return whether the scope has moved."""
        if not self.assisted:
            return False
        pose = self._assistant.follow(tips, TICK_SECONDS)
        if self._returns:
            turn, slide = RETURNS_RAD_S * TICK_SECONDS, RETURNS_MM_S * TICK_SECONDS
            nearer = self.pose.towards(pose, turn=turn, slide=slide)
            self._returns, pose = nearer is not pose, nearer
        return self._hold(self._assistant.scope, pose)

    def show(self, logged: Sequence[float]) -> bool:
        """Hold the scope as a tissue's `pose` says; return False where none is held so."""
        if not self.assisted or len(logged) < SCOPED.stop:
            return False
        *held, angle = logged[SCOPED]
        scope = self.scope
        if angle != scope.angle:
            scope = Laparoscope(scope.pivot, scope.base, angle)
        self._hold(scope, Pose(*held))
        return True

    def _hold(self, scope: Laparoscope, pose: Pose) -> bool:
        """Hold a scope so; return whether anything has changed."""
        before = self.pose, self.scope.angle
        self.scope, self.pose = scope, pose
        return before != (pose, scope.angle)

    @property
    def camera(self) -> Camera:
        """Its camera as it is held."""
        return self.scope.camera(self.pose)

    @property
    def view(self) -> list[float]:
        """Direction back along its picture, its tip, how it is held and its horizon: an `Input`."""
        camera = self.camera
        held = *self.pose.numbers, self.scope.angle, self.scope.roll(self.pose)
        return [*camera.axes[:, 2].tolist(), *camera.tip.tolist(), *held]
