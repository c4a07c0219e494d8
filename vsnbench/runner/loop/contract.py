"""What the trial loop works with: sources of trials, executors, and the events that executors report."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from vsnbench.runner.episode.episode import EpisodeOutcome
from vsnbench.runner.loop.follow_up import FollowUp, FollowUpRules
from vsnbench.runner.operator.contract import Operator
from vsnbench.runner.stopping.requests import StopRequest


@dataclass(frozen=True, slots=True)
class ScheduledTrial:
    """A trial that a source hands to an executor."""

    campaign_id: int
    trial_id: int
    model: str = ""
    """Arm of a study whose model drives; empty in a campaign."""


@dataclass(frozen=True, slots=True)
class EpisodeFinished:
    """An episode has ended and is in the results database."""

    trial: ScheduledTrial
    outcome: EpisodeOutcome


@dataclass(frozen=True, slots=True)
class TrialSkipped:
    """The operator postponed a trial; nothing of it is recorded."""

    trial: ScheduledTrial


@dataclass(frozen=True, slots=True)
class TrialLost:
    """A worker ended without a result."""

    trial: ScheduledTrial | None
    """Trial that the worker was running."""
    cause: str


LoopEvent = EpisodeFinished | TrialSkipped | TrialLost


class TrialSource(ABC):
    """Decides which trial is next."""

    rules: FollowUpRules
    """What follows an episode of this source."""

    @abstractmethod
    def next_trial(self) -> ScheduledTrial | None:
        """Return the next trial, or None when none can begin now.

        Raises:
            SessionEndedError: no further trial may begin; its text is the reason.
        """

    @abstractmethod
    def postpone(self, trial: ScheduledTrial) -> None:
        """Run a trial after the others."""

    @abstractmethod
    def restock(self, operator: Operator) -> bool:
        """Look for trials that can run after all. Called when none is running or left; False ends the session."""

    def mark_unavailable(self, trial: ScheduledTrial) -> None:
        """Register a trial that another process has claimed. Default: nothing."""

    def repeat(self, trial_ids: Iterable[int]) -> None:
        """Run trials again before any other. Default: nothing, for sources whose void trials stay scheduled."""

    def add_outcome(self, finished: EpisodeFinished, follow_up: FollowUp) -> None:
        """Register a finished episode and what follows it. Default: nothing."""


class TrialExecutor(ABC):
    """Runs trials: in this process, in local workers or on a Ray cluster."""

    @property
    @abstractmethod
    def free(self) -> int:
        """Number of trials that can begin now."""

    @property
    @abstractmethod
    def busy(self) -> int:
        """Number of trials that have begun and are not reported yet."""

    @abstractmethod
    def begin(self, trial: ScheduledTrial) -> bool:
        """Begin a trial. Returns False when another process has claimed it."""

    @abstractmethod
    def events(self) -> Sequence[LoopEvent]:
        """Run or wait, and return what has happened; may return nothing.

        Raises:
            SessionEndedError: the operator ends the session.
            Stopped: a request to stop takes effect; what happened until then is recorded.
            VsnbenchError: no trial can be run or recorded.
        """

    def reload_model(self, model: str) -> None:
        """Load a model again before its next trial. Default: nothing."""

    def stop(self, request: StopRequest) -> None:
        """End every running episode and record why. Default: nothing is left to end."""
