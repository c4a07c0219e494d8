"""A campaign as a source of trials."""

from collections import deque
from collections.abc import Iterable

from vsnbench.results.writing.campaigns import OpenCampaign, Trial
from vsnbench.runner.loop.contract import Session, SessionResult, TrialSource
from vsnbench.runner.loop.follow_up import FollowUpRules, VoidLimit
from vsnbench.runner.operator.contract import Operator


class CampaignSource(TrialSource):
    """The trials of a campaign that are left, each once per session and in the order of the plan.

    A void episode leaves its trial for the next session, unless the rules repeat it.
    """

    def __init__(self, session: Session, campaign: OpenCampaign, voids: VoidLimit | None = None) -> None:
        self.rules = FollowUpRules(voids or VoidLimit(), repeats_void_trials=session.operator.repeats_void_trials)
        self._journal = journal = session.journal
        self._campaign = campaign
        self._trials = {trial.id: trial for trial in campaign.trials}
        self._waiting = deque(journal.campaign_progress(campaign).left)
        self._tried = {trial.id for trial in self._waiting}

    def next_trial(self) -> Trial | None:
        """Return the next trial of the plan."""
        return self._waiting.popleft() if self._waiting else None

    def postpone(self, trial: Trial) -> None:
        """Put a trial at the end."""
        self._waiting.append(trial)

    def mark_unavailable(self, trial: Trial) -> None:
        """Try the trial again if the process that claimed it ends without a result."""
        self._tried.discard(trial.id)

    def repeat(self, trial_ids: Iterable[int]) -> None:
        """Put trials at the front."""
        self._waiting.extendleft(reversed([self._trial(number) for number in trial_ids]))

    def restock(self, operator: Operator) -> bool:
        """Take trials whose process has ended, then ask the operator for trials to repeat."""
        self._journal.recover()
        left = self._journal.campaign_progress(self._campaign).left
        freed = [trial for trial in left if trial.id not in self._tried]
        self._tried.update(trial.id for trial in freed)
        self._waiting.extend(freed or map(self._trial, operator.nothing_left()))
        return bool(self._waiting)

    def _trial(self, number: int) -> Trial:
        """Return a trial of the campaign. If only an earlier request planned it, its cell is known from its claim."""
        return self._trials.get(number) or Trial("", 0, id=number, campaign_id=self._campaign.id)

    def result(self, stopped_because: str) -> SessionResult:
        """Combine the counts of the session with the state of the campaign at its end."""
        progress = self._journal.campaign_progress(self._campaign)
        return SessionResult(
            episodes=self.rules.episodes,
            void=self.rules.void,
            trials=len(self._campaign.trials),
            left=len(progress.left),
            elsewhere=len(progress.elsewhere),
            holders=tuple(sorted({trial.holder for trial in progress.elsewhere})),
            awaiting=len(progress.awaiting),
            stopped_because=stopped_because,
            campaign_id=self._campaign.id,
        )
