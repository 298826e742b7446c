"""The grasper in time: it goes to a force, follows a hand, or has released the duct.

By force: the force moves at a constant rate to its target. By hand: the deflection x of the grasp
follows the hand's target as a critically damped mass on a spring,
    x'' = -2 r x' - r^2 (x - target),   r = HAND_RATE,
never faster than `HAND_SPEED`. Released: the duct swings back to rest,
    x'' = -2 d s x' - s^2 x,   s = SPRING_RATE, d = SPRING_DAMPING.
Both are advanced by their closed-form solution over a tick, so the motion is stable and the same to
the bit on a slow and a fast machine. A change of mode starts from the present force and deflection.
"""

import math
from dataclasses import dataclass
from typing import Literal

from app.simulation.inputs.clock import TICK_SECONDS

HAND_SPEED = 60.0
"""mm/s; faster than a dissecting hand moves, slow enough for each frame to be seen."""
HAND_RATE = 30.0
"""rad/s. A browser sends a drag some 20 times a second; at this rate the steps are smoothed out."""
SPRING_RATE = 30.0
# Of the spring-back: undamped angular frequency, rad/s, and fraction of critical damping.
SPRING_DAMPING = 0.5
# A spring-back ends when its amplitude falls below this part of its start: no longer visible.
STILL_FRACTION = 1e-3
ARRIVED_MM, ARRIVED_MM_PER_S = 1e-4, 1e-2
"""A hand nearer to its target and slower than this has arrived; then nothing is solved any more."""

DECAY = math.exp(-HAND_RATE * TICK_SECONDS)
"""e^(-r t) of a tick t, by which a hand comes to where it is led, r = HAND_RATE."""
_SWING = SPRING_RATE * math.sqrt(1.0 - SPRING_DAMPING**2)
_FADE = math.exp(-SPRING_DAMPING * SPRING_RATE * TICK_SECONDS)
_COSINE, _SINE = math.cos(_SWING * TICK_SECONDS), math.sin(_SWING * TICK_SECONDS)


@dataclass(frozen=True, slots=True)
class Load:
    """What a grasper imposes on a duct: a force, N, or a deflection of the grasp, mm."""

    kind: Literal["force", "deflection"]
    amount: float


class Grasper:
    """Pulls a duct from tick to tick; forces in N, deflections in mm.

    `mode` is "force", "hand" or "free" (released). `force` and `deflection` are the duct's at the
    last equilibrium, `target_force` and `target_deflection` what they move to by force or by hand.
    `speed` is that of the grasp, mm/s, by hand or free.
    """

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
        """The load imposed now."""
        if self.mode == "force":
            return Load("force", self.force)
        return Load("deflection", self.deflection)

    @property
    def grip_force(self) -> float:
        """The grasper's whole force, N; 0 once it has released the duct."""
        return 0.0 if self.mode == "free" else self.force

    @property
    def slider_force(self) -> float:
        """The force that a slider shows, N: the target; by hand the beam's reaction."""
        return self.force if self.mode == "hand" else self.target_force

    @property
    def holds(self) -> bool:
        """Whether the grasper holds the duct."""
        return self.mode == "hand" or (self.mode == "force" and self.force > 0.0)

    @property
    def at_rest(self) -> bool:
        """Whether nothing changes without a new target."""
        if self.mode == "force":
            return self.force == self.target_force
        if self.mode == "hand":
            return self.deflection == self.target_deflection and self.speed == 0.0
        return False

    def set_target_force(self, force: float) -> bool:
        """Go to a force, N; return whether that changes anything."""
        if self.mode == "free" and force == 0.0:
            return False
        if self.mode == "force" and force == self.target_force:
            return False
        # A duct caught as it swings past rest has a negative force; the grasper only pulls.
        self.force = max(self.force, 0.0)
        self.mode, self.target_force, self.speed = "force", force, 0.0
        return True

    def grab(self, deflection: float) -> None:
        """Take the duct by hand at its present deflection, mm."""
        self.mode, self.speed = "hand", 0.0
        self.force = max(self.force, 0.0)
        self.deflection = self.target_deflection = deflection

    def regrasp(self, deflection: float) -> None:
        """Hold another place, deflected by `deflection`, mm; a prescribed force stays as it is."""
        if self.mode == "hand":
            self.grab(max(0.0, deflection))
        elif self.mode == "free":
            self.deflection, self.speed = deflection, 0.0

    def move_hand(self, deflection: float) -> bool:
        """Set the hand's target deflection, mm; return whether that changes anything."""
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
        self._still = max(STILL_FRACTION * abs(self.deflection), ARRIVED_MM)
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
        """Take over the response: the deflection under a force, or the other way round."""
        if self.mode == "force":
            self.deflection = deflection
        else:
            self.force = force

    def stop_at(self, force: float, deflection: float) -> None:
        """Stay at an equilibrium and drop any target beyond it."""
        self.force, self.deflection, self.speed = force, deflection, 0.0
        if self.mode == "free":
            self.mode, self.force, self.target_force = "force", 0.0, 0.0
        elif self.mode == "hand":
            self.target_deflection = deflection
        else:
            self.target_force = force

    def ease(self) -> Load:
        """Reduce the load by a tenth, where a theory has no equilibrium under it."""
        self.stop_at(0.9 * self.force, 0.9 * self.deflection)
        return self.load

    def _follow_hand(self) -> None:
        before, target = self.deflection, self.target_deflection
        away = before - target
        push = self.speed + HAND_RATE * away
        after = target + (away + push * TICK_SECONDS) * DECAY
        speed = (self.speed - HAND_RATE * push * TICK_SECONDS) * DECAY
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
