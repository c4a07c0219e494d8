"""Runs the trials of a campaign on a pool of workers."""

import time
from collections import deque
from collections.abc import Sequence

from vsnbench.results.writing.campaigns import OpenCampaign, trial_seed
from vsnbench.runner.episode.step import EpisodePlan
from vsnbench.runner.executors.contract import ActionsTaken, EpisodeStored, TrialPool, WorkerLost
from vsnbench.runner.loop.contract import EpisodeFinished, LoopEvent, ScheduledTrial, TrialExecutor, TrialLost
from vsnbench.runner.loop.session_context import SessionContext
from vsnbench.runner.operator.contract import EndedEpisode
from vsnbench.runner.setup.cleanup import sweep_results
from vsnbench.runner.stopping.requests import StopRequest

_WAIT_S = 0.5
_THROUGHPUT_WINDOW_S = 10.0


class PoolExecutor(TrialExecutor):
    """Hands trials to workers, and reports results in the order in which they arrive."""

    def __init__(self, context: SessionContext, campaign: OpenCampaign, pool: TrialPool) -> None:
        self._context = context
        self._campaign = campaign
        self._pool = pool
        self._trials = {trial.id: trial for trial in campaign.trials}
        self._actions: deque[tuple[float, int]] = deque()
        """Time and number of actions of each report."""
        context.operator.show_message(pool.summary)

    @property
    def free(self) -> int:
        """Number of trials that can begin now."""
        return self._pool.free

    @property
    def busy(self) -> int:
        """Number of trials that are running."""
        return self._pool.busy

    def begin(self, trial: ScheduledTrial) -> bool:
        """Have a worker run a trial. A trial that another process has claimed ends without an event."""
        self._pool.begin(self._context.journal, self._trials[trial.trial_id], self._context.recording)
        return True

    def events(self) -> Sequence[LoopEvent]:
        """Wait half a second at most, and return what has happened."""
        self._context.stop_requests.act_now()  # here, so that no report is interrupted half-way
        happened: list[LoopEvent] = []
        for event in self._pool.events(_WAIT_S):
            match event:
                case ActionsTaken(count):
                    self._actions.append((time.monotonic(), count))
                case EpisodeStored():
                    happened.append(self._finished(event))
                case WorkerLost():
                    happened.append(self._lost(event))
        self._context.operator.show_throughput(self._throughput())
        return happened

    def stop(self, request: StopRequest) -> None:
        """End all running episodes."""
        self._pool.stop(request)

    def _finished(self, event: EpisodeStored) -> EpisodeFinished:
        trial, outcome, site = event.trial, event.outcome, self._context.site
        seed = trial_seed(self._campaign.seed, trial.goal, trial.start, trial.repetition)
        plan = EpisodePlan(site, trial.goal, site.start(trial.start), seed, self._context.parameters)
        self._context.operator.episode_ended(EndedEpisode(event.number, plan, outcome))
        return EpisodeFinished(ScheduledTrial(trial.campaign_id, trial.id), outcome)

    def _lost(self, event: WorkerLost) -> TrialLost:
        """Clean up after a lost worker."""
        self._context.journal.recover()
        sweep_results(self._context.recording.results, self._context.journal)
        trial = event.trial
        where = f" at {trial.goal} from {trial.start}; the trial will run again" if trial is not None else ""
        self._context.operator.show_message(f"a worker ended with {event.cause}{where}")
        scheduled = ScheduledTrial(trial.campaign_id, trial.id) if trial is not None else None
        return TrialLost(scheduled, event.cause)

    def _throughput(self) -> str:
        now_s = time.monotonic()
        while self._actions and now_s - self._actions[0][0] > _THROUGHPUT_WINDOW_S:
            self._actions.popleft()
        if not self._actions:
            return f"{self._pool.busy} running"
        over_s = max(now_s - self._actions[0][0], 1.0)
        return f"{sum(count for _, count in self._actions) / over_s:.0f} actions/s"
