"""The grasper's pull in time: by a force that is asked for, by a hand, or let go."""

import math
from typing import Literal

from app.simulation.clock import TICK_SECONDS
from app.simulation.grasped_duct import Load

__all__ = ["HAND_SPEED", "PullControl"]

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
"""A hand this near its goal and this slow has arrived."""

_DECAY = math.exp(-HAND_RATE * TICK_SECONDS)
_SWING = SPRING_RATE * math.sqrt(1.0 - SPRING_DAMPING**2)
_FADE = math.exp(-SPRING_DAMPING * SPRING_RATE * TICK_SECONDS)
_COSINE, _SINE = math.cos(_SWING * TICK_SECONDS), math.sin(_SWING * TICK_SECONDS)


class PullControl:
    """What the grasper imposes from tick to tick.

    By force: the force moves evenly to the one that is wanted. By hand: the grasp's displacement
    follows the hand's as a critically damped mass on a spring would, solved in closed form, never
    faster than `HAND_SPEED`. Let go: the duct swings back, damped. Going from one to another keeps
    the duct where it is.

    Attributes
    ----------
    mode
        "force", "hand" or "free".
    force, deflection
        The duct's at the last equilibrium, N and mm.
    force_wanted, deflection_wanted
        What they go to.
    speed
        Of the grasp, mm/s, by hand or free.
    """

    __slots__ = (
        "_still",
        "deflection",
        "deflection_wanted",
        "force",
        "force_wanted",
        "mode",
        "speed",
    )

    def __init__(self) -> None:
        self.mode: Literal["force", "hand", "free"] = "force"
        self.force = self.force_wanted = 0.0
        self.deflection = self.deflection_wanted = 0.0
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
        """The grasper's whole force, N; 0 while nobody holds the duct."""
        return 0.0 if self.mode == "free" else self.force

    @property
    def holds(self) -> bool:
        """Whether the grasper holds the duct."""
        return self.mode == "hand" or (self.mode == "force" and self.force > 0.0)

    @property
    def at_rest(self) -> bool:
        """Whether nothing will change without a new wish."""
        if self.mode == "force":
            return self.force == self.force_wanted
        if self.mode == "hand":
            return self.deflection == self.deflection_wanted and self.speed == 0.0
        return False

    def pull_with(self, force: float) -> bool:
        """Go to a force."""
        if self.mode == "free" and force == 0.0:
            return False
        if self.mode == "force" and force == self.force_wanted:
            return False
        # A duct caught as it swings past rest is not pushed.
        self.force = max(self.force, 0.0)
        self.mode, self.force_wanted, self.speed = "force", force, 0.0
        return True

    def grab(self, deflection: float) -> None:
        """Take the duct by hand, where it is."""
        self.mode, self.speed = "hand", 0.0
        self.force = max(self.force, 0.0)
        self.deflection = self.deflection_wanted = deflection

    def regrasp(self, deflection: float) -> None:
        """Hold another place: the force stays, a displacement is the duct's at that place."""
        if self.mode == "hand":
            self.grab(max(0.0, deflection))
        elif self.mode == "free":
            self.deflection, self.speed = deflection, 0.0

    def lead_to(self, deflection: float) -> bool:
        """Lead the grasp to a deflection."""
        if self.mode != "hand" or deflection == self.deflection_wanted:
            return False
        self.deflection_wanted = deflection
        return True

    def let_go(self) -> bool:
        """Let the duct spring back."""
        if not self.holds and self.force_wanted == 0.0:
            return False
        self.mode, self.force_wanted = "free", 0.0
        self.deflection_wanted = self.speed = 0.0
        self._still = max(STILL_PART * abs(self.deflection), ARRIVED_MM)
        return True

    def advance(self, force_per_second: float) -> Load:
        """Advance by one tick."""
        if self.mode == "force":
            most = force_per_second * TICK_SECONDS
            self.force += min(max(self.force_wanted - self.force, -most), most)
        elif self.mode == "hand":
            self._follow_hand()
        else:
            self._spring_back()
        return self.load

    def felt(self, force: float, deflection: float) -> None:
        """Take what the beam answers with."""
        if self.mode == "force":
            self.deflection = deflection
        else:
            self.force = force

    def stop_at(self, force: float, deflection: float) -> None:
        """Stay where the duct was last in equilibrium, and wish for nothing more."""
        self.force, self.deflection, self.speed = force, deflection, 0.0
        if self.mode == "free":
            self.mode, self.force, self.force_wanted = "force", 0.0, 0.0
        elif self.mode == "hand":
            self.deflection_wanted = deflection
        else:
            self.force_wanted = force

    def ease(self) -> Load:
        """Give way to a load that no theory carries."""
        self.stop_at(0.9 * self.force, 0.9 * self.deflection)
        return self.load

    def _follow_hand(self) -> None:
        before, goal = self.deflection, self.deflection_wanted
        away = before - goal
        push = self.speed + HAND_RATE * away
        after = goal + (away + push * TICK_SECONDS) * _DECAY
        speed = (self.speed - HAND_RATE * push * TICK_SECONDS) * _DECAY
        most = HAND_SPEED * TICK_SECONDS
        if abs(after - before) > most:
            speed = math.copysign(HAND_SPEED, after - before)
            after = before + math.copysign(most, after - before)
        if after < 0.0:
            after = speed = 0.0
        if abs(after - goal) <= ARRIVED_MM and abs(speed) <= ARRIVED_MM_PER_S:
            after, speed = goal, 0.0
        self.deflection, self.speed = after, speed

    def _spring_back(self) -> None:
        away, speed = self.deflection, self.speed
        turn = (speed + SPRING_DAMPING * SPRING_RATE * away) / _SWING
        pull = -(SPRING_RATE**2 * away + SPRING_DAMPING * SPRING_RATE * speed) / _SWING
        self.deflection = _FADE * (away * _COSINE + turn * _SINE)
        self.speed = _FADE * (speed * _COSINE + pull * _SINE)
        swing = math.hypot(self.deflection, self.speed / SPRING_RATE)
        if swing <= self._still:
            self.mode, self.force, self.force_wanted = "force", 0.0, 0.0
            self.deflection = self.deflection_wanted = self.speed = 0.0
