"""A policy beside a trainee: it leads the second hand, or does the same exercise as a ghost.

It acts in exercises that free a duct from its bed, from the trainee's first input on, and in steps
of as many ticks as it was trained with. A tick waits for it `PATIENCE_S` at most; once that was too
short, no longer at all: its hand rests until the action is there.
"""

import time
from dataclasses import replace

from app.rl.episode import Episode
from app.rl.policy import Answer, Policy
from app.simulation import Session

PATIENCE_S = 0.002
LATE_S = 1.0
"""Most time for an action; then the policy is left."""


class Companion:
    """A policy beside a session's exercise.

    Parameters
    ----------
    policy
        What decides.
    session
        With an exercise that waits or goes on.
    ghost
        Whether it works on a duct of its own with all of its hands; else it leads the last hand.

    Attributes
    ----------
    session
        What it works on: the trainee's, or the ghost's.
    hands
        Numbers of the hands that it leads there.
    fault
        Why it has stopped, or nothing.

    Raises
    ------
    ValueError
        If there is no such exercise, or the policy sees or does something else than there is.
    """

    def __init__(self, policy: Policy, session: Session, *, ghost: bool) -> None:
        self._policy, self._trainees, self.is_ghost = policy, session, ghost
        exercise = session.run.exercise
        if exercise is None or session.run.over:
            raise ValueError("a policy acts in an exercise: start one")
        if session.specimen.theory is not None:
            raise ValueError("a policy needs a duct in space, not one in the plane of its pull")
        task = replace(
            policy.task,
            exercise=exercise,
            specimen=session.specimen,
            seeds=(session.specimen.bed_seed,),
            time_limit=None,
        )
        if not ghost and task.hands < 2:
            raise ValueError("a policy of one hand leads no second one; it can be a ghost")
        self.episode = Episode(task) if ghost else Episode(task, session)
        policy.check(self.episode)
        self.session = self.episode.session
        self.hands = tuple(range(task.hands))[0 if ghost else -1 :]
        self.fault = ""
        self._answer: Answer | None = None
        self._asked_at = 0.0
        self._patience = PATIENCE_S
        self._left = 0  # ticks of the step
        self._seen = self.episode.room()

    @property
    def acts(self) -> bool:
        """Whether it is at work."""
        episode = self.episode
        over = self._trainees.run.over or episode.terminated or episode.truncated
        return not over and not self.fault

    def tick(self) -> None:
        """Lead its hands for a tick, before the session advances; a ghost advances with it."""
        if not self._trainees.run.going or not self.acts:
            return
        episode = self.episode
        if not self._left and not self._decide():
            return
        episode.lead()
        self._left -= 1
        if self.is_ghost and (episode.advance() or not self._left):
            self._left = 0
            episode.judge()

    def _decide(self) -> bool:
        """Return whether there is an action; ask for one."""
        episode = self.episode
        if self._answer is None:
            if not self.is_ghost:
                episode.judge()
            episode.observe(self._seen)
            self._answer = self._policy.ask(self._seen)
            self._asked_at = time.monotonic()
        try:
            action = self._answer.action(self._patience)
            if action is None:
                self._patience = 0.0
                if time.monotonic() - self._asked_at > LATE_S:
                    self.stop()
                    self.fault = f"the policy took longer than {LATE_S:g} s for an action"
                return False
        except ValueError as error:
            self.fault = str(error)
            return False
        self._answer = None
        self._left = episode.task.ticks_per_step
        if not self.is_ghost:
            self._take_instrument()
        episode.decide(action, self.hands)
        return True

    def _take_instrument(self) -> None:
        """Have the instrument that the policy was trained with in its hand."""
        task, (hand,) = self.episode.task, self.hands
        wanted = task.first_instruments[hand]
        if not task.free_choice and self._trainees.tissue.hands[hand].instrument != wanted:
            self._trainees.choose_instrument(hand, wanted)

    def stop(self) -> None:
        """Leave what it is at work on."""
        if self._answer is not None:
            self._answer.give_up()
