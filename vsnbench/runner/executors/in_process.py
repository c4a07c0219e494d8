"""Runs trials in this process, one at a time, with the operator present or absent."""

import logging
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from vsnbench.errors import EpisodeClosedError, RecordError, VsnbenchError
from vsnbench.models.contract import Policy
from vsnbench.protocol.judge import EndReason, judge
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.results.writing.episodes import Claim
from vsnbench.results.writing.journal import Journal
from vsnbench.results.writing.lifecycle import LEASE
from vsnbench.robots.contract import Robot
from vsnbench.runner.episode.episode import EpisodeOutcome, StoppedInEpisodeError, run_episode
from vsnbench.runner.episode.recorder import EpisodeRecorderFanOut
from vsnbench.runner.episode.step import EpisodePlan
from vsnbench.runner.loop.contract import EpisodeFinished, LoopEvent, ScheduledTrial, TrialExecutor, TrialSkipped
from vsnbench.runner.loop.recorded_operator import RecordedOperator
from vsnbench.runner.loop.session_context import SessionContext
from vsnbench.runner.operator.contract import EndedEpisode, TrialSkippedError, Upcoming
from vsnbench.text.sanitize import counted

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class DrivingModel:
    """A loaded model."""

    policy: Policy
    title: str
    """Name as people may see it: the arm's code in a blind study."""


class ModelProvider(ABC):
    """Provides the model of each trial."""

    @abstractmethod
    def take(self, model: str) -> DrivingModel:
        """Return a model, loaded if necessary.

        Raises:
            VsnbenchError: the model cannot be loaded.
        """

    def drop(self, model: str) -> None:
        """Load the model again before its next trial. Default: nothing."""


class SingleModel(ModelProvider):
    """The only model of a campaign."""

    def __init__(self, model: DrivingModel) -> None:
        self._model = model

    def take(self, model: str) -> DrivingModel:
        """Return the model."""
        del model
        return self._model


class InProcessExecutor(TrialExecutor):
    """Runs one trial at a time in the main thread of this process."""

    def __init__(self, context: SessionContext, robot: Robot, models: ModelProvider) -> None:
        self._context = context
        self._robot = robot
        self._models = models
        self._operator = RecordedOperator(context.journal, context.operator, context.recording.operator_name)
        self._pending: tuple[ScheduledTrial, Claim] | None = None
        if context.operator.is_present:
            robot.keep_real_time()

    @property
    def free(self) -> int:
        """One, unless a trial has been claimed."""
        return self._pending is None

    @property
    def busy(self) -> int:
        """One where a trial has been claimed."""
        return self._pending is not None

    def begin(self, trial: ScheduledTrial) -> bool:
        """Claim a trial; `events` runs it."""
        claim = self._context.journal.claim_next(trial.campaign_id, [trial.trial_id])
        self._pending = (trial, claim) if claim is not None else None
        return claim is not None

    def events(self) -> Sequence[LoopEvent]:
        """Run the claimed trial to its end. Returns nothing where another process took this one for dead."""
        if self._pending is None:
            return ()
        (trial, claim), self._pending = self._pending, None
        try:
            outcome = self._run(trial, claim)
        except TrialSkippedError:
            return (TrialSkipped(trial),)
        return () if outcome is None else (EpisodeFinished(trial, outcome),)

    def reload_model(self, model: str) -> None:
        """Load a model again before its next trial."""
        self._models.drop(model)

    def _run(self, trial: ScheduledTrial, claim: Claim) -> EpisodeOutcome | None:
        context = self._context
        try:
            model = self._models.take(trial.model)
        except VsnbenchError as error:
            return self._end_without_model(claim, f"could not be loaded: {error}")
        except BaseException:
            context.journal.release(claim.id)
            raise
        start = context.site.start(claim.trial.start)
        plan = EpisodePlan(context.site, claim.trial.goal, start, claim.seed, context.parameters, context.disturbances)
        robot, profile = self._robot, self._robot.identity.profile
        recorder = EpisodeRecorderFanOut(context.journal, context.recording, profile, model.title, claim)
        try:
            with _renewed(context.journal, claim):
                logger.info("episode %d: %s from start %d", claim.id, claim.trial.goal, claim.trial.start)
                self._operator.trial_begins(Upcoming(claim.id, claim.trial.id, model.title, plan))
                outcome = run_episode(robot, model.policy, plan, recorder, self._operator, context.stop_requests)
        except EpisodeClosedError as closed:
            logger.warning("%s", closed)
            return None
        except StoppedInEpisodeError as stopped:
            self._operator.episode_ended(EndedEpisode(claim.id, plan, stopped.outcome), session_stopped=True)
            raise
        finally:
            context.stop_requests.episode_is_over()
            recorder.close()
            context.journal.release(claim.id)
        actions = counted(outcome.actions, "action")
        logger.info("episode %d: ended after %s: %s", claim.id, actions, outcome.verdict.end_reason)
        self._operator.episode_ended(EndedEpisode(claim.id, plan, outcome))
        return outcome

    def _end_without_model(self, claim: Claim, error: str) -> EpisodeOutcome:
        verdict = judge(EndReason.MODEL_ERROR, 0, None, self._context.parameters)
        self._context.journal.end_episode(claim.id, EpisodeEnd(EndReason.MODEL_ERROR, 0, verdict, error=error))
        return EpisodeOutcome(verdict, 0, None, 0.0, error, began=False)


@contextmanager
def _renewed(journal: Journal, claim: Claim) -> Iterator[None]:
    """Renew the lease of a claim while a person places the robot."""
    over = threading.Event()

    def renew() -> None:
        while not over.wait(LEASE.total_seconds() / 3):
            try:
                journal.renew(claim.id)
            except RecordError as error:
                logger.warning("episode %d: %s", claim.id, error)

    threading.Thread(target=renew, name="claim", daemon=True).start()
    try:
        yield
    finally:
        over.set()
