"""Decides what follows an episode: the next trial, a repetition, a suspended model or the end of the session. Pure."""

from collections import Counter
from dataclasses import dataclass, field

from vsnbench.protocol.judge import MODEL_FAILURES, ROBOT_FAILURES, EndReason
from vsnbench.results.writing.entries import EpisodeEnd

DEFAULT_VOID_LIMIT = 3
LOST_WORKER_LIMIT = 10
"""Consecutive workers lost without a finished episode that end the session."""
REPEATABLE = (EndReason.ABORTED, *ROBOT_FAILURES)
"""Void because of the operator or the robot: another attempt can succeed. A model's failure would recur."""


def strands_robot(outcome: EpisodeEnd) -> bool:
    """Whether a real robot has stopped at a place from which a person must fetch it."""
    return outcome.proposed and outcome.began and outcome.verdict.end_reason in ROBOT_FAILURES


@dataclass(slots=True)
class VoidLimit:
    """Stops a session after too many consecutive void episodes.

    Episodes that the operator ended with the emergency stop do not count.
    """

    limit: int = DEFAULT_VOID_LIMIT
    """Consecutive void episodes that end the session."""
    consecutive: int = 0
    _same_loss: int = 0
    """Episodes that were running when the model was last lost: the loss of a shared server ends all of them."""

    def add(self, outcome: EpisodeEnd, running: int = 0) -> str | None:
        """Count an episode that ended while `running` others run. Returns the reason to stop, or None to continue."""
        reason = outcome.verdict.end_reason
        is_same_loss, self._same_loss = self._same_loss > 0, max(self._same_loss - 1, 0)
        if reason.is_result:
            self.consecutive = 0
        elif reason is EndReason.MODEL_LOST and is_same_loss:
            return None
        elif reason is not EndReason.ABORTED:
            self.consecutive += 1
            self._same_loss = running if reason is EndReason.MODEL_LOST else 0
        if self.consecutive < self.limit:
            return None
        if self.limit == 1:
            return f"an episode is void: {outcome.error}"
        return f"{self.limit} consecutive void episodes, the last: {outcome.error}"


@dataclass(frozen=True, slots=True)
class FollowUp:
    """What the session does after an episode."""

    stop_reason: str | None = None
    """Begin no further trial, for this reason."""
    repeats: bool = False
    """The trial is run again before any other."""
    reloads_model: bool = False
    """The model is loaded again before its next trial."""
    suspends_model: bool = False
    """The model gets no further trial in this session."""


@dataclass(slots=True)
class FollowUpRules:
    """Rules of one session, with the counts that they depend on."""

    voids: VoidLimit = field(default_factory=VoidLimit)
    repeats_void_trials: bool = False
    """Episodes that are void because of the operator or the robot are run again in this session."""
    isolates_models: bool = False
    """A failing model is reloaded and finally suspended; its episodes do not count towards the void limit."""
    episodes: int = 0
    void: int = 0
    _lost_workers: int = 0
    _model_failures: Counter[int] = field(default_factory=Counter)
    """Consecutive failures of a model, by its campaign."""

    def after_episode(self, outcome: EpisodeEnd, campaign_id: int = 0, running: int = 0) -> FollowUp:
        """Count an ended episode of a campaign and return what follows it; `running` other episodes still run."""
        reason = outcome.verdict.end_reason
        self.episodes += 1
        self.void += not reason.is_result
        self._lost_workers = 0
        if self.isolates_models and reason in MODEL_FAILURES:
            self._model_failures[campaign_id] += 1
            suspends = not outcome.began or self._model_failures[campaign_id] >= self.voids.limit
            return FollowUp(reloads_model=True, suspends_model=suspends)
        self._model_failures[campaign_id] = 0
        return FollowUp(self.voids.add(outcome, running), repeats=self.repeats_void_trials and reason in REPEATABLE)

    def after_lost_worker(self, cause: str) -> str | None:
        """Count a worker that ended without a result. Returns the reason to stop, or None to continue."""
        self._lost_workers += 1
        if self._lost_workers < LOST_WORKER_LIMIT:
            return None
        return f"{LOST_WORKER_LIMIT} consecutive workers ended without a result, the last with {cause}"
