"""The grasper in time: it goes to a force, follows a hand, or has released the duct.

By force: the force moves evenly to its target. By hand: the deflection x of the grasp follows the
hand's target as a critically damped mass on a spring would,
    x'' = -2 r x' - r^2 (x - target),   r = HAND_RATE,
solved in closed form over a tick, never faster than `HAND_SPEED`. Released: the duct swings back,
    x'' = -2 d s x' - s^2 x,   s = SPRING_RATE, d = SPRING_DAMPING,
in closed form too. So what happens is the same to the bit whatever machine draws it. Going from one
mode to another keeps the duct where it is.
"""

import math
from dataclasses import dataclass
from typing import Literal

from app.simulation.clock import TICK_SECONDS

__all__ = ["HAND_SPEED", "Grasper", "Load"]

HAND_SPEED = 60.0
"""mm/s; faster than a dissecting hand moves, slow enough for every step to be seen."""
HAND_RATE = 30.0
"""rad/s of the critically damped follower: a drag sent 20 times a second moves evenly."""
SPRING_RATE = 30.0
SPRING_DAMPING = 0.5
"""rad/s without damping, and part of the critical damping, with which a duct springs back."""
STILL_PART = 1e-3
"""Part of a spring-back that nobody sees any more."""
ARRIVED_MM, ARRIVED_MM_PER_S = 1e-4, 1e-2
"""A hand this near its target and this slow has arrived."""

_DECAY = math.exp(-HAND_RATE * TICK_SECONDS)
_SWING = SPRING_RATE * math.sqrt(1.0 - SPRING_DAMPING**2)
_FADE = math.exp(-SPRING_DAMPING * SPRING_RATE * TICK_SECONDS)
_COSINE, _SINE = math.cos(_SWING * TICK_SECONDS), math.sin(_SWING * TICK_SECONDS)


@dataclass(frozen=True, slots=True)
class Load:
    """What a grasper imposes on a duct: a force, N, or a deflection of the grasp, mm."""

    kind: Literal["force", "deflection"]
    amount: float


class Grasper:
    """What pulls a duct from tick to tick.

    Attributes
    ----------
    mode
        "force", "hand" or "free": released.
    force, deflection
        The duct's at the last equilibrium, N and mm.
    target_force, target_deflection
        What they go to by force and by hand, N and mm.
    speed
        Of the grasp, mm/s, by hand or free.
    """

    __slots__ = (
        "_still",
        "deflection",
        "force",
        "mode",
        "speed",
        "target_deflection",
        "target_force",
    )

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Hold nothing, at rest."""
        self.mode: Literal["force", "hand", "free"] = "force"
        self.force = self.target_force = 0.0
        self.deflection = self.target_deflection = 0.0
        self.speed = 0.0
        self._still = ARRIVED_MM

    @property
    def load(self) -> Load:
        """What is imposed now."""
        if self.mode == "force":
            return Load("force", self.force)
        return Load("deflection", self.deflection)

    @property
    def grip_force(self) -> float:
        """The grasper's whole force, N; 0 once it has released the duct."""
        return 0.0 if self.mode == "free" else self.force

    @property
    def slider_force(self) -> float:
        """What a slider shows: the target, N; by hand the force that the duct answers with."""
        return self.force if self.mode == "hand" else self.target_force

    @property
    def holds(self) -> bool:
        """Whether the grasper holds the duct."""
        return self.mode == "hand" or (self.mode == "force" and self.force > 0.0)

    @property
    def at_rest(self) -> bool:
        """Whether nothing will change without a new target."""
        if self.mode == "force":
            return self.force == self.target_force
        if self.mode == "hand":
            return self.deflection == self.target_deflection and self.speed == 0.0
        return False

    def set_target_force(self, force: float) -> bool:
        """Go to a force; return whether that changes anything."""
        if self.mode == "free" and force == 0.0:
            return False
        if self.mode == "force" and force == self.target_force:
            return False
        # A duct caught as it swings past rest is not pushed.
        self.force = max(self.force, 0.0)
        self.mode, self.target_force, self.speed = "force", force, 0.0
        return True

    def grab(self, deflection: float) -> None:
        """Take the duct by hand, where it is."""
        self.mode, self.speed = "hand", 0.0
        self.force = max(self.force, 0.0)
        self.deflection = self.target_deflection = deflection

    def regrasp(self, deflection: float) -> None:
        """Hold another place: the force stays, a displacement is the duct's at that place."""
        if self.mode == "hand":
            self.grab(max(0.0, deflection))
        elif self.mode == "free":
            self.deflection, self.speed = deflection, 0.0

    def move_hand(self, deflection: float) -> bool:
        """Follow the hand to a deflection; return whether that changes anything."""
        if self.mode != "hand" or deflection == self.target_deflection:
            return False
        self.target_deflection = deflection
        return True

    def release(self) -> bool:
        """Let the duct spring back; return whether that changes anything."""
        if not self.holds and self.target_force == 0.0:
            return False
        self.mode, self.target_force = "free", 0.0
        self.target_deflection = self.speed = 0.0
        self._still = max(STILL_PART * abs(self.deflection), ARRIVED_MM)
        return True

    def advance(self, force_per_second: float) -> Load:
        """Advance by one tick and return the load that is to be imposed then."""
        if self.mode == "force":
            most = force_per_second * TICK_SECONDS
            self.force += min(max(self.target_force - self.force, -most), most)
        elif self.mode == "hand":
            self._follow_hand()
        else:
            self._spring_back()
        return self.load

    def update_response(self, force: float, deflection: float) -> None:
        """Take what the beam answers with: the deflection to a force, the force to a deflection."""
        if self.mode == "force":
            self.deflection = deflection
        else:
            self.force = force

    def stop_at(self, force: float, deflection: float) -> None:
        """Stay at an equilibrium, with no target beyond it."""
        self.force, self.deflection, self.speed = force, deflection, 0.0
        if self.mode == "free":
            self.mode, self.force, self.target_force = "force", 0.0, 0.0
        elif self.mode == "hand":
            self.target_deflection = deflection
        else:
            self.target_force = force

    def ease(self) -> Load:
        """Give way by a tenth to a load under which a theory has no equilibrium."""
        self.stop_at(0.9 * self.force, 0.9 * self.deflection)
        return self.load

    def _follow_hand(self) -> None:
        before, target = self.deflection, self.target_deflection
        away = before - target
        push = self.speed + HAND_RATE * away
        after = target + (away + push * TICK_SECONDS) * _DECAY
        speed = (self.speed - HAND_RATE * push * TICK_SECONDS) * _DECAY
        most = HAND_SPEED * TICK_SECONDS
        if abs(after - before) > most:
            speed = math.copysign(HAND_SPEED, after - before)
            after = before + math.copysign(most, after - before)
        if after < 0.0:
            after = speed = 0.0
        if abs(after - target) <= ARRIVED_MM and abs(speed) <= ARRIVED_MM_PER_S:
            after, speed = target, 0.0
        self.deflection, self.speed = after, speed

    def _spring_back(self) -> None:
        away, speed = self.deflection, self.speed
        turn = (speed + SPRING_DAMPING * SPRING_RATE * away) / _SWING
        pull = -(SPRING_RATE**2 * away + SPRING_DAMPING * SPRING_RATE * speed) / _SWING
        self.deflection = _FADE * (away * _COSINE + turn * _SINE)
        self.speed = _FADE * (speed * _COSINE + pull * _SINE)
        swing = math.hypot(self.deflection, self.speed / SPRING_RATE)
        if swing <= self._still:
            self.mode, self.force, self.target_force = "force", 0.0, 0.0
            self.deflection = self.target_deflection = self.speed = 0.0
