"""A pool of workers that runs the trials of a session."""

import time
from abc import abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Self

from vsnbench.runner.loop.contract import (
    ActionsTaken,
    EpisodeEnded,
    LoopEvent,
    Session,
    TrialExecutor,
    TrialReturned,
)
from vsnbench.runner.setup.cleanup import sweep_results

_WAIT_S = 0.5
_THROUGHPUT_WINDOW_S = 10.0


class TrialPool(TrialExecutor):
    """Workers that run trials with setups made from one spec; a context manager that ends them."""

    summary: str
    """Number of workers, and where they are or the reason for the number."""
    _actions: deque[tuple[float, int]]
    """Time and number of actions of each report."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.halt()

    @abstractmethod
    def reports(self, timeout_s: float) -> Sequence[LoopEvent]:
        """Return what has happened as soon as there is something, or nothing after the timeout.

        Raises:
            VsnbenchError: a failure that every worker would repeat.
        """

    def session_begins(self, session: Session) -> None:
        """Run the trials of this session from now on, and show what the workers are."""
        super().session_begins(session)
        self._actions = deque()
        session.operator.show_message(self.summary)

    def events(self) -> Sequence[LoopEvent]:
        """Wait half a second at most, show what has happened, and return it. Clean up after lost workers."""
        session = self.session
        session.stop_requests.act_now()  # here, so that no report is interrupted half-way
        happened = self.reports(_WAIT_S)
        for event in happened:
            match event:
                case ActionsTaken(count):
                    self._actions.append((time.monotonic(), count))
                case EpisodeEnded():
                    session.show_end(event)
                case TrialReturned(trial, cause):
                    session.journal.recover()
                    sweep_results(session.recording.results, session.journal)
                    where = f" at {trial.goal} from {trial.start}; the trial will run again" if trial else ""
                    session.operator.show_message(f"a worker ended with {cause}{where}")
        session.operator.show_throughput(self._throughput())
        return happened

    def _throughput(self) -> str:
        now_s = time.monotonic()
        while self._actions and now_s - self._actions[0][0] > _THROUGHPUT_WINDOW_S:
            self._actions.popleft()
        if not self._actions:
            return f"{self.busy} running"
        over_s = max(now_s - self._actions[0][0], 1.0)
        return f"{sum(count for _, count in self._actions) / over_s:.0f} actions/s"
