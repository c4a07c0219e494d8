"""What a pool of workers is to whoever hands out trials: how many are free, what they report, how they end."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from vsnbench.database.campaign_plan import Trial
from vsnbench.database.journal import Journal
from vsnbench.runner.bench import BenchDescription
from vsnbench.runner.episode import EpisodeOutcome
from vsnbench.runner.pool.messages import Keeping
from vsnbench.runner.stopping import StopRequest


@dataclass(frozen=True, slots=True)
class ActionsTaken:
    """So many actions were taken since the last such report."""

    count: int


@dataclass(frozen=True, slots=True)
class EpisodeKept:
    """An episode has ended and is in the record."""

    number: int
    trial: Trial
    outcome: EpisodeOutcome


@dataclass(frozen=True, slots=True)
class WorkerLost:
    """A worker is gone, and another takes its place."""

    trial: Trial | None
    """What it was at; it has no result."""
    words: str
    """How it ended."""


PoolEvent = ActionsTaken | EpisodeKept | WorkerLost


class TrialPool(Protocol):
    """Workers that run trials of one bench plan."""

    @property
    def description(self) -> BenchDescription:
        """What their benches say of themselves."""
        ...

    @property
    def words(self) -> str:
        """How many workers there are, and why."""
        ...

    @property
    def free(self) -> int:
        """How many trials can be begun now."""
        ...

    @property
    def busy(self) -> int:
        """How many trials are being run."""
        ...

    def begin(self, journal: Journal, trial: Trial, keeping: Keeping) -> None:
        """Have a free worker run a trial, unless somebody else is at it.

        Args:
            journal: the record, for workers that have no way to it themselves.
            trial: what is to be run.
            keeping: where it is kept, and how.
        """
        ...

    def events(self, timeout_s: float) -> Sequence[PoolEvent]:
        """Return what has happened, as soon as something has, or nothing by then.

        Raises:
            VsnbenchError: something that no other worker would do better.
        """
        ...

    def stop(self, request: StopRequest) -> None:
        """End all that runs as somebody asks, each episode recorded as such; returns when nobody works any more."""
        ...

    def kill(self) -> None:
        """End all workers at once."""
        ...
