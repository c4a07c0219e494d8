"""Disturbances reach the policy, and neither the depth guard nor the record nor the judge."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from tests.runner.episode.test_episode import MemoryRecorder
from tests.runner.stand_ins import NOBODY, PLAN, ScriptedPolicy, StandInRobot
from vsnbench.models.contract import ModelCard
from vsnbench.models.task import Task
from vsnbench.protocol.disturbances import parse_disturbances
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.robots.contract import Robot, Watch
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.pixel import waypoint_of
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.values.decision import Decision
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action, ActionKind, Chunk, Drive, Pixel
from vsnbench.values.observation import Observation, Sensor

PROFILE = load_profile("turtlebot2")
SMALL = PROFILE.model_copy(update={"camera": PROFILE.camera.resized(160, 120)})
WALK = [Action.MOVE_FORWARD, Action.TURN_LEFT, Action.MOVE_FORWARD, Action.STOP]


@dataclass
class Seeing(ScriptedPolicy):
    """Keeps its observations and its task."""

    seen: list[Observation] = field(default_factory=list)
    tasks: list[Task] = field(default_factory=list)

    def begin(self, task: Task) -> None:
        self.tasks.append(task)
        super().begin(task)

    def act(self, observation: Observation) -> Decision:
        self.seen.append(observation)
        return super().act(observation)


def run(
    robot: Robot, policy: ScriptedPolicy, *texts: str, parameters: ProtocolParameters | None = None
) -> tuple[EpisodeEnd, MemoryRecorder]:
    recorder = MemoryRecorder()
    plan = replace(
        PLAN,
        start=PLAN.site.start(15),  # 5.6 m of free path ahead
        parameters=parameters or ProtocolParameters(),
        disturbances=parse_disturbances(texts),
    )
    with StopRequests() as stop, robot:
        return run_episode(robot, policy, plan, recorder, NOBODY, stop), recorder


def seeing(*sensors: Sensor) -> Seeing:
    return Seeing(list(WALK), ModelCard("seeing", sensors=frozenset(sensors or Sensor)))


def simulated() -> SimulatedRobot:
    return SimulatedRobot(PLAN.site, SMALL)


def test_the_guard_the_record_and_the_judge_use_the_robots_own_data() -> None:
    everything = (
        "blur@5,glare@5,low_light@5,depth_holes=1,dropped_frames@5,odometry_drift@5,stale_frames",
        "camera_tilt=-20",
    )
    clean, disturbed = seeing(), seeing()
    outcome, recorder = run(simulated(), clean)
    other, other_recorder = run(simulated(), disturbed, *everything)
    assert outcome.verdict == other.verdict
    assert outcome.final == other.final
    assert len(recorder.steps) == len(WALK)
    for step, disturbed_step in zip(recorder.steps, other_recorder.steps, strict=True):
        assert np.array_equal(step.observation.rgb, disturbed_step.observation.rgb)
        assert step.observation.pose == disturbed_step.observation.pose
        assert step.guard == disturbed_step.guard
        assert (step.blocked, step.site_after) == (disturbed_step.blocked, disturbed_step.site_after)
    assert recorder.steps[0].guard is not None
    assert all(seen.depth_m is not None and np.isnan(seen.depth_m).all() for seen in disturbed.seen)
    assert not any(
        np.array_equal(mine.rgb, theirs.rgb) for mine, theirs in zip(clean.seen, disturbed.seen, strict=True)
    )


def test_the_policy_is_told_the_camera_that_it_sees_through() -> None:
    policy = seeing(Sensor.RGB)
    run(simulated(), policy, "camera_height=-0.2")
    for camera in (policy.tasks[0].robot.camera, *(seen.camera for seen in policy.seen)):
        assert camera.mount_height_m == pytest.approx(SMALL.camera.mount_height_m - 0.2)


class Mover(StandInRobot):
    """Needs 2 s for each action."""

    def drive(self, movement: Drive, watch: Watch | None = None) -> MotionResult:
        return MotionResult(completed=True, duration_s=2.0)


@pytest.mark.parametrize("is_simulated", [True, False])
def test_latency_counts_towards_the_time_limit(is_simulated: bool) -> None:
    limits = ProtocolParameters(max_actions=50, max_time_s=7.0)
    turning = ScriptedPolicy([Action.TURN_LEFT])
    outcome, _ = run(Mover(simulated=is_simulated), turning, parameters=limits)
    assert (outcome.verdict.end_reason, outcome.actions) == (EndReason.TIME_LIMIT, 4)
    outcome, recorder = run(Mover(simulated=is_simulated), turning, "latency=0.4", parameters=limits)
    assert (outcome.verdict.end_reason, outcome.actions) == (EndReason.TIME_LIMIT, 3)
    assert recorder.steps[-1].spent.thinking_s == pytest.approx(1.2, abs=0.2)


def test_latency_delays_decisions_not_the_parts_of_a_chunk() -> None:
    policy = ScriptedPolicy(
        [Chunk((Action.TURN_LEFT, Action.TURN_LEFT, Action.TURN_LEFT)), Action.STOP],  # type: ignore[list-item]
        ModelCard("chunks", action_kinds=frozenset({ActionKind.DISCRETE, ActionKind.CHUNK})),
    )
    _, recorder = run(Mover(), policy, "latency=0.5")
    assert [step.spent.thinking_s for step in recorder.steps] == [0.5, 0.5, 0.5, 1.0]


def test_a_pixel_is_one_of_the_image_that_the_model_saw() -> None:
    pixel = Pixel(80.0, 90.0)
    policy = Seeing(
        [pixel, Action.STOP],  # type: ignore[list-item]
        ModelCard("pixels", sensors=frozenset({Sensor.DEPTH}), action_kinds=frozenset(ActionKind)),
    )
    robot = simulated()
    _, recorder = run(robot, policy, "camera_tilt=-20")
    guard = ProtocolParameters().depth_guard
    seen = waypoint_of(pixel, policy.seen[0], SMALL.base, guard)
    own = waypoint_of(pixel, recorder.steps[0].observation, SMALL.base, guard)
    assert seen is not None
    assert own is not None
    moved_m = recorder.steps[0].site_before.pose.distance_to(recorder.steps[0].site_after.pose)
    assert moved_m == pytest.approx(np.hypot(seen.x_m, seen.y_m), abs=0.03)
    assert abs(np.hypot(own.x_m, own.y_m) - moved_m) > 0.2
