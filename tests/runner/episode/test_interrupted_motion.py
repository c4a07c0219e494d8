"""A request to stop in any phase of a movement leaves a record whose steps lead to the final pose."""

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.runner.stand_ins import APARTMENT, NOBODY, StandInRobot
from vsnbench.evidence.verification.judgements import check_judgements
from vsnbench.evidence.verification.record import open_copy
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import KeepFiles, ResultsDirectory
from vsnbench.results.writing.campaigns import CampaignPlan, Trial
from vsnbench.results.writing.journal import Journal
from vsnbench.robots.contract import Robot
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.recorder import EpisodeRecorderFanOut, RecordingOptions
from vsnbench.runner.episode.step import EpisodePlan
from vsnbench.runner.stopping.requests import Stopped, StopRequests
from vsnbench.simulator.dynamics.physics import Physics
from vsnbench.values.decision import Decision
from vsnbench.values.motion_result import NOT_BEGUN
from vsnbench.values.movement import Action, ActionKind, Waypoint
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose
from vsnbench.values.step import StepRecord

PHASES: dict[str, tuple[type[Any], str, int, bool]] = {
    "before it begins": (SimulatedRobot, "drive", 2, True),
    "before its first period": (Physics, "drive", 1, True),
    "after its first period": (Physics, "drive", 1, False),
    "in its middle": (Physics, "drive", 20, True),
    "after its middle": (Physics, "drive", 20, False),
    "after its end": (SimulatedRobot, "drive", 2, False),
    "while it is located": (SimulatedRobot, "locate", 3, True),
    "when it is located": (SimulatedRobot, "locate", 3, False),
}
"""Phase -> method, number of its call (of a period: in the second movement), and whether the stop comes before it."""
MOVEMENTS = {"move": Action.MOVE_FORWARD, "turn": Action.TURN_LEFT, "waypoint": Waypoint(0.4, 0.2)}


class Drives(Policy):
    """Turns right, then makes one movement again and again."""

    def __init__(self, movement: Action | Waypoint) -> None:
        self.card = ModelCard("drives", action_kinds=frozenset(ActionKind))
        self.movement = movement
        self.asked = 0

    def reset(self, goal: str, seed: int) -> None:
        self.asked = 0

    def act(self, observation: Observation) -> Decision:
        self.asked += 1
        return Decision(Action.TURN_RIGHT if self.asked == 1 else self.movement)


def stop_in(monkeypatch: pytest.MonkeyPatch, phase: str, movement: Action | Waypoint, policy: Drives) -> None:
    """Send SIGINT in a phase of the second movement."""
    kind, name, call, before = PHASES[phase]
    original: Callable[..., Any] = getattr(kind, name)
    calls = 0

    def called(*given: Any) -> Any:
        nonlocal calls
        calls += kind is SimulatedRobot or policy.asked == 2
        due = calls == call
        if due and before:
            calls += 1
            os.kill(os.getpid(), signal.SIGINT)
        result = original(*given)
        if due and not before:
            calls += 1
            os.kill(os.getpid(), signal.SIGINT)
        return result

    monkeypatch.setattr(kind, name, called)


def run_until_stopped(robot: Robot, policy: Policy, results: Path, plan: CampaignPlan) -> None:
    with Journal.open(sqlite_url(results / "vsnbench.db")) as journal, StopRequests() as stop:
        campaign = journal.find_or_create_campaign(plan)
        claim = journal.claim_next(campaign.id, [campaign.trials[0].id])
        assert claim is not None
        options = RecordingOptions(ResultsDirectory.locate(results), keep=KeepFiles.NONE)
        recorder = EpisodeRecorderFanOut(journal, options, robot.identity.profile, "drives", claim)
        episode = EpisodePlan(APARTMENT, "chair", APARTMENT.start(2), claim.seed, plan.protocol)
        with pytest.raises(Stopped):
            run_episode(robot, policy, episode, recorder, NOBODY, stop)
        recorder.close()


def plan_of(robot: Robot) -> CampaignPlan:
    return CampaignPlan(
        site=APARTMENT,
        robot=robot.identity,
        model=ModelCard("drives"),
        protocol=ProtocolParameters(),
        seed=0,
        trials=[Trial("chair", 2)],
        conditions=robot.conditions,
    )


def read(results: Path) -> tuple[list[str], Any, list[StepRecord]]:
    """Return the findings of `verify`, the episode and its steps."""
    (results / "scratch").mkdir()
    with open_copy(results, results / "scratch") as record:
        check, _ = check_judgements(record, lambda _what, _done, _of: None)
        (episode,) = record.episodes()
        return [str(finding) for finding in check.findings], episode, record.steps(episode.id)


IN_PHASES = [
    pytest.param(phase, name, marks=() if (place - number) % len(MOVEMENTS) == 0 else pytest.mark.long)
    for number, phase in enumerate(PHASES)
    for place, name in enumerate(MOVEMENTS)
]
"""Every phase of one kind of movement, in turn; the other pairs are long tests."""


@pytest.mark.parametrize(("phase", "name"), IN_PHASES)
def test_a_stop_in_any_phase_of_a_movement_leaves_an_honest_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, phase: str
) -> None:
    robot, policy = SimulatedRobot(APARTMENT, load_profile("turtlebot2")), Drives(MOVEMENTS[name])
    stop_in(monkeypatch, phase, MOVEMENTS[name], policy)
    run_until_stopped(robot, policy, tmp_path, plan_of(robot))
    findings, episode, steps = read(tmp_path)
    assert findings == []
    assert EndReason(episode.end_reason) is EndReason.ABORTED
    assert episode.actions == len(steps)
    assert steps[-1].world is not None
    assert (episode.final_x_m, episode.final_y_m) == steps[-1].world.pose.position
    if phase == "before it begins":
        assert len(steps) == 1, "no movement, no step"
        return
    assert len(steps) == 2
    result = steps[-1].result
    assert result is not None
    assert (result.completed, result.failure) == (False, "stopped with Ctrl-C")
    assert result.duration_s >= (0 if "before" in phase else 0.02)
    moved = abs(result.turn_rad) + abs(result.displacement_m)
    assert (moved > 0) == (phase != "before its first period")
    assert (result.path_m is None) == (name != "waypoint")


def test_a_robot_that_cannot_tell_its_motion_is_recorded_where_it_is(tmp_path: Path) -> None:
    def stopped(_action: Action) -> Any:
        robot.place = Pose(robot.place.x_m + 0.1, robot.place.y_m, robot.place.heading_rad)
        os.kill(os.getpid(), signal.SIGTERM)

    robot = StandInRobot(on_execute=stopped)
    run_until_stopped(robot, Drives(Action.MOVE_FORWARD), tmp_path, plan_of(robot))
    findings, episode, (step,) = read(tmp_path)
    assert findings == []
    assert EndReason(episode.end_reason) is EndReason.INTERRUPTED
    assert (episode.actions, round(episode.path_length_m, 6)) == (1, 0.1)
    assert step.result is not None
    assert step.result.displacement_m != step.result.displacement_m, "unknown"
    assert step.result.failure == "the process was ended by SIGTERM"


def test_a_motion_that_had_not_begun_is_no_step_whatever_the_odometry_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(_action: Action) -> Any:
        robot.place = Pose(robot.place.x_m + 0.0001, robot.place.y_m, robot.place.heading_rad)
        os.kill(os.getpid(), signal.SIGTERM)

    robot = StandInRobot(on_execute=stopped)
    monkeypatch.setattr(StandInRobot, "interrupted_motion", lambda _: NOT_BEGUN, raising=False)
    run_until_stopped(robot, Drives(Action.MOVE_FORWARD), tmp_path, plan_of(robot))
    findings, episode, steps = read(tmp_path)
    assert (findings, episode.actions, steps) == ([], 0, [])
