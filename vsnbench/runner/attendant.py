"""Whoever stands beside the robot: asked to place it, told of progress, asked to judge, free to stop it at any time.

The terminal is one, nobody another. Whoever it is stops the robot with a request (`vsnbench.runner.stopping`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from vsnbench.errors import RobotError
from vsnbench.protocol.judge import Verdict
from vsnbench.protocol.site import StartingPosition
from vsnbench.runner.episode import EpisodeOutcome, EpisodePlan, Step
from vsnbench.runner.placing import Placing


class TrialSkippedError(Exception):
    """Whoever was asked wants this trial later; nothing of it is kept."""


class SessionOverError(Exception):
    """Whoever was asked ends the session; nothing of the trial is kept that was about to begin."""


@dataclass(frozen=True, slots=True)
class Upcoming:
    """A claimed trial that is about to be run."""

    number: int
    """The episode's."""
    trial: int
    """The trial's number in the record."""
    driven_by: str
    """The model's name for people: its code while they are blind."""
    plan: EpisodePlan


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
    author: str = ""
    """Who judged; the session's operator when empty."""


class Attendant(Protocol):
    """Whoever stands beside the robot."""

    @property
    def beside(self) -> str:
        """Who it is: the name of whoever said go last; empty for nobody."""
        ...

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Be told that a trial is about to be run, and return when it may be.

        Raises:
            TrialSkippedError: this one is wanted later.
            SessionOverError: none is wanted any more.
            Stopped: whoever was asked ends the session at once.
        """
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
            TrialSkippedError: this trial is wanted later.
            SessionOverError: none is wanted any more.
            Stopped: whoever was asked ends the session at once.
        """
        ...

    def again(self) -> Sequence[int]:
        """Return the trials that are to be run again before any other, once each; never waits."""
        ...

    def nothing_left(self) -> Sequence[int]:
        """Return, when no trial is left, what is to be run again after all; empty ends the session.

        Raises:
            Stopped: whoever was asked ends the session at once.
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


class Unattended:
    """Nobody is there, and nothing is shown: the robot is taken to stand where it should, no verdict is confirmed."""

    @property
    def beside(self) -> str:
        """Nobody."""
        return ""

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Say nothing."""

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Say nothing."""

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Say nothing."""

    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        """Accept at once.

        Raises:
            RobotError: something is wrong that only a person could put right.
        """
        del placing
        if problem:
            raise RobotError(f"starting position {start.number}: {problem}, and the run is unattended")

    def again(self) -> Sequence[int]:
        """Want nothing again."""
        return ()

    def nothing_left(self) -> Sequence[int]:
        """Want nothing more."""
        return ()

    def judge(self, ended: EndedEpisode) -> Judgement | None:
        """Say nothing."""
        del ended
        return None


class Nobody(Unattended):
    """Nobody is there, but progress is shown to whoever comes by."""

    def __init__(self, display: Display) -> None:
        self._display = display

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Show it."""
        self._display.trial_begins(upcoming.plan.goal, upcoming.plan.start.number)

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Show it."""
        self._display.step(plan.goal, plan.start.number, step)

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Show it."""
        self._display.episode_ended(ended)
