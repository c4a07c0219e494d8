"""Runs what is left of a campaign, trial by trial, and survives what goes wrong in one of them."""

import logging
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol, Self

from vsnbench.database.campaign_plan import CampaignStanding, OpenCampaign
from vsnbench.database.episode_entries import INTERVENTION
from vsnbench.database.episodes import Claim
from vsnbench.database.journal import Journal
from vsnbench.database.lifecycle import LEASE
from vsnbench.errors import EpisodeClosedError, JudgedMeanwhileError, RecordError
from vsnbench.models.contract import Policy
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import Site, StartingPosition
from vsnbench.robots.contract import Robot
from vsnbench.runner.attendant import Attendant, EndedEpisode, SessionOverError, TrialSkippedError, Upcoming
from vsnbench.runner.episode import (
    EpisodeOutcome,
    EpisodePlan,
    EpisodeRecorder,
    Step,
    StoppedInEpisodeError,
    run_episode,
)
from vsnbench.runner.placing import Placing
from vsnbench.runner.stopping import Stopping

logger = logging.getLogger(__name__)

VOID_IN_A_ROW = 3
"""After so many void episodes one after another something is broken that another attempt will not mend."""
THE_PROPOSAL_ALONE = 1
"""So many verdicts has an episode whose judge is asked; with more, another has judged it meanwhile."""
LEFT_STANDING = (EndReason.MOTION_FAILED, EndReason.SENSOR_LOST)
"""After these a real robot stands where it failed, and a person must get it out of there."""
TAKEN_AGAIN = (EndReason.ABORTED, *LEFT_STANDING)
"""Void by a person's stop or by the robot: with a page beside the robot the trial comes again before any other.

What is void by the model's own fault would be void again; that, and every void episode where there is a terminal alone
or nobody, leaves its trial for the next session. In a study a void trial always comes again at once.
"""


class SessionRecorder(EpisodeRecorder, Protocol):
    """The recorder of one claimed episode."""

    def close(self) -> None:
        """Let go of files and threads."""
        ...


class RecorderFactory(Protocol):
    """Makes the recorder of a claimed episode."""

    def __call__(self, claim: Claim) -> SessionRecorder:
        """Return a recorder that has not begun."""
        ...


@dataclass(frozen=True, slots=True)
class Stage:
    """What all trials of a session are run with, whichever model drives."""

    journal: Journal
    robot: Robot
    beside: "Judged"
    stop: Stopping


@dataclass(frozen=True, slots=True)
class DrivingModel:
    """A model that drives, and what makes the recorders of its episodes."""

    policy: Policy
    new_recorder: RecorderFactory
    shown: str = ""
    """Its name for people: its code while they are blind."""


@dataclass(slots=True)
class VoidsInARow:
    """Counts episodes as they end, and knows when another attempt will mend nothing.

    What a person ended with the emergency stop key says nothing about what is broken, and is not counted.
    """

    most: int = VOID_IN_A_ROW
    """So many one after another end the session."""
    episodes: int = 0
    void: int = 0
    _in_a_row: int = 0

    def count(self, outcome: EpisodeOutcome) -> str:
        """Count an episode; return why the session ends here, empty when it goes on."""
        self.episodes += 1
        reason = outcome.verdict.end_reason
        self.void += not reason.is_result
        if reason.is_result:
            self._in_a_row = 0
        elif reason is not EndReason.ABORTED:
            self._in_a_row += 1
        if self._in_a_row < self.most:
            return ""
        if self.most == 1:
            return f"an episode is void: {outcome.error}"
        return f"{self.most} void episodes one after another, the last: {outcome.error}"


@dataclass(frozen=True, slots=True)
class SessionResult:
    """What a session achieved."""

    episodes: int
    void: int
    left: int
    """Trials that were asked for and that nobody has done or is at."""
    elsewhere: int = 0
    """Trials that another process is at."""
    awaiting: int = 0
    """Trials that await a person's judgement."""
    stopped_because: str = ""
    holders: tuple[str, ...] = ()
    """Who is at the trials elsewhere."""

    @classmethod
    def of(cls, voids: VoidsInARow, standing: CampaignStanding, stopped_because: str) -> Self:
        """Return what a session achieved, from its own episodes and what has become of the campaign by its end."""
        return cls(
            voids.episodes,
            voids.void,
            len(standing.left),
            len(standing.elsewhere),
            len(standing.awaiting),
            stopped_because,
            tuple(sorted({one.holder for one in standing.elsewhere})),
        )


def run_session(
    stage: Stage,
    model: DrivingModel,
    campaign: OpenCampaign,
    site: Site,
    parameters: ProtocolParameters,
    most_void: int = VOID_IN_A_ROW,
) -> SessionResult:
    """Run every trial that was asked for and is left, once each, and say what has become of the campaign by then.

    A void episode leaves its trial for the next session, one that could not even begin included, unless the attendant
    wants it again (`TAKEN_AGAIN`); several in a row end this one.

    Raises:
        Stopped: a person or the system asked to stop; what happened until then is recorded.
        RecordError: the record cannot be written.
    """
    voids = VoidsInARow(most_void)
    because = run_trials(stage, model, campaign, site, parameters, voids)
    return SessionResult.of(voids, stage.journal.standing(campaign), because)


def run_trials(
    stage: Stage,
    model: DrivingModel,
    campaign: OpenCampaign,
    site: Site,
    parameters: ProtocolParameters,
    voids: VoidsInARow,
) -> str:
    """Run trials as `run_session` does, and return why they ended before all were done; empty when they are.

    Raises:
        Stopped: a person or the system asked to stop; what happened until then is recorded.
        RecordError: the record cannot be written.
    """
    because = ""
    wanted = [trial.id for trial in campaign.trials]
    while not because:
        claim = _next(stage.journal, campaign, wanted)
        if claim is None:
            wanted = list(stage.beside.nothing_left())
            if not wanted:
                break
            continue
        trial = claim.trial
        wanted.remove(trial.id)
        plan = EpisodePlan(site, trial.goal, site.start(trial.start), claim.seed, parameters)
        try:
            outcome = run_trial(stage, model, claim, plan)
        except TrialSkippedError:
            wanted.append(trial.id)
            continue
        except SessionOverError as over:
            return str(over)
        if outcome is not None:
            because = voids.count(outcome)
        wanted = [*stage.beside.again(), *wanted]
    return because


def _next(journal: Journal, campaign: OpenCampaign, wanted: Sequence[int]) -> Claim | None:
    """Claim the next trial; where none is left, what a process held that has died meanwhile is free again."""
    if not wanted:
        return None
    claim = journal.claim_next(campaign.id, wanted)
    if claim is None:
        journal.recover()
        claim = journal.claim_next(campaign.id, wanted)
    return claim


def run_trial(stage: Stage, model: DrivingModel, claim: Claim, plan: EpisodePlan) -> EpisodeOutcome | None:
    """Run one claimed trial with one model, and have it judged; None where another process took this one for dead.

    Raises:
        TrialSkippedError: whoever is there wants it later; nothing of it is kept.
        SessionOverError: whoever is there wants no more; nothing of it is kept.
        Stopped: a person or the system asked to stop; what happened until then is recorded.
        RecordError: the record cannot be written.
    """
    beside, recorder = stage.beside, model.new_recorder(claim)
    try:
        with _kept(stage.journal, claim):
            beside.trial_begins(Upcoming(claim.id, claim.trial.id, model.shown, plan))
            outcome = run_episode(stage.robot, model.policy, plan, recorder, beside, stage.stop)
    except EpisodeClosedError as closed:
        logger.warning("%s", closed)
        return None
    except StoppedInEpisodeError as stopped:
        beside.was_cut_short(EndedEpisode(claim.id, plan, stopped.outcome))
        raise
    finally:
        stage.stop.episode_is_over()
        recorder.close()
        stage.journal.release(claim.id)
    beside.has_ended(EndedEpisode(claim.id, plan, outcome))
    return outcome


class Judged:
    """The attendant of a session, whose judgements and interventions are kept."""

    def __init__(self, journal: Journal, attendant: Attendant, operator: str = "") -> None:
        self._journal = journal
        self._attendant = attendant
        self._operator = operator
        self._left_standing: EndedEpisode | None = None
        self._upcoming = 0
        """The number of the episode that is about to run."""

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Tell the attendant, and wait until it may begin."""
        self._upcoming = upcoming.number
        self._attendant.trial_begins(upcoming)
        self._attended()

    def again(self) -> Sequence[int]:
        """Return what is to be run again."""
        return self._attendant.again()

    def nothing_left(self) -> Sequence[int]:
        """Ask what is to be run again, now that nothing is left."""
        return self._attendant.nothing_left()

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Tell the attendant."""
        self._attendant.step_taken(plan, step)

    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        """Have the robot placed; that it had to be fetched from a failure first is an intervention there."""
        self._attendant.place(start, problem, placing)
        self._attended()
        if (fetched := self._left_standing) is not None:
            self._left_standing = None
            self._intervened(fetched, f"moved by hand after {fetched.outcome.verdict.end_reason}")

    def _attended(self) -> None:
        """Have the episode name the session of whoever said go."""
        if operator := self._attendant.beside:
            self._journal.attended(self._upcoming, operator)

    def was_cut_short(self, ended: EndedEpisode) -> None:
        """Tell the attendant of an episode that ended with its session: nobody is asked to judge it now."""
        self._attendant.episode_ended(ended)

    def has_ended(self, ended: EndedEpisode) -> None:
        """Tell the attendant, and have what awaits judgement judged."""
        self._attendant.episode_ended(ended)
        outcome = ended.outcome
        if not outcome.proposed:
            return
        if outcome.began and outcome.verdict.end_reason in LEFT_STANDING:
            self._left_standing = ended
        if not outcome.verdict.end_reason.is_result:
            return
        judgement = self._attendant.judge(ended)
        if judgement is None:
            return
        author = judgement.author or self._operator
        try:
            self._journal.judge(
                ended.number, judgement.verdict, author=author, note=judgement.note, seen=THE_PROPOSAL_ALONE
            )
        except JudgedMeanwhileError as meanwhile:
            logger.warning("%s", meanwhile)
            return
        if judgement.called_collision:
            self._intervened(ended, f"collision called: {judgement.verdict.text}", judgement.author)

    def _intervened(self, ended: EndedEpisode, what: str, author: str = "") -> None:
        author, step = author or self._operator, ended.outcome.actions or None
        self._journal.add_event(INTERVENTION, what, author=author, episode_id=ended.number, step_number=step)


@contextmanager
def _kept(journal: Journal, claim: Claim) -> Iterator[None]:
    """Keep a claim alive, however long a person takes to wheel the robot to its mark."""
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
