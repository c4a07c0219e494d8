"""Steps with movements: chunks, pixels, kinds that a card does not state, and what is recorded."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

from tests.runner.episode.test_episode import MemoryRecorder
from tests.runner.episode.test_side_guard import PROFILE as SIDE_GUARDED
from tests.runner.stand_ins import NOBODY, PLAN, PROFILE, ScriptedPolicy, StandInRobot
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.parameters import DepthGuard, ProtocolParameters
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.robots.contract import Watch
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.pixel import waypoint_of
from vsnbench.runner.episode.step import Step
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.values.decision import Decision
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import (
    Action,
    ActionKind,
    Chunk,
    Drive,
    Move,
    Movement,
    Pixel,
    Sidestep,
    Velocity,
    Waypoint,
)
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import RobotProfile


class Scripted(Policy):
    """Gives its answers in order, then STOP."""

    def __init__(
        self, *answers: Action | Movement | Chunk, kinds: frozenset[ActionKind] = frozenset(ActionKind)
    ) -> None:
        self.card = ModelCard(name="scripted", sensors=frozenset({Sensor.DEPTH}), action_kinds=kinds)
        self._answers = list(answers)
        self.asked = 0

    def reset(self, goal: str, seed: int) -> None:
        self.asked = 0

    def act(self, observation: Observation) -> Decision:
        self.asked += 1
        return Decision(self._answers.pop(0) if self._answers else Action.STOP)


class Avoiding(SimulatedRobot):
    """A robot whose own obstacle avoidance stops every way."""

    def drive(self, movement: Drive, watch: Watch | None = None) -> MotionResult:
        if isinstance(movement, Move) and movement.distance_m:
            return MotionResult(completed=False, blocked="a person stands there", pose=Pose(0.0, 0.0))
        return super().drive(movement, watch)


def run(
    policy: Policy,
    max_actions: int = 20,
    profile: RobotProfile | None = None,
    start: int = 1,
    kind: type[SimulatedRobot] = SimulatedRobot,
) -> tuple[EpisodeEnd, MemoryRecorder]:
    recorder = MemoryRecorder()
    plan = replace(PLAN, parameters=ProtocolParameters(max_actions=max_actions), start=PLAN.site.starts[start - 1])
    with StopRequests() as stop, kind(plan.site, profile or load_profile("turtlebot2")) as robot:
        return run_episode(robot, policy, plan, recorder, NOBODY, stop), recorder


def test_a_sidestep_is_driven_where_the_camera_has_looked_and_refused_elsewhere() -> None:
    seen = [Action.MOVE_FORWARD] * 4
    _, recorder = run(Scripted(Sidestep(0.2), *seen, Sidestep(0.2)), profile=SIDE_GUARDED, start=3)
    unseen, *_, seen_by_now, _ = recorder.steps
    assert (unseen.blocked, unseen.result) == (True, None)
    assert "to the left" in unseen.refusal
    assert not seen_by_now.blocked, seen_by_now.refusal
    assert seen_by_now.result is not None
    assert seen_by_now.result.displacement_m == pytest.approx(0.2, abs=0.005)
    before, after = seen_by_now.site_before.pose, seen_by_now.site_after.pose
    assert after.relative_to(before).y_m == pytest.approx(0.2, abs=0.005)
    assert seen_by_now.decision.action is Action.SIDESTEP


def test_a_sidestep_on_a_base_that_cannot_is_an_error_of_the_model() -> None:
    outcome, recorder = run(Scripted(Sidestep(0.2)))
    assert (outcome.verdict.end_reason, recorder.steps) == (EndReason.MODEL_ERROR, [])


def test_each_part_of_a_chunk_is_a_step_of_its_own() -> None:
    policy = Scripted(Chunk((Action.TURN_LEFT, Velocity(0.0, 0.4, 1.0), Action.TURN_RIGHT)))
    outcome, recorder = run(policy)
    assert [step.decision.action for step in recorder.steps] == [
        *(Action.TURN_LEFT, Action.VELOCITY, Action.TURN_RIGHT, Action.STOP)
    ]
    assert [step.part for step in recorder.steps] == [(1, 3), (2, 3), (3, 3), None]
    assert (outcome.actions, policy.asked) == (4, 2)
    stamps = [step.observation.stamp_s for step in recorder.steps]
    assert stamps == sorted(set(stamps)), "each part has its own observation"


def test_a_chunk_ends_at_the_cap_of_actions() -> None:
    outcome, recorder = run(Scripted(Chunk((Action.TURN_LEFT,) * 10)), max_actions=4)
    assert (outcome.verdict.end_reason, len(recorder.steps)) == (EndReason.STEP_LIMIT, 4)


def test_a_blocked_part_drops_the_rest_of_its_chunk() -> None:
    policy = Scripted(Chunk((Waypoint(5.0, 0.0), Waypoint(5.0, 0.0), Waypoint(5.0, 0.0), Action.TURN_LEFT)))
    outcome, recorder = run(policy)
    blocked = [step for step in recorder.steps if step.blocked]
    assert len(blocked) == 1
    assert blocked[0].result is not None
    assert not blocked[0].result.completed
    assert recorder.steps[-1].decision.action is Action.STOP
    assert policy.asked == 2
    assert outcome.verdict.end_reason is EndReason.STOP


def test_a_robot_that_avoids_an_obstacle_by_itself_takes_a_blocked_step() -> None:
    outcome, recorder = run(Scripted(Action.MOVE_BACKWARD, Action.TURN_LEFT), kind=Avoiding)
    assert [step.refusal for step in recorder.steps] == ["a person stands there", "", ""]
    assert ("blocked", "a person stands there") in recorder.events
    assert outcome.verdict.end_reason is EndReason.STOP


@pytest.mark.parametrize(
    ("answer", "kinds"),
    [
        (Waypoint(1.0, 0.0), frozenset({ActionKind.DISCRETE})),
        (Chunk((Action.TURN_LEFT,)), frozenset({ActionKind.DISCRETE})),
        (Velocity(0.1, 3.3, 1.0), frozenset(ActionKind)),
        (Velocity(9.0, 0.0, 1.0), frozenset(ActionKind)),
        (Velocity(0.1, 0.0, 1.0, 0.1), frozenset(ActionKind)),
    ],
)
def test_an_answer_outside_of_card_and_base_is_a_model_error(
    answer: Movement | Chunk, kinds: frozenset[ActionKind]
) -> None:
    outcome, recorder = run(Scripted(answer, kinds=kinds))
    assert outcome.verdict.end_reason is EndReason.MODEL_ERROR
    assert recorder.steps == []


def test_a_pixel_of_the_floor_becomes_a_waypoint_and_one_without_depth_is_refused() -> None:
    camera = PROFILE.camera
    depth_m = np.full((48, 64), np.nan, np.float32)
    rays = camera.rays(64, 48)
    floor_row = 40
    depth_m[floor_row - 3 : floor_row + 4] = camera.mount_height_m / -rays.up[floor_row]
    observation = Observation(np.zeros((48, 64, 3), np.uint8), depth_m, Pose(0, 0), 0.0, camera)
    reached = waypoint_of(Pixel(31.5, floor_row), observation, PROFILE.base, DepthGuard())
    assert reached is not None
    assert (reached.x_m, reached.y_m) == pytest.approx(
        (camera.mount_height_m / -rays.up[floor_row] * rays.ahead[floor_row], 0.0), abs=0.03
    )
    for pixel in (Pixel(31.0, 5.0), Pixel(-5.0, 40.0), Pixel(700.0, 40.0)):
        assert waypoint_of(pixel, observation, PROFILE.base, DepthGuard()) is None


def test_a_pixel_without_depth_is_a_blocked_action() -> None:
    outcome, recorder = run(Scripted(Pixel(4000.0, 4000.0)))
    assert recorder.steps[0].blocked
    assert recorder.steps[0].result is None
    assert outcome.actions == 2


def test_an_episodes_last_images_are_freed_with_it_without_a_garbage_collection() -> None:
    images: list[weakref.ref[object]] = []

    class Looking(StandInRobot):
        def observe(self) -> Observation:
            observation = super().observe()
            images.append(weakref.ref(observation.rgb))
            return observation

    class Forgetful(MemoryRecorder):
        def step(self, step: Step) -> None:
            """Keep nothing."""

    gc.disable()
    try:
        with StopRequests() as stop, Looking() as robot:
            run_episode(robot, ScriptedPolicy([Action.TURN_LEFT, Action.STOP]), PLAN, Forgetful(), NOBODY, stop)
        assert [image() is None for image in images] == [True, True]
    finally:
        gc.enable()
