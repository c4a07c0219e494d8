"""What the trial loop works with: the session, sources of trials, executors, and the events that executors report."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from vsnbench.models.human.controls import Controls
from vsnbench.protocol.disturbances import NONE, Disturbances
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.results.writing.episodes import Claim
from vsnbench.results.writing.journal import Journal
from vsnbench.results.writing.provenance import Provenance, gather_provenance
from vsnbench.robots.contract import CameraPreview
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.episode.step import EpisodePlan
from vsnbench.runner.loop.follow_up import FollowUp, FollowUpRules
from vsnbench.runner.operator.contract import NO_TRIALS, AbsentOperator, EndedEpisode, Operator, TrialCounts
from vsnbench.runner.setup.trial_setup import SetupDescription
from vsnbench.runner.stopping.requests import StopRequest, StopRequests
from vsnbench.sites.site import Site
from vsnbench.values.battery import Battery
from vsnbench.values.robot_identity import RobotIdentity


@dataclass(frozen=True, slots=True)
class ActionsTaken:
    """A worker has taken actions since its last report."""

    count: int


@dataclass(frozen=True, slots=True)
class EpisodeEnded:
    """An episode has ended and is in the results database."""

    claim: Claim
    outcome: EpisodeEnd


@dataclass(frozen=True, slots=True)
class TrialReturned:
    """A trial has no result and runs later: its worker ended, or the operator postponed it."""

    trial: Trial | None
    """None for a worker that ended without a trial."""
    lost_worker: str = ""
    """How the worker's process ended; empty for a postponed trial, of which nothing is recorded."""


LoopEvent = ActionsTaken | EpisodeEnded | TrialReturned
"""What has happened, in the words of the loop, of every executor and of the workers' messages."""


class TrialExecutor(ABC):
    """Runs trials: in this process, in local workers or on a Ray cluster."""

    session: "Session"
    """The session whose trials run, once `session_begins` was called."""
    description: SetupDescription
    """Robot and model of every trial; a study has none, because each arm has its own."""
    needs_operator: bool = False
    """A person must place the robot."""
    controls: Controls | None = None
    """Those of the person who drives; None for a model."""
    preview: CameraPreview | None = None
    """Camera image while the robot drives; None for several robots, and for a robot without it."""
    provenance: Callable[[], Provenance] = staticmethod(partial(gather_provenance, of_run=True))
    """Describes this process as far as results depend on it."""

    @property
    def robot(self) -> RobotIdentity:
        """Robot of every trial."""
        return self.description.robot

    @property
    def battery(self) -> Battery | None:
        """Battery of the robot's base, if it is known. Default: None."""
        return None

    def session_begins(self, session: "Session") -> None:
        """Run the trials of this session from now on."""
        self.session = session

    @property
    @abstractmethod
    def free(self) -> int:
        """Number of trials that can begin now."""

    @property
    @abstractmethod
    def busy(self) -> int:
        """Number of trials that have begun and are not reported yet."""

    @abstractmethod
    def begin(self, trial: Trial) -> bool:
        """Begin a trial. Returns False when another process has claimed it."""

    @abstractmethod
    def events(self) -> Sequence[LoopEvent]:
        """Run or wait, and return what has happened; may return nothing.

        Raises:
            SessionEndedError: the operator ends the session.
            Stopped: a request to stop takes effect; what happened until then is recorded.
            VsnbenchError: no trial can be run or recorded.
        """

    def reload_model(self, trial: Trial) -> None:
        """Load the model of a trial again before its next trial. Default: nothing."""

    def stop(self, request: StopRequest) -> None:
        """End every running episode and record why. Default: nothing is left to end."""

    @abstractmethod
    def halt(self) -> None:
        """Halt every robot at once, from any thread, before the process is forced to end."""


@dataclass(slots=True, kw_only=True)
class Session:
    """A session of a campaign or a study, as its executor, its operator and their displays see it."""

    journal: Journal
    robots: TrialExecutor
    recording: RecordingOptions
    site: Site
    parameters: ProtocolParameters
    parameters_of: Mapping[int, ProtocolParameters] = field(default_factory=dict)
    """By the campaign's id, where a campaign has others."""
    disturbances: Disturbances = NONE
    """Of what the policy sees."""
    stop_requests: StopRequests = field(default_factory=StopRequests)
    operator: Operator = field(default_factory=AbsentOperator)
    label: str = ""
    """Model and site, for the display."""
    trials: TrialCounts = NO_TRIALS
    campaign_ids: tuple[int, ...] = ()
    is_blind: bool = False
    """The operator must not see which model drives or what it chooses."""
    recording_note: str = ""
    """What is stored of the episodes; empty where this was shown before."""

    def plan(self, claim: Claim) -> EpisodePlan:
        """Return the plan of a claimed trial's episode."""
        trial = claim.trial
        start = self.site.start(trial.start)
        parameters = self.parameters_of.get(trial.campaign_id, self.parameters)
        return EpisodePlan(self.site, trial.goal, start, claim.seed, parameters, self.disturbances)

    def show_end(self, ended: EpisodeEnded) -> None:
        """Show the operator how an episode of a worker ended."""
        self.operator.episode_ended(EndedEpisode(ended.claim.id, self.plan(ended.claim), ended.outcome))


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionResult:
    """Result of a session of a campaign or a study."""

    episodes: int
    void: int
    trials: int
    """Number of requested or scheduled trials."""
    left: int
    """Trials without a result that are still needed and that no process is running."""
    elsewhere: int = 0
    """Trials that another process is running."""
    holders: tuple[str, ...] = ()
    """Processes that run the trials elsewhere; empty for a study."""
    awaiting: int = 0
    """Trials whose episode awaits an operator's judgement."""
    stopped_because: str = ""
    """Reason for an early end."""
    campaign_id: int = 0
    """0 for a study, which has a campaign for each arm."""
    suspended: tuple[str, ...] = ()
    """Arms whose model could not be used, by the name that people may see."""
    over: str = ""
    """Why no further trial of a study is needed although some are left; empty otherwise."""


class TrialSource(ABC):
    """Decides which trial is next."""

    rules: FollowUpRules
    """What follows an episode of this source."""

    @abstractmethod
    def next_trial(self) -> Trial | None:
        """Return the next trial, or None when none can begin now.

        Raises:
            SessionEndedError: no further trial may begin; its text is the reason.
        """

    @abstractmethod
    def postpone(self, trial: Trial) -> None:
        """Run a trial after the others."""

    @abstractmethod
    def restock(self, operator: Operator) -> bool:
        """Look for trials that can run after all. Called when none is running or left; False ends the session."""

    @abstractmethod
    def result(self, stopped_because: str) -> SessionResult:
        """Return the result of the session, which has ended for this reason."""

    def mark_unavailable(self, trial: Trial) -> None:
        """Register a trial that another process has claimed. Default: nothing."""

    def repeat(self, trial_ids: Iterable[int]) -> None:
        """Run trials again before any other. Default: nothing, for sources whose void trials stay scheduled."""

    def add_outcome(self, ended: EpisodeEnded, follow_up: FollowUp) -> None:
        """Register an ended episode and what follows it. Default: nothing."""
