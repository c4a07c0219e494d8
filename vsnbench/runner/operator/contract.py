"""The operator as the trial loop sees it: places the robot, follows the progress, judges and ends sessions.

A request to stop goes another way, through `vsnbench.runner.stopping.requests`.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from vsnbench.errors import RobotError
from vsnbench.protocol.judge import Verdict
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runner.operator.placing import Placing
from vsnbench.sites.site import StartingPosition


class TrialSkippedError(Exception):
    """The operator postpones this trial; nothing of it is recorded."""


class SessionEndedError(Exception):
    """No further trial may begin; the text is the reason. Nothing of a trial that was about to begin is recorded."""


@dataclass(frozen=True, slots=True)
class Upcoming:
    """A claimed trial that is about to run."""

    number: int
    """Number of the episode."""
    trial: int
    """ID of the trial in the results database."""
    driven_by: str
    """Name of the model as the operator may see it: its code in a blind study."""
    plan: EpisodePlan


@dataclass(frozen=True, slots=True)
class EndedEpisode:
    """An episode that has just ended."""

    number: int
    plan: EpisodePlan
    outcome: EpisodeEnd


@dataclass(frozen=True, slots=True)
class Judgement:
    """An operator's judgement of an episode."""

    verdict: Verdict
    note: str = ""
    """Reason, in the operator's words."""
    called_collision: bool = False
    """The operator saw a collision that the robot did not feel."""
    author: str = ""
    """Name of the judge; empty for the session's operator."""


@dataclass(frozen=True, slots=True)
class TrialCounts:
    """Numbers of trials."""

    total: int
    done: int = 0
    successes: int = 0


NO_TRIALS = TrialCounts(0)


class Operator(ABC):
    """The person at the robot, or a stand-in where there is none.

    The main thread calls every method. `trial_begins`, `place`, `nothing_left` and `judge` may wait for an answer and
    raise `Stopped` when the operator stops the session instead.
    """

    is_present: bool = True
    """A person is there, who can stop the robot."""

    repeats_void_trials: bool = False
    """Trials that are void because of the operator or the robot run again in the same session."""

    @property
    def name(self) -> str:
        """Name of the operator who started the last trial, or an empty string."""
        return ""

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Show the next trial, and return when it may begin. Default: at once.

        Raises:
            TrialSkippedError: the operator postpones the trial.
            SessionEndedError: the operator ends the session.
        """

    @abstractmethod
    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        """Have the robot put at a starting position, and return when it may drive.

        Args:
            start: the starting position.
            problem: what was wrong with the last attempt; empty at first.
            placing: measures where the robot is.

        Raises:
            RobotError: no person is present who could correct the problem.
            TrialSkippedError: the operator postpones the trial.
            SessionEndedError: the operator ends the session.
        """

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Show an action. Default: nothing."""

    def asks_where(self, *, can_measure: bool) -> bool:
        """Return whether the operator has asked for the robot's pose since the last call. Default: False.

        Called between two actions.

        Args:
            can_measure: whether the pose can be measured now.
        """
        del can_measure
        return False

    def show_where(self, text: str) -> None:
        """Show the answer to `asks_where`. Default: nothing."""

    def says_arrived(self) -> bool:
        """Return whether the operator says that the robot has arrived. Default: False.

        Called at each look of a stack that leaves this to the operator.
        """
        return False

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Show how an episode ended. Default: nothing."""

    def judge(self, ended: EndedEpisode) -> Judgement | None:
        """Judge an episode whose verdict is a proposal. Default: None, which leaves it awaiting judgement."""
        del ended
        return None

    def trials_to_repeat(self) -> Sequence[int]:
        """Return and forget the IDs of trials to run again before any other. Never waits. Default: none."""
        return ()

    def nothing_left(self) -> Sequence[int]:
        """Return IDs of trials to run again when no trial is left. Default: none, which ends the session."""
        return ()

    def show_message(self, text: str) -> None:
        """Show a line about the workers, or how to start a stack. Default: nothing."""

    def show_throughput(self, text: str) -> None:
        """Show how fast the workers run. Default: nothing."""


class Display:
    """Where progress is shown. The default shows nothing."""

    def trial_begins(self, goal: str, start: int) -> None:
        """Show the trial that is about to run."""

    def step(self, goal: str, start: int, step: Step) -> None:
        """Show an action."""

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Show how an episode ended."""

    def judged(self, success: bool | None) -> None:
        """Show the operator's judgement of the last episode."""

    def say(self, text: str) -> None:
        """Show a line that stays."""

    def show_throughput(self, text: str) -> None:
        """Show how fast the workers run."""


class AbsentOperator(Operator):
    """No person is present: assumes that the robot is at its start, and leaves proposed verdicts unconfirmed."""

    is_present = False

    def __init__(self, display: Display | None = None) -> None:
        self._display = display or Display()

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Show the trial."""
        self._display.trial_begins(upcoming.plan.goal, upcoming.plan.start.number)

    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        """Accept the first attempt.

        Raises:
            RobotError: something is wrong that only a person could correct.
        """
        del placing
        if problem:
            raise RobotError(f"starting position {start.number}: {problem}, and the run is unattended")

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Show the action."""
        self._display.step(plan.goal, plan.start.number, step)

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Show how the episode ended."""
        self._display.episode_ended(ended)

    def show_message(self, text: str) -> None:
        """Show the line."""
        self._display.say(text)

    def show_throughput(self, text: str) -> None:
        """Show it."""
        self._display.show_throughput(text)
