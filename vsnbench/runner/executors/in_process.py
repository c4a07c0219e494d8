"""Runs trials in this process, one at a time, with the operator present or absent."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from vsnbench.errors import EpisodeClosedError, VsnbenchError
from vsnbench.models.contract import Policy
from vsnbench.protocol.judge import EndReason, judge
from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.results.writing.episodes import Claim
from vsnbench.robots.contract import Robot
from vsnbench.runner.episode.episode import StoppedInEpisodeError, run_episode
from vsnbench.runner.episode.recorder import EpisodeRecorderFanOut
from vsnbench.runner.executors.leases import leases_renewed
from vsnbench.runner.loop.contract import EpisodeEnded, LoopEvent, Session, TrialExecutor, TrialReturned
from vsnbench.runner.loop.recorded_operator import RecordedOperator
from vsnbench.runner.operator.contract import EndedEpisode, TrialSkippedError, Upcoming
from vsnbench.runner.setup.trial_setup import TrialSetup
from vsnbench.text.sanitize import counted
from vsnbench.values.battery import Battery
from vsnbench.values.robot_identity import RobotIdentity

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class DrivingModel:
    """A loaded model."""

    policy: Policy
    title: str
    """Name as people may see it: the arm's code in a blind study."""


class InProcessExecutor(TrialExecutor):
    """Runs one trial at a time in the main thread of this process."""

    def __init__(
        self,
        robot: Robot,
        take: Callable[[Trial], DrivingModel],
        drop: Callable[[Trial], object] = lambda _trial: None,
    ) -> None:
        """Use a robot that is ready.

        Args:
            robot: the robot.
            take: returns the model of a trial, loaded if necessary; raises VsnbenchError if it cannot be loaded.
            drop: has the model of a trial loaded again before its next trial.
        """
        self.needs_operator = robot.needs_operator
        self.preview = robot.preview if robot.has_preview else None
        self._robot = robot
        self._take = take
        self._drop = drop
        self._claim: Claim | None = None

    @classmethod
    def of_setup(cls, setup: TrialSetup) -> "InProcessExecutor":
        """Return the executor of a campaign, whose only model is that of the setup."""
        model = DrivingModel(setup.policy, setup.description.title)
        executor = cls(setup.robot, lambda _trial: model)
        executor.description, executor.provenance = setup.description, setup.provenance
        executor.controls = setup.controls
        return executor

    @property
    def robot(self) -> RobotIdentity:
        """Robot of every trial."""
        return self._robot.identity

    @property
    def battery(self) -> Battery | None:
        """Battery of the robot's base, if it is known."""
        return self._robot.battery

    def session_begins(self, session: Session) -> None:
        """Run the trials of this session from now on."""
        super().session_begins(session)
        self._operator = RecordedOperator(session)
        if session.operator.is_present:
            self._robot.keep_real_time()

    @property
    def free(self) -> int:
        """One, unless a trial has been claimed."""
        return self._claim is None

    @property
    def busy(self) -> int:
        """One where a trial has been claimed."""
        return self._claim is not None

    def begin(self, trial: Trial) -> bool:
        """Claim a trial; `events` runs it."""
        self._claim = self.session.journal.claim_next(trial.campaign_id, [trial.id])
        return self._claim is not None

    def events(self) -> Sequence[LoopEvent]:
        """Run the claimed trial to its end. Returns nothing where another process took this one for dead."""
        claim, self._claim = self._claim, None
        if claim is None:
            return ()
        session, journal = self.session, self.session.journal
        try:
            model = self._take(claim.trial)
        except VsnbenchError as error:
            return (EpisodeEnded(claim, self._end_without_model(claim, f"could not be loaded: {error}")),)
        except BaseException:
            journal.release(claim.id)
            raise
        plan = session.plan(claim)
        if session.parameters_of:
            self._robot.set_execution(plan.parameters.execution)
        recorder = EpisodeRecorderFanOut(journal, session.recording, self.robot.profile, model.title, claim)
        try:
            with leases_renewed(journal, [claim]):
                logger.info("episode %d: %s from start %d", claim.id, claim.trial.goal, claim.trial.start)
                self._operator.trial_begins(Upcoming(claim.id, claim.trial.id, model.title, plan))
                outcome = run_episode(self._robot, model.policy, plan, recorder, self._operator, session.stop_requests)
        except TrialSkippedError:
            return (TrialReturned(claim.trial),)
        except EpisodeClosedError as closed:
            logger.warning("%s", closed)
            return ()
        except StoppedInEpisodeError as stopped:
            self._operator.episode_ended(EndedEpisode(claim.id, plan, stopped.outcome), session_stopped=True)
            raise
        finally:
            session.stop_requests.episode_is_over()
            recorder.close()
            journal.release(claim.id)
        actions = counted(outcome.actions, "action")
        logger.info("episode %d: ended after %s: %s", claim.id, actions, outcome.verdict.end_reason)
        self._operator.episode_ended(EndedEpisode(claim.id, plan, outcome))
        return (EpisodeEnded(claim, outcome),)

    def reload_model(self, trial: Trial) -> None:
        """Load the model of a trial again before its next trial."""
        self._drop(trial)

    def halt(self) -> None:
        """Halt the robot at once."""
        self._robot.halt()

    def _end_without_model(self, claim: Claim, error: str) -> EpisodeEnd:
        verdict = judge(EndReason.MODEL_ERROR, 0, None, self.session.parameters)
        end = EpisodeEnd(verdict, 0, error=error, began=False)
        self.session.journal.end_episode(claim.id, end)
        return end
