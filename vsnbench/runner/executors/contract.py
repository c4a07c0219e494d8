"""A pool of workers: its capacity, the events that it reports and how it ends."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.episode.episode import EpisodeOutcome
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.setup.trial_setup import SetupDescription
from vsnbench.runner.stopping.requests import StopRequest


@dataclass(frozen=True, slots=True)
class ActionsTaken:
    """Number of actions since the last report."""

    count: int


@dataclass(frozen=True, slots=True)
class EpisodeStored:
    """An episode has ended and is in the results database."""

    number: int
    trial: Trial
    outcome: EpisodeOutcome


@dataclass(frozen=True, slots=True)
class WorkerLost:
    """A worker process ended; the pool replaces it."""

    trial: Trial | None
    """Trial that it was running, which has no result."""
    cause: str
    """How the process ended."""


PoolEvent = ActionsTaken | EpisodeStored | WorkerLost


class TrialPool(ABC):
    """Workers that run trials with setups made from one spec; a context manager that ends them."""

    description: SetupDescription
    """Description that the setups of all workers share."""
    summary: str
    """Number of workers, and where they are or the reason for the number."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.kill()

    @property
    @abstractmethod
    def free(self) -> int:
        """Number of trials that can begin now."""

    @property
    @abstractmethod
    def busy(self) -> int:
        """Number of trials that are running."""

    @abstractmethod
    def begin(self, journal: Journal, trial: Trial, recording: RecordingOptions) -> None:
        """Have a free worker run a trial, unless another process has claimed it."""

    @abstractmethod
    def events(self, timeout_s: float) -> Sequence[PoolEvent]:
        """Return what has happened as soon as there is something, or nothing after the timeout.

        Raises:
            VsnbenchError: a failure that every worker would repeat.
        """

    @abstractmethod
    def stop(self, request: StopRequest) -> None:
        """End all running episodes, record why, and return when all workers have ended."""

    @abstractmethod
    def kill(self) -> None:
        """End all workers at once."""
