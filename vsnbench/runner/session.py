"""Runs what is left of a campaign, trial by trial, and survives what goes wrong in one of them."""

import logging
from dataclasses import dataclass
from typing import Protocol

from vsnbench.database.campaign_plan import OpenCampaign
from vsnbench.database.episode_entries import Claim
from vsnbench.database.journal import Journal
from vsnbench.errors import EpisodeClosedError, RobotError
from vsnbench.models.contract import Policy
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import Site
from vsnbench.robots.contract import Robot
from vsnbench.runner.episode import EpisodeOutcome, EpisodePlan, EpisodeRecorder, run_episode
from vsnbench.runner.stopping import StopSignals

logger = logging.getLogger(__name__)

VOID_IN_A_ROW = 3
"""After so many void episodes one after another something is broken that another attempt will not mend."""


class SessionRecorder(EpisodeRecorder, Protocol):
    """The recorder of one trial's episode, which knows the episode's number once it has begun."""

    @property
    def episode_id(self) -> int:
        """The episode's number."""
        ...

    def close(self) -> None:
        """Let go of files and threads."""
        ...


class RecorderFactory(Protocol):
    """Makes the recorder of a claimed episode."""

    def __call__(self, claim: Claim) -> SessionRecorder:
        """Return a recorder that has not begun."""
        ...


class SessionWatcher(Protocol):
    """Who is told how the session goes."""

    def episode_begins(self, goal: str, start: int) -> None:
        """A trial is about to be run."""
        ...

    def episode_ends(self, number: int, goal: str, start: int, outcome: EpisodeOutcome) -> None:
        """An episode has ended."""
        ...


@dataclass(frozen=True, slots=True)
class SessionResult:
    """What a session achieved."""

    episodes: int
    void: int
    left: int
    """Trials of the campaign that still have no valid episode."""
    stopped_because: str = ""


def run_session(
    journal: Journal,
    campaign: OpenCampaign,
    site: Site,
    parameters: ProtocolParameters,
    robot: Robot,
    policy: Policy,
    new_recorder: RecorderFactory,
    watcher: SessionWatcher,
    stop: StopSignals,
) -> SessionResult:
    """Run every trial of the campaign that is left, once each.

    A void episode leaves its trial for the next session; several in a row end this one. A robot that cannot even
    begin ends it at once.

    Raises:
        Stopped: a person or the system asked to stop; what happened until then is recorded.
        RecordError: the record cannot be written.
    """
    episodes = void = in_a_row = 0
    because = ""
    wanted = [trial.id for trial in campaign.trials]
    while (claim := journal.claim_next(campaign.id, wanted)) is not None:
        trial = claim.trial
        wanted = wanted[wanted.index(trial.id) + 1 :]
        watcher.episode_begins(trial.goal, trial.start)
        plan = EpisodePlan(site, trial.goal, site.start(trial.start), claim.seed, parameters)
        recorder = new_recorder(claim)
        try:
            outcome = run_episode(robot, policy, plan, recorder, stop)
        except EpisodeClosedError as closed:
            logger.warning("%s", closed)
            continue
        except RobotError as error:
            because = str(error)
            break
        finally:
            recorder.close()
            journal.release(claim.id)
        episodes += 1
        watcher.episode_ends(recorder.episode_id, trial.goal, trial.start, outcome)
        is_void = outcome.verdict.success is None
        void += is_void
        in_a_row = in_a_row + 1 if is_void else 0
        if in_a_row == VOID_IN_A_ROW:
            because = f"{VOID_IN_A_ROW} void episodes one after another, the last: {outcome.error}"
            break
    return SessionResult(episodes, void, len(journal.standing(campaign).left), because)
