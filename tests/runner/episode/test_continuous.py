"""Episodes in which the robot drives on while the model thinks."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import pytest

from tests.robots.test_simulated_drive import ROOM
from tests.sensing.stand import LEGGED
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.protocol.execution import Execution
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.writing.entries import EpisodeBegin, EpisodeEnd
from vsnbench.robots.contract import Watch
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runner.operator.contract import AbsentOperator
from vsnbench.runner.stopping.requests import Ends, StopAuthor, StopRequest, StopRequests
from vsnbench.sites.site import Site
from vsnbench.values.decision import Decision
from vsnbench.values.fix import Fix
from vsnbench.values.model.card import Anchor
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action, ActionKind, Movement, Pixel, Trajectory, Velocity, Waypoint
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import RobotProfile

TURTLEBOT = load_profile("turtlebot2")
WAVE_M, AMPLITUDE_M = 2.4, 0.3
LANE = ROOM.model_copy(
    update={
        "objects": [
            type(ROOM)
            .model_validate(
                {
                    **ROOM.content(),
                    "objects": [{"id": "seat", "category": "chair", "position": [2.5, 2.5], "size_m": [0.4, 0.4, 0.9]}],
                }
            )
            .objects[0]
        ],
        "starts": [ROOM.starts[0].model_copy(update={"position": (-2.0, 0.0)})],
    }
)
"""The empty room with a chair in a corner."""


@dataclass
class Answers(Policy):
    """Answers what a function returns for the number and the observation of a call."""

    answer: Callable[[int, Observation], Movement | Action]
    anchor: Anchor = Anchor.CAPTURE
    calls: int = 0

    def __post_init__(self) -> None:
        kinds = frozenset(ActionKind) - {ActionKind.CHUNK}
        self.card = ModelCard(
            "answers", sensors=frozenset({Sensor.ODOMETRY, Sensor.DEPTH}), action_kinds=kinds, anchor=self.anchor
        )

    def reset(self, goal: str, seed: int) -> None:
        self.calls = 0

    def act(self, observation: Observation) -> Decision:
        self.calls += 1
        return Decision(self.answer(self.calls, observation))  # type: ignore[arg-type]


@dataclass
class Record:
    """Keeps what an episode records."""

    steps: list[Step] = field(default_factory=list)
    events: list[tuple[str, str]] = field(default_factory=list)
    outcome: EpisodeEnd | None = None

    def kept_photo(self, plan: EpisodePlan) -> bytes | None:
        return None

    def begin(self, plan: EpisodePlan, start: Fix, begin: EpisodeBegin, view_jpeg: bytes | None = None) -> None:
        pass

    def step(self, step: Step) -> None:
        self.steps.append(step)

    def event(self, kind: str, text: str) -> None:
        self.events.append((kind, text))

    def intervention(self, what: str, author: str = "") -> None:
        self.events.append(("intervention", what))

    def end(self, outcome: EpisodeEnd) -> None:
        self.outcome = outcome


def ran(
    policy: Policy,
    latency_s: float | None,
    *,
    max_actions: int = 150,
    site: Site = LANE,
    stop: StopRequests | None = None,
    profile: RobotProfile = TURTLEBOT,
    **execution: float,
) -> tuple[Record, SimulatedRobot]:
    camera = profile.camera.model_copy(update={"width": 160, "height": 120})
    parameters = ProtocolParameters(max_actions=max_actions).executed(Execution(latency_s=latency_s, **execution))
    robot = SimulatedRobot(
        site,
        profile.model_copy(update={"camera": camera}),
        parameters,
        read=frozenset({Sensor.DEPTH, *([Sensor.RGB] if "frames_hz" in execution else [])}),
    )
    record = Record()
    plan = EpisodePlan(site, "chair", site.starts[0], 7, parameters)
    run_episode(robot, policy, plan, record, AbsentOperator(), stop or StopRequests())
    return record, robot


class DrivenByStack(SimulatedRobot):
    """A simulated robot that a stack drives straight ahead, as one over ROS."""

    def advance(self, until_s: float, watch: Watch | None = None) -> MotionResult:
        self.follow(Velocity(0.3, duration_s=5.0))
        return super().advance(until_s, watch)


@pytest.mark.parametrize("guarded", [True, False])
def test_the_guard_ends_the_trial_of_a_stack_before_an_obstacle(guarded: bool) -> None:
    parameters = ProtocolParameters().driven_by_stack(guarded=guarded)
    camera = TURTLEBOT.camera.model_copy(update={"width": 160, "height": 120})
    robot = DrivenByStack(
        LANE, TURTLEBOT.model_copy(update={"camera": camera}), parameters, read=frozenset({Sensor.DEPTH, Sensor.RGB})
    )
    stack, record = Answers(lambda _number, _seen: Action.NOOP), Record()
    run_episode(
        robot,
        stack,
        EpisodePlan(LANE, "chair", LANE.starts[0], 7, parameters),
        record,
        AbsentOperator(),
        StopRequests(),
    )
    assert record.outcome is not None
    last = record.steps[-1].result
    assert last is not None
    if not guarded:
        assert record.outcome.verdict.end_reason is EndReason.COLLISION
        return
    assert record.outcome.verdict.end_reason is EndReason.MODEL_ERROR
    assert record.outcome.verdict.success is None
    assert "the depth guard stopped the robot that the stack drove: obstacle" in record.outcome.error
    assert last.collision is None
    assert record.steps[-1].guard is not None
    assert record.steps[-1].blocked


def wave(x_m: float) -> tuple[float, float]:
    return x_m, AMPLITUDE_M * (1 - math.cos(math.tau * x_m / WAVE_M))


def along_the_wave(number: int, observation: Observation) -> Movement | Action:
    """Answer with the next 1.5 m of a curve, seen from where the image was captured."""
    pose = observation.pose
    if pose.x_m > 3.0:
        return Action.STOP
    points = (Pose(*wave(pose.x_m + 0.05 * k)).relative_to(pose).position for k in range(1, 31))
    return Trajectory(tuple(points))


def off_the_wave_m(step: Step) -> float:
    pose = step.site_after.pose
    return min(math.dist((pose.x_m + 2.0, pose.y_m), wave(pose.x_m + 2.0 + 0.01 * k)) for k in range(-30, 31))


@pytest.mark.parametrize(("anchor", "holds"), [(Anchor.CAPTURE, True), (Anchor.ARRIVAL, False)])
def test_late_answers_stay_on_the_curve_that_was_meant_if_they_are_anchored(anchor: Anchor, holds: bool) -> None:
    record, _ = ran(Answers(along_the_wave, anchor), 1.0, max_actions=8)
    assert len(record.steps) > 6
    assert (max(map(off_the_wave_m, record.steps)) < 0.03) is holds


def test_a_step_is_one_answer_with_its_times_and_what_was_driven_until_the_next() -> None:
    record, robot = ran(Answers(lambda n, _: Action.STOP if n == 5 else Waypoint(3.0, 0.0)), 0.5)
    steps = record.steps
    assert [step.index for step in steps] == [1, 2, 3, 4, 5]
    assert [round(step.observation.stamp_s, 2) for step in steps] == [0.0, 0.5, 1.0, 1.5, 2.0]
    first, last = steps[0].result, steps[-1].result
    assert first is not None
    assert last is not None
    assert first.waiting_s == pytest.approx(0.5, abs=0.03)
    for step, following in pairwise(steps):
        assert step.answer is not None
        assert step.answer.age_s == pytest.approx(0.5, abs=0.02)
        assert step.answer.until_s == pytest.approx(following.observation.stamp_s + 0.5, abs=0.02)
        assert step.site_after == following.site_before
    assert sum(step.result.duration_s for step in steps if step.result) == pytest.approx(steps[-1].ended_s)
    assert last.path_m == pytest.approx(0.3**2 / (2 * 0.54), abs=0.02), "STOP brakes, and the overshoot is measured"
    assert record.outcome is not None
    assert record.outcome.verdict.end_reason is EndReason.STOP
    assert record.outcome.final == robot.locate()


def test_the_robot_is_faster_without_stops_and_the_same_run_gives_the_same_bits() -> None:
    ends = []
    for _ in range(2):
        record, robot = ran(Answers(lambda n, _: Action.STOP if n == 12 else Waypoint(1.0, 0.1)), 0.3)
        ends.append([(step.site_after, step.answer, step.result) for step in record.steps])
    assert ends[0] == ends[1]
    assert robot.locate().pose.x_m > -2.0 + 0.3 * 12 * 0.3 * 0.7


def test_frames_between_the_answers_are_taken_at_their_rate_and_change_nothing() -> None:
    def driven(**execution: float) -> Record:
        return ran(Answers(lambda n, _: Action.STOP if n == 6 else Waypoint(1.0, 0.3)), 0.3, **execution)[0]

    without, record = driven(), driven(frames_hz=8.0)
    assert not any(step.frames for step in without.steps)
    assert [step.site_after for step in record.steps] == [step.site_after for step in without.steps]
    frames = [frame for step in record.steps for frame in step.frames]
    stamps_s = [frame.stamp_s for frame in frames]
    assert len(frames) >= 8
    assert all(b - a == pytest.approx(1 / 8, abs=0.021) for a, b in pairwise(stamps_s))
    for step in record.steps:
        assert step.answer is not None
        assert all(frame.stamp_s <= step.answer.until_s + 0.01 for frame in step.frames)
    assert frames[-1].pose.x_m > frames[0].pose.x_m
    assert frames[-1].rgb.shape == (120, 160, 3)


def test_an_answer_that_is_too_old_is_dropped_and_the_robot_drives_on() -> None:
    policy = Answers(lambda n, _: Waypoint(3.0, 0.0) if n == 1 else Action.STOP if n == 4 else Waypoint(-3.0, 0.0))
    clock = [0.1, 0.9, 0.9, 0.1]
    with pytest.MonkeyPatch.context() as patch:
        take_time(patch, clock)
        record, _ = ran(policy, None, max_answer_age_s=0.5)
    assert [step.answer.stale for step in record.steps if step.answer] == [False, True, True, False]
    assert [kind for kind, _ in record.events] == ["stale", "stale"]
    assert record.steps[2].site_after.pose.x_m > record.steps[0].site_after.pose.x_m + 0.3


def test_a_model_of_five_waypoints_at_4_hz_drives_without_waiting() -> None:
    """GNM, ViNT and NoMaD predict 5 waypoints, 0.05 m apart at full speed (0.2 m/s), 4 times a second."""
    ahead = Trajectory(tuple(Pose(0.05 * k, 0.002 * k * k).position for k in range(1, 6)))
    with pytest.MonkeyPatch.context() as patch:
        take_time(patch, [0.25] * 18)
        record, robot = ran(Answers(lambda n, _: Action.STOP if n == 18 else ahead), None, max_rate_hz=4.0)
    driven = record.steps[1:-1]
    assert len(driven) == 16
    for step in driven:
        assert step.answer is not None
        assert step.result is not None
        assert step.answer.age_s == pytest.approx(0.25, abs=0.021)
        assert step.result.duration_s == pytest.approx(0.25, abs=0.021)
        assert step.result.waiting_s == 0.0
        assert not step.refusal
    assert sum(step.result.path_m or 0.0 for step in driven if step.result) > 0.2 * 0.25 * 16
    assert robot.locate().pose.y_m > 0.1, "to the left, as the waypoints lead"


def test_answers_at_200_hz_are_asked_for_at_the_maximum_rate() -> None:
    with pytest.MonkeyPatch.context() as patch:
        take_time(patch, [0.005] * 20)
        record, _ = ran(Answers(lambda n, _: Action.STOP if n == 20 else Waypoint(2.0, 0.0)), None)
    stamps_s = [step.observation.stamp_s for step in record.steps[1:]]
    assert all(b - a == pytest.approx(0.1, abs=0.021) for a, b in pairwise(stamps_s))


def take_time(patch: pytest.MonkeyPatch, seconds: list[float]) -> None:
    """Let the model's calls take as long as listed."""
    from vsnbench.runner.episode import continuous

    passed, calls = [0.0], iter(seconds)

    def act(self: object, observation: Observation, budget: object = None) -> Decision:
        passed[0] += next(calls)
        return original(self, observation, budget)  # type: ignore[arg-type]

    original = continuous.PolicyCalls.act
    patch.setattr(continuous.PolicyCalls, "act", act)
    patch.setattr(continuous.time, "perf_counter", lambda: passed[0])


def test_a_continuous_episode_ends_by_its_time_and_not_by_its_number_of_answers() -> None:
    record, _ = ran(Answers(lambda _n, _o: Velocity(0.0, 0.3, 1.0)), 0.1, max_actions=2)
    assert record.outcome is not None
    assert record.outcome.verdict.end_reason is EndReason.TIME_LIMIT
    assert record.outcome.actions > 20
    assert record.steps[-1].ended_s == pytest.approx(4.7, abs=0.2), "it brakes, and is at rest"


def test_a_velocity_to_a_side_that_was_not_seen_is_refused_and_ends_the_path_before_it() -> None:
    answers = {1: Velocity(0.3, 0.0, 2.0), 2: Velocity(0.0, 0.0, 2.0, 0.25)}
    record, robot = ran(Answers(lambda n, _: answers.get(n, Action.STOP)), 0.5, profile=LEGGED)
    first, aside = record.steps[:2]
    assert first.result is not None
    assert not first.result.blocked
    assert "left" in aside.refusal
    assert robot.locate().pose.y_m == pytest.approx(0.0, abs=0.02)
    assert robot.locate().pose.x_m < -1.6, "half a second at 0.3 m/s, and a brake"


def test_a_model_that_fails_while_the_robot_drives_leaves_it_at_rest_with_what_was_driven() -> None:
    def fail(number: int, _observation: Observation) -> Movement:
        if number == 4:
            raise RuntimeError("out of memory")
        return Waypoint(3.0, 0.0)

    record, robot = ran(Answers(fail), 0.5)
    assert record.outcome is not None
    assert record.outcome.verdict.end_reason is EndReason.MODEL_ERROR
    assert len(record.steps) == 3
    at_rest = robot.locate().pose
    assert record.steps[-1].site_after.pose == at_rest
    robot.advance(record.steps[-1].ended_s + 1.0)
    assert robot.locate().pose.distance_to(at_rest) < 0.002


def test_a_request_to_stop_brakes_the_robot_and_keeps_what_was_driven() -> None:
    stop = StopRequests()
    person = StopRequest(StopAuthor.PERSON, "the page", ends=Ends.EPISODE)

    def ask(number: int, _observation: Observation) -> Movement:
        if number == 4:
            stop.ask(person)
        return Waypoint(3.0, 0.0)

    record, _ = ran(Answers(ask), 0.5, stop=stop)
    assert record.outcome is not None
    assert record.outcome.verdict.end_reason is EndReason.ABORTED
    last = record.steps[-1].result
    assert last is not None
    assert not last.completed
    assert last.failure == person.description
    assert [step.index for step in record.steps] == [1, 2, 3]


@pytest.mark.parametrize("answer", [Action.MOVE_FORWARD, Action.NOOP])
def test_an_action_from_rest_to_rest_is_an_error_of_the_model(answer: Action) -> None:
    record, _ = ran(Answers(lambda _n, _o: answer), 0.3)
    assert record.outcome is not None
    assert record.outcome.verdict.end_reason is EndReason.MODEL_ERROR
    assert answer.value in record.outcome.error


def test_a_pixel_becomes_a_waypoint_through_the_depth_of_its_image() -> None:
    record, robot = ran(Answers(lambda n, _: Action.STOP if n == 8 else Pixel(80, 110)), 0.3)
    assert robot.locate().pose.x_m > -1.9
    assert not any(step.refusal for step in record.steps)


def test_a_robot_does_not_turn_into_a_corner_that_was_never_in_its_view() -> None:
    turn = Velocity(0.2, 0.5, 1.0)
    corner = {"id": "corner", "category": "box", "position": [-1.8, 0.3], "size_m": [0.06, 0.06, 1.0]}
    site = Site.model_validate(LANE.content() | {"objects": [*LANE.content()["objects"], corner]})
    record, _ = ran(Answers(lambda n, _: Action.STOP if n == 12 else turn), 0.3, site=site)
    assert record.outcome is not None
    assert record.outcome.verdict.end_reason is EndReason.STOP
    refused = [step for step in record.steps if step.blocked]
    assert refused
    assert all(step.guard is not None and step.guard.side == "left" for step in refused)


def test_a_stop_in_front_of_a_wall_is_blocked_and_the_model_is_asked_again() -> None:
    record, _ = ran(Answers(lambda n, _: Action.STOP if n == 40 else Waypoint(4.0, 0.0)), 0.5)
    blocked = [step for step in record.steps if step.blocked]
    assert blocked
    assert blocked[0].guard is not None
    assert blocked[0].guard.blocked
    assert [kind for kind, _ in record.events].count("blocked") == len(blocked)
    assert not any(step.result.collision for step in record.steps if step.result)
    assert replace(record.steps[-1]).decision.action is Action.STOP
