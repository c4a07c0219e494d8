"""Whoever stands beside the robot: asked to place it, told of progress, asked to judge, free to stop it at any time.

The terminal is one, nobody another. Whoever it is stops the robot with a request (`vsnbench.runner.stopping`).
"""

from dataclasses import dataclass
from typing import Protocol

from vsnbench.errors import RobotError
from vsnbench.protocol.judge import Verdict
from vsnbench.protocol.site import StartingPosition
from vsnbench.runner.episode import EpisodeOutcome, EpisodePlan, Step
from vsnbench.runner.placing import Placing


@dataclass(frozen=True, slots=True)
class EndedEpisode:
    """An episode that has just ended."""

    number: int
    plan: EpisodePlan
    outcome: EpisodeOutcome


@dataclass(frozen=True, slots=True)
class Judgement:
    """What a person says of an episode that awaits judgement."""

    verdict: Verdict
    note: str = ""
    """Why, in the person's own words."""
    called_collision: bool = False
    """The robot had not felt it: the person saw it."""


class Attendant(Protocol):
    """Whoever stands beside the robot."""

    def trial_begins(self, plan: EpisodePlan) -> None:
        """Be told that a trial is about to be run."""
        ...

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Be told of an action."""
        ...

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Be told how an episode ended; one that awaits judgement is asked about afterwards."""
        ...

    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        """Put the robot at `start`, and return when it stands there.

        Args:
            start: where it should stand, and facing where.
            problem: what was wrong with the last attempt; empty at first.
            placing: measures how it stands there.

        Raises:
            RobotError: there is nobody who could put the problem right.
            Stopped: whoever was asked ends the session instead.
        """
        ...

    def judge(self, ended: EndedEpisode) -> Judgement | None:
        """Judge an episode whose verdict is only a proposal; None leaves it awaiting judgement.

        Raises:
            Stopped: whoever was asked ends the session instead; the episode awaits judgement.
        """
        ...


class Display(Protocol):
    """Where progress is shown, whoever is there to see it."""

    def trial_begins(self, goal: str, start: int) -> None:
        """A trial is about to be run."""
        ...

    def step(self, goal: str, start: int, step: Step) -> None:
        """An action was taken."""
        ...

    def episode_ended(self, ended: EndedEpisode) -> None:
        """An episode has ended."""
        ...

    def judged(self, success: bool | None) -> None:
        """A person has judged the episode that ended last."""
        ...


class Overview(Protocol):
    """Where the progress of many workers is shown as one."""

    def say(self, words: str) -> None:
        """Write a line that stays."""
        ...

    def pace(self, words: str) -> None:
        """Show how fast it goes now."""
        ...

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Show how an episode ended."""
        ...


class Nobody:
    """Nobody is there: the robot is taken to stand where it should, and what needs a person's word awaits it."""

    def __init__(self, display: Display) -> None:
        self._display = display

    def trial_begins(self, plan: EpisodePlan) -> None:
        """Show it."""
        self._display.trial_begins(plan.goal, plan.start.number)

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Show it."""
        self._display.step(plan.goal, plan.start.number, step)

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Show it."""
        self._display.episode_ended(ended)

    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        """Accept at once.

        Raises:
            RobotError: something is wrong that only a person could put right.
        """
        del placing
        if problem:
            raise RobotError(f"starting position {start.number}: {problem}, and the run is unattended")

    def judge(self, ended: EndedEpisode) -> Judgement | None:
        """Say nothing."""
        del ended
        return None
