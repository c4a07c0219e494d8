"""A campaign as a source of trials."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

from vsnbench.results.writing.campaigns import CampaignProgress, OpenCampaign
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.loop.contract import ScheduledTrial, TrialSource
from vsnbench.runner.loop.follow_up import FollowUpRules
from vsnbench.runner.operator.contract import Operator


@dataclass(frozen=True, slots=True)
class SessionResult:
    """Result of a session of a campaign."""

    episodes: int
    void: int
    left: int
    """Requested trials without a result that no process is running."""
    elsewhere: int = 0
    """Trials that another process is running."""
    awaiting: int = 0
    """Trials whose episode awaits an operator's judgement."""
    stopped_because: str = ""
    """Reason for an early end."""
    holders: tuple[str, ...] = ()
    """Processes that run the trials elsewhere."""

    @classmethod
    def of(cls, rules: FollowUpRules, progress: CampaignProgress, stopped_because: str) -> Self:
        """Combine the counts of the session with the state of the campaign at its end."""
        return cls(
            rules.episodes,
            rules.void,
            len(progress.left),
            len(progress.elsewhere),
            len(progress.awaiting),
            stopped_because,
            tuple(sorted({trial.holder for trial in progress.elsewhere})),
        )


class CampaignSource(TrialSource):
    """The trials of a campaign that are left, each once per session and in the order of the plan.

    A void episode leaves its trial for the next session, unless the rules repeat it.
    """

    def __init__(self, journal: Journal, campaign: OpenCampaign, rules: FollowUpRules | None = None) -> None:
        self.rules = rules or FollowUpRules()
        self._journal = journal
        self._campaign = campaign
        self._waiting = deque(trial.id for trial in journal.campaign_progress(campaign).left)
        self._tried = set(self._waiting)

    def next_trial(self) -> ScheduledTrial | None:
        """Return the next trial of the plan."""
        return ScheduledTrial(self._campaign.id, self._waiting.popleft()) if self._waiting else None

    def postpone(self, trial: ScheduledTrial) -> None:
        """Put a trial at the end."""
        self._waiting.append(trial.trial_id)

    def mark_unavailable(self, trial: ScheduledTrial) -> None:
        """Try the trial again if the process that claimed it ends without a result."""
        self._tried.discard(trial.trial_id)

    def repeat(self, trial_ids: Iterable[int]) -> None:
        """Put trials at the front."""
        self._waiting.extendleft(reversed(list(trial_ids)))

    def restock(self, operator: Operator) -> bool:
        """Take trials whose process has ended, then ask the operator for trials to repeat."""
        self._journal.recover()
        freed = [
            trial.id for trial in self._journal.campaign_progress(self._campaign).left if trial.id not in self._tried
        ]
        self._tried.update(freed)
        self._waiting.extend(freed or operator.nothing_left())
        return bool(self._waiting)
