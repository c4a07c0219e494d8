"""A small plan and its episodes, for tests of the record."""

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from tests.processes import Fork
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.writing.campaigns import CampaignPlan, Trial
from vsnbench.results.writing.entries import EpisodeBegin, EpisodeEnd
from vsnbench.results.writing.episodes import Claim
from vsnbench.results.writing.journal import Journal
from vsnbench.sites.site import Site, parse_site
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.model.card import ModelCard
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import RobotIdentity
from vsnbench.values.robot_profile import RobotProfile
from vsnbench.values.step import StepRecord

SITE_TEXT = """
name: cell
title: A cell
rooms: [{name: cell, polygon: [[0, 0], [4, 0], [4, 4], [0, 4]]}]
walls: [{start: [0, 0], end: [4, 0]}]
starts: [{number: 1, position: [1, 1], heading_deg: 0}, {number: 2, position: [2, 1], heading_deg: 90}]
"""


def cell() -> Site:
    return parse_site(SITE_TEXT, "cell.yaml")


def profile() -> RobotProfile:
    return RobotProfile.model_validate(
        {
            "name": "puck",
            "title": "Puck",
            "base": {
                "radius_m": 0.177,
                "height_m": 0.4,
                "mass_kg": 6.3,
                "track_m": 0.23,
                "wheel_radius_m": 0.035,
                "max_linear_m_s": 0.7,
                "max_angular_rad_s": 3.1,
                "odometry_rate_hz": 50,
            },
            "camera": {"width": 64, "height": 48, "horizontal_fov_deg": 60, "mount_height_m": 0.3},
        }
    )


def plan(
    *, goals: tuple[str, ...] = ("chair", "sofa"), seed: int = 7, settings: dict[str, object] | None = None
) -> CampaignPlan:
    return CampaignPlan(
        site=cell(),
        robot=RobotIdentity(profile(), "simulated", simulated=True),
        model=ModelCard("random", settings=settings or {"temperature": 1.0}),
        protocol=ProtocolParameters(),
        seed=seed,
        trials=[Trial(goal, start) for goal in goals for start in (1, 2)],
    )


def forward(number: int) -> StepRecord:
    """Step `number` of a drive straight ahead."""
    return StepRecord(
        number=number,
        action=Action.MOVE_FORWARD,
        raw_action="LOOK_DOWN",
        result=MotionResult(True, 0.25, 0.0, 1.5, pose=Pose(number * 0.25, 0.0, 0.0)),
        observed=Pose((number - 1) * 0.25, 0.0, 0.0),
        stamp_s=float(number),
        world=Fix(Pose(1 + number * 0.25, 1.0, 0.0), PoseSource.SIMULATED),
        rgb_digest="blake3:" + "0" * 64,
        depth_digest="blake3:" + "1" * 64,
        probabilities={"MOVE_FORWARD": 0.75, "STOP": 0.25},
        details={"note": "straight on"},
    )


def stopped(*, success: bool, actions: int = 3) -> EpisodeEnd:
    distance = GoalDistance(0.4 if success else 2.4, PoseSource.SIMULATED, "chair_1")
    return EpisodeEnd(
        Verdict(EndReason.STOP, success, "judged", distance),
        actions,
        path_m=0.25 * actions,
        duration_s=1.5 * actions,
    )


def void(reason: EndReason = EndReason.ABORTED) -> EpisodeEnd:
    return EpisodeEnd(Verdict(reason, None, "void"), 1, error="a person ended it")


def begun(journal: Journal, trial: Trial) -> Claim:
    """Return the started episode of a trial."""
    claim = journal.claim_next(trial.campaign_id, [trial.id])
    assert claim is not None
    return going(journal, claim)


def going(journal: Journal, claim: Claim) -> Claim:
    """Place a claimed episode and begin it."""
    journal.place(claim.id, Fix(Pose(1.0, 1.0, 0.0), PoseSource.SIMULATED))
    journal.begin(claim.id, EpisodeBegin(shortest_m=2.0))
    return claim


def run(journal: Journal, trial: Trial, end: EpisodeEnd, steps: int = 3) -> Claim:
    return complete(journal, begun(journal, trial), end, steps)


def write_success(directory: Path) -> None:
    """Write a record of one success."""
    with Journal.open(sqlite_url(directory / "vsnbench.db")) as journal:
        run(journal, journal.find_or_create_campaign(plan()).trials[0], stopped(success=True))


def finish(journal: Journal, claim: Claim, end: EpisodeEnd, steps: int = 3) -> Claim:
    """Run a claimed episode from its placing to its end."""
    return complete(journal, going(journal, claim), end, steps)


def complete(journal: Journal, episode: Claim, end: EpisodeEnd, steps: int = 3) -> Claim:
    """Record the steps and the end of a running episode."""
    for number in range(1, steps + 1):
        journal.append_step(episode.id, forward(number))
    journal.end_episode(episode.id, end)
    return episode


@contextmanager
def running_elsewhere(url: str) -> Iterator[Fork]:
    """Run an endless episode in another process, which writes the number of each stored step."""

    def run_endlessly(sink: TextIO) -> None:
        journal = Journal.open(url)
        episode = begun(journal, journal.find_or_create_campaign(plan()).trials[0])
        for number in itertools.count(1):
            journal.append_step(episode.id, forward(number))
            sink.write(f"{number}\n")
            sink.flush()

    process = Fork.of(run_endlessly)
    try:
        yield process
    finally:
        process.kill()
        process.stdout.close()
