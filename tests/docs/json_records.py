"""Records that the commands of `json_outputs` read."""

from dataclasses import replace
from pathlib import Path

from tests.report.records import Attempt, Lab
from tests.results.records_of_a_lab import complete, plan, stopped
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.protocol.stop_pose import StopPose
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.second_judgements import Outcome
from vsnbench.results.writing.entries import EpisodeBegin
from vsnbench.results.writing.journal import Journal
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.placement import MeasuredPlacement, PlacementMethod, PlacementTolerance, PoseCovariance
from vsnbench.values.pose import Pose


def attempts(successes: int, *, starts: int = 15, operator: str = "") -> list[Attempt]:
    """Return episodes of which the first ones succeed, and the fifteenth ends with a collision."""
    ends = {15: EndReason.COLLISION}
    return [
        Attempt(
            start=start,
            success=start <= successes,
            end_reason=ends.get(start, EndReason.STOP),
            distance_m=0.5 if start <= successes else 3.0,
            operator=operator,
        )
        for start in range(1, starts + 1)
    ]


def write_placed_record(directory: Path) -> None:
    """Write two episodes with measured poses at the start and after STOP; that of the second STOP is unknown."""
    directory.mkdir()
    mark, pose = Pose(1.0, 1.0, 0.5), Pose(1.03, 1.01, 0.52)
    covariance = PoseCovariance(1e-4, 0.0, 0.0, 2e-4, 0.0, 1e-5)
    method, found = PlacementMethod.TURN, {"undetermined": ("left and right",), "moved": ("chair_1",)}
    measured = MeasuredPlacement(1, mark, pose, covariance, PlacementTolerance(), method, 13, **found)
    odometry = GoalDistance(0.87, PoseSource.ESTIMATED, "chair_1", range_m=(0.5, 1.3))
    far = GoalDistance(1.06, PoseSource.MEASURED, "chair_1", range_m=(1.02, 1.1))
    stops = [
        StopPose(replace(measured, undetermined=(), method=PlacementMethod.DRIVE), odometry, far, 1.0),
        StopPose(replace(measured, method=PlacementMethod.DRIVE), odometry, None, 1.0),
    ]
    with Journal.open(sqlite_url(directory / "vsnbench.db")) as journal:
        for trial, stop in zip(journal.find_or_create_campaign(plan()).trials, stops, strict=False):
            claim = journal.claim_next(trial.campaign_id, [trial.id])
            assert claim is not None
            journal.set_operator(claim.id, "Ana")
            journal.place(claim.id, Fix(pose, PoseSource.MEASURED))
            journal.begin(claim.id, EpisodeBegin(measured=measured))
            complete(journal, claim, replace(stopped(success=True), stop=stop, path_m=3.0))
        journal.clear_operator()


def write_rich_record(directory: Path) -> Path:
    """Write a record with every kind of table: several models, seeds, operators, real and simulated trials."""
    directory.mkdir(exist_ok=True)
    lab = Lab(directory)
    for model, successes in (("vlv", 9), ("pirlnav", 6), ("forward", 2)):
        lab.write(attempts(successes, operator="Ana"), model=model, simulated=False)
        lab.write(attempts(successes + 1), model=model)
        lab.write(attempts(successes), model=model, seed=1)
    lab.write(attempts(5, operator="Ben"), model="vlv", simulated=False, seed=1)
    lab.write(attempts(6, starts=10), model="random", simulated=False)
    lab.write(attempts(7), model="random")
    with lab.journal() as journal:
        journal.judge(1, Verdict(EndReason.COLLISION, False, "contact with the bed"), author="Ana")
        for number in range(16, 31):
            outcome = Outcome.FAILURE if number % 5 == 0 else Outcome.SUCCESS
            journal.judge_second(number, "Grace", outcome, "0.5 m to the nearest chair")
    return directory
