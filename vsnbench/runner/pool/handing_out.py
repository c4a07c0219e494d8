"""Hands the trials of a campaign out to a pool of workers, and counts what comes back, in the order it comes."""

import time
from collections import deque

from vsnbench.database.campaign_plan import Trial, trial_seed
from vsnbench.database.journal import Journal
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import Site
from vsnbench.runner.attendant import EndedEpisode, Overview
from vsnbench.runner.episode import EpisodePlan
from vsnbench.runner.leftovers import sweep_results
from vsnbench.runner.pool.contract import ActionsTaken, EpisodeKept, TrialPool, WorkerLost
from vsnbench.runner.pool.messages import Keeping
from vsnbench.runner.session import VOID_IN_A_ROW, SessionResult, VoidsInARow
from vsnbench.runner.stopping import Stopped, Stopping

LOST_IN_A_ROW = 10
"""After so many workers that died before any episode has ended, another would die too."""
_WAIT_S = 0.5
_PACE_WINDOW_S = 10.0


def hand_out(
    journal: Journal,
    keeping: Keeping,
    site: Site,
    parameters: ProtocolParameters,
    pool: TrialPool,
    overview: Overview,
    stop: Stopping,
    most_void: int = VOID_IN_A_ROW,
) -> SessionResult:
    """Run every trial that was asked for and is left, once each, on as many workers as the pool has.

    A trial whose worker dies is taken again, after the others. Void episodes leave their trials for the next session,
    and several in a row end this one when what runs beside them has ended too.

    Raises:
        Stopped: a person or the system asked to stop; what happened until then is recorded.
        VsnbenchError: a worker found that nothing can be run or kept.
    """
    try:
        return _HandingOut(journal, keeping, site, parameters, pool, overview, stop, most_void).run()
    except Stopped as stopped:
        pool.stop(stopped.request)
        raise


class _HandingOut:
    def __init__(
        self,
        journal: Journal,
        keeping: Keeping,
        site: Site,
        parameters: ProtocolParameters,
        pool: TrialPool,
        overview: Overview,
        stop: Stopping,
        most_void: int,
    ) -> None:
        self._journal = journal
        self._keeping = keeping
        self._site = site
        self._parameters = parameters
        self._pool = pool
        self._overview = overview
        self._stop = stop
        self._waiting: deque[Trial] = deque(journal.standing(keeping.campaign).left)
        self._voids = VoidsInARow(most_void)
        self._lost_in_a_row = 0
        self._because = ""
        self._actions: deque[tuple[float, int]] = deque()

    def run(self) -> SessionResult:
        self._overview.say(self._pool.words)
        while (self._waiting and not self._because) or self._pool.busy:
            while self._waiting and not self._because and self._pool.free:
                self._pool.begin(self._journal, self._waiting.popleft(), self._keeping)
            # Nothing is interrupted in the middle of a report: the request waits half a second at most.
            self._stop.act_now()
            for event in self._pool.events(_WAIT_S):
                match event:
                    case ActionsTaken(count):
                        self._actions.append((time.monotonic(), count))
                    case EpisodeKept():
                        self._kept(event)
                    case WorkerLost():
                        self._lost(event)
            self._overview.pace(self._pace())
        return SessionResult.of(self._voids, self._journal.standing(self._keeping.campaign), self._because)

    def _kept(self, event: EpisodeKept) -> None:
        trial, outcome = event.trial, event.outcome
        seed = trial_seed(self._keeping.campaign.seed, trial.goal, trial.start, trial.repetition)
        plan = EpisodePlan(self._site, trial.goal, self._site.start(trial.start), seed, self._parameters)
        self._overview.episode_ended(EndedEpisode(event.number, plan, outcome))
        self._lost_in_a_row = 0
        because = self._voids.count(outcome)
        self._because = self._because or because

    def _lost(self, event: WorkerLost) -> None:
        """Clear away behind a dead worker, and have its trial taken again."""
        self._journal.recover()
        sweep_results(self._keeping.results, self._journal)
        at = f" at {event.trial.goal} from {event.trial.start}, which is taken again" if event.trial else ""
        self._overview.say(f"a worker ended with {event.words}{at}")
        if event.trial is not None:
            self._waiting.append(event.trial)
        self._lost_in_a_row += 1
        if self._lost_in_a_row == LOST_IN_A_ROW:
            self._because = f"{LOST_IN_A_ROW} workers died one after another, the last with {event.words}"

    def _pace(self) -> str:
        now_s = time.monotonic()
        while self._actions and now_s - self._actions[0][0] > _PACE_WINDOW_S:
            self._actions.popleft()
        if not self._actions:
            return f"{self._pool.busy} at work"
        over_s = max(now_s - self._actions[0][0], 1.0)
        return f"{sum(count for _, count in self._actions) / over_s:.0f} actions/s"
