"""A locked study as a source of trials."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.studies.entries import OVER, SUSPEND, RecordedStudy, StudyTrialProgress
from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.loop.contract import EpisodeEnded, SessionResult, TrialSource
from vsnbench.runner.loop.follow_up import FollowUp, FollowUpRules
from vsnbench.runner.operator.contract import Operator, SessionEndedError
from vsnbench.runner.study.arms import StudyPlace
from vsnbench.study.decision import StoppingDecision
from vsnbench.study.stopping import decide
from vsnbench.study.units import shared_blocks

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class StudyRequest:
    """What to run of a study."""

    recorded: RecordedStudy
    place: StudyPlace
    results: ResultsDirectory
    only_next: bool = False
    """Run a single episode."""
    until: datetime | None = None
    """Begin no trial from then on; with a time zone."""
    memory_bytes: int | None = None
    """Memory for the loaded models together; half of the machine's when None."""


def arm_of(study: RecordedStudy, trial: Trial) -> str:
    """Return the name of the arm whose model drives in a trial: each arm has its own campaign."""
    return next(arm.name for arm in study.arms if arm.campaign_id == trial.campaign_id)


class StudySource(TrialSource):
    """The scheduled trials of a study that are left and needed.

    A void trial stays scheduled, so it runs again at once. A model that fails repeatedly is suspended.
    """

    def __init__(self, journal: Journal, request: StudyRequest) -> None:
        self.rules = FollowUpRules(isolates_models=True)
        self._journal = journal
        self._request = request
        self._study = request.recorded
        self._suspended: list[str] = []
        self._unavailable: set[int] = set()
        self._postponed: set[int] = set()
        """IDs of trials that the operator skipped; they run when no other trial is left."""
        self._decision = self._decide(self._progress())

    def next_trial(self) -> Trial | None:
        """Return the first scheduled trial that is left and needed.

        Raises:
            SessionEndedError: the session's time is over.
        """
        if self._is_complete:
            return None
        inactive, set_aside = {*self._suspended, *self._decision.dropped}, self._unavailable | self._postponed
        for scheduled in self._progress():
            trial_id = scheduled.trial.id
            if scheduled.left and scheduled.arm not in inactive and trial_id not in set_aside:
                self._check_time()
                return scheduled.trial
        return None

    def postpone(self, trial: Trial) -> None:
        """Run a trial when no other is left."""
        self._postponed.add(trial.id)

    def mark_unavailable(self, trial: Trial) -> None:
        """Leave a trial to the process that has claimed it."""
        self._unavailable.add(trial.id)

    def add_outcome(self, ended: EpisodeEnded, follow_up: FollowUp) -> None:
        """Suspend a failing model, and decide after a result whether further trials are needed."""
        arm, outcome = arm_of(self._study, ended.claim.trial), ended.outcome
        if follow_up.suspends_model:
            self._suspended.append(arm)
            self._journal.note_in_study(self._study.id, SUSPEND, f"{arm}: {outcome.error}")
            reason = "its model failed; the record has the error" if self._study.is_blind else outcome.error
            logger.warning("%s is suspended in this session: %s", self._study.shown(arm), reason)
        if outcome.verdict.end_reason.is_result:
            self._decision = self._decide(self._progress())

    def restock(self, operator: Operator) -> bool:
        """Take the postponed trials, then ask the operator."""
        if self._is_complete:
            return False
        if self._postponed:
            self._postponed.clear()
            return True
        return bool(operator.nothing_left())

    def result(self, stopped_because: str) -> SessionResult:
        """Return the result of the session."""
        progress = self._progress()
        needed = [] if self._decision.over else [trial for trial in progress if trial.arm not in self._decision.dropped]
        return SessionResult(
            episodes=self.rules.episodes,
            void=self.rules.void,
            trials=len(progress),
            left=sum(trial.left for trial in needed),
            elsewhere=sum(trial.state is not None and not trial.done and not trial.here for trial in needed),
            awaiting=sum(trial.done and trial.success is None for trial in progress),
            suspended=tuple(self._study.shown(arm) for arm in self._suspended),
            over=self._decision.over,
            stopped_because=stopped_because,
        )

    @property
    def _is_complete(self) -> bool:
        return bool(self._decision.over) or (self._request.only_next and self.rules.episodes > 0)

    def _progress(self) -> tuple[StudyTrialProgress, ...]:
        return self._journal.study_progress(self._study.id)

    def _check_time(self) -> None:
        until = self._request.until
        if until is not None and datetime.now(until.tzinfo) >= until:
            raise SessionEndedError(f"it is {until:%H:%M}")

    def _decide(self, progress: Sequence[StudyTrialProgress]) -> StoppingDecision:
        plan = self._request.place.study
        if plan.stopping != "decided":
            return StoppingDecision((), {}, "")
        decision = decide(plan, shared_blocks(progress, plan.goals))
        if decision.over and not any(entry.kind == OVER for entry in self._study.entries):
            self._journal.note_in_study(self._study.id, OVER, decision.over)
        return decision
