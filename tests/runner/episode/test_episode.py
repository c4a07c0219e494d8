"""The episode loop: order of calls, all end reasons, and a robot that is always halted.

The robot here is a stand-in whose faults are scripted; real episodes are driven in tests/cli/running/test_run.py.
"""

import os
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest

from tests.runner.stand_ins import APARTMENT, NOBODY, PLAN, PROFILE, ScriptedPolicy, StandInRobot
from vsnbench.errors import NotPlacedError, RecordError, RobotError, SensorLostError
from vsnbench.protocol.judge import EndReason
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.writing.entries import EpisodeBegin, EpisodeEnd
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runner.operator.contract import AbsentOperator
from vsnbench.runner.operator.placing import Placing
from vsnbench.runner.stopping.emergency_key import PRESSED
from vsnbench.runner.stopping.requests import Stopped, StopRequests
from vsnbench.sites.site import Site, StartingPosition
from vsnbench.values.battery import Battery
from vsnbench.values.fix import Fix
from vsnbench.values.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base


@dataclass
class MemoryRecorder:
    """Keeps all recorded data in lists."""

    steps: list[Step] = field(default_factory=list)
    events: list[tuple[str, str]] = field(default_factory=list)
    interventions: list[str] = field(default_factory=list)
    outcome: EpisodeEnd | None = None
    on_step: Callable[[Step], None] = lambda _step: None

    def kept_photo(self, plan: EpisodePlan) -> bytes | None:
        return None

    def begin(self, plan: EpisodePlan, start: Fix, begin: EpisodeBegin, view_jpeg: bytes | None = None) -> None:
        assert not self.steps

    def step(self, step: Step) -> None:
        self.on_step(step)
        self.steps.append(step)

    def event(self, kind: str, text: str) -> None:
        self.events.append((kind, text))

    def intervention(self, what: str, author: str = "") -> None:
        self.interventions.append(what)

    def end(self, outcome: EpisodeEnd) -> None:
        assert self.outcome is None
        self.outcome = outcome


def run(
    robot: StandInRobot, script: list[Action | Exception], recorder: MemoryRecorder, plan: EpisodePlan = PLAN
) -> EpisodeEnd:
    with StopRequests() as stop:
        return run_episode(robot, ScriptedPolicy(script), plan, recorder, NOBODY, stop)


def test_the_robot_begins_at_the_start_with_the_seed_of_the_trial() -> None:
    robot = StandInRobot()
    run(robot, [Action.STOP], MemoryRecorder())
    assert robot.begun_with == (1, 7)


def test_the_battery_is_recorded_at_the_begin_and_if_it_changed_at_the_end() -> None:
    def events(*shares: float) -> list[tuple[str, str]]:
        reports = [Battery(share) for share in shares]

        class WithBattery(StandInRobot):
            @property
            def battery(self) -> Battery | None:
                return reports.pop(0) if reports else None

        recorder = MemoryRecorder()
        run(WithBattery(), [Action.STOP], recorder)
        return recorder.events

    assert events(0.84, 0.71) == [("battery", "84%"), ("battery", "71%")]
    assert events(0.84, 0.84) == [("battery", "84%")]
    assert events() == []


def test_stop_ends_the_episode_and_is_counted_recorded_and_judged() -> None:
    recorder = MemoryRecorder()
    outcome = run(StandInRobot(), [Action.TURN_LEFT, Action.STOP], recorder)
    assert [step.decision.action for step in recorder.steps] == [Action.TURN_LEFT, Action.STOP]
    assert (outcome.actions, outcome.verdict.end_reason) == (2, EndReason.STOP)
    assert recorder.outcome is outcome


def test_stop_near_the_goal_succeeds_and_away_from_it_fails() -> None:
    chair = APARTMENT.instances("chair")[0]
    next_to_chair = replace(PLAN, start=StartingPosition(number=9, position=chair.position, heading_deg=0))
    away = replace(PLAN, start=StartingPosition(number=9, position=(100, 100), heading_deg=0))
    assert run(StandInRobot(), [Action.STOP], MemoryRecorder(), next_to_chair).verdict.success is True
    assert run(StandInRobot(), [Action.STOP], MemoryRecorder(), away).verdict.success is False


def test_the_cap_ends_the_episode() -> None:
    recorder = MemoryRecorder()
    outcome = run(StandInRobot(), [Action.TURN_LEFT], recorder)
    assert (outcome.actions, outcome.verdict.end_reason) == (6, EndReason.STEP_LIMIT)
    assert len(recorder.steps) == 6


def test_a_refused_forward_move_is_counted_and_not_executed() -> None:
    robot, recorder = StandInRobot(depth_m=0.3), MemoryRecorder()
    run(robot, [Action.MOVE_FORWARD, Action.MOVE_BACKWARD, Action.STOP], recorder)
    assert robot.executed == [Action.MOVE_BACKWARD, Action.STOP]
    assert [step.blocked for step in recorder.steps] == [True, False, False]
    assert recorder.steps[0].result is None
    assert recorder.events[0] == ("blocked", recorder.steps[0].refusal)


def test_a_noop_is_recorded_and_never_reaches_the_robot() -> None:
    robot, recorder = StandInRobot(), MemoryRecorder()
    outcome = run(robot, [Action.NOOP, Action.TURN_LEFT, Action.STOP], recorder)
    assert robot.executed == [Action.TURN_LEFT, Action.STOP]
    assert outcome.actions == 3
    still = recorder.steps[0]
    assert still.result == MotionResult(completed=True)
    assert still.site_before == still.site_after
    assert not still.blocked


def test_a_collision_ends_the_episode_at_its_step() -> None:
    hit = MotionResult(completed=False, collision=Collision(CollisionSource.BUMPER, "sofa-1"))
    recorder = MemoryRecorder()
    outcome = run(StandInRobot(on_execute=lambda _action: hit), [Action.MOVE_FORWARD], recorder)
    assert (outcome.verdict.end_reason, outcome.verdict.success, outcome.actions) == (EndReason.COLLISION, False, 1)
    assert recorder.steps[-1].result is hit


def fail_with(error: Exception) -> Callable[[object], MotionResult]:
    def fail(_what: object) -> MotionResult:
        raise error

    return fail


def lose_the_camera(look: int) -> None:
    if look == 2:
        raise SensorLostError("camera silent for 2.0 s")


@pytest.mark.parametrize(
    ("robot", "script", "reason", "steps", "word"),
    [
        (StandInRobot(on_observe=lose_the_camera), [Action.TURN_LEFT], EndReason.SENSOR_LOST, 1, "camera silent"),
        (
            StandInRobot(on_execute=fail_with(RobotError("wedged"))),
            [Action.TURN_LEFT],
            EndReason.MOTION_FAILED,
            0,
            "wedged",
        ),
        (
            StandInRobot(on_execute=lambda _action: MotionResult(completed=False, failure="stalled")),
            [Action.TURN_LEFT],
            EndReason.MOTION_FAILED,
            1,
            "stalled",
        ),
        (
            StandInRobot(),
            [Action.TURN_LEFT, ZeroDivisionError("oh")],
            EndReason.MODEL_ERROR,
            1,
            "ZeroDivisionError: oh",
        ),
    ],
    ids=["sensor", "base gone", "motion refused", "model"],
)
def test_a_fault_voids_the_episode_and_keeps_the_steps_before_it(
    robot: StandInRobot, script: list[Action | Exception], reason: EndReason, steps: int, word: str
) -> None:
    recorder = MemoryRecorder()
    outcome = run(robot, script, recorder)
    assert (outcome.verdict.end_reason, outcome.verdict.success) == (reason, None)
    assert len(recorder.steps) == steps
    assert word in outcome.error
    assert robot.halts


@pytest.mark.parametrize(
    ("number", "reason"), [(signal.SIGINT, EndReason.ABORTED), (signal.SIGTERM, EndReason.INTERRUPTED)]
)
def test_a_signal_during_a_motion_halts_the_robot_and_is_recorded(number: signal.Signals, reason: EndReason) -> None:
    def signalled(_action: Action) -> MotionResult:
        os.kill(os.getpid(), number)
        return MotionResult(completed=True)

    robot, recorder = StandInRobot(on_execute=signalled), MemoryRecorder()
    with pytest.raises(Stopped):
        run(robot, [Action.TURN_LEFT], recorder)
    assert recorder.outcome is not None
    assert recorder.outcome.verdict.end_reason is reason
    assert recorder.interventions == [], "a simulated robot needs no operator"
    assert robot.halts


@pytest.mark.parametrize(("number", "told"), [(signal.SIGINT, ["stopped with Ctrl-C"]), (signal.SIGTERM, [])])
def test_a_person_who_stops_a_real_robot_intervenes(number: signal.Signals, told: list[str]) -> None:
    recorder = MemoryRecorder(on_step=lambda _step: os.kill(os.getpid(), number))
    with pytest.raises(Stopped):
        run(StandInRobot(simulated=False), [Action.TURN_LEFT], recorder)
    assert recorder.interventions == told


def test_a_signal_while_a_step_is_written_waits_for_the_commit() -> None:
    recorder = MemoryRecorder(on_step=lambda _step: os.kill(os.getpid(), signal.SIGINT))
    with pytest.raises(Stopped):
        run(StandInRobot(), [Action.TURN_LEFT], recorder)
    assert len(recorder.steps) == 1
    assert recorder.outcome is not None
    assert recorder.outcome.actions == 1


def test_a_write_error_halts_the_robot_and_ends_the_run() -> None:
    def full(_step: Step) -> None:
        raise RecordError("disk full")

    robot = StandInRobot()
    with pytest.raises(RecordError, match="disk full"):
        run(robot, [Action.TURN_LEFT], MemoryRecorder(on_step=full))
    assert robot.halts
    assert len(robot.executed) == 1


def test_an_attempt_that_cannot_begin_is_void_with_its_reason() -> None:
    class Blocked(StandInRobot):
        def begin(self, start: StartingPosition, seed: int) -> None:
            raise RobotError("starting position 1 touches sofa-1")

    robot, recorder = Blocked(), MemoryRecorder()
    outcome = run(robot, [Action.STOP], recorder)
    assert recorder.outcome is outcome
    assert (outcome.verdict.end_reason, outcome.verdict.success) == (EndReason.MOTION_FAILED, None)
    assert outcome.error == "could not begin: starting position 1 touches sofa-1"
    assert (outcome.actions, outcome.began, recorder.steps) == (0, False, [])
    assert robot.halts


def test_an_operator_places_the_robot_until_it_can_begin() -> None:
    asked: list[tuple[int, str]] = []

    class ByHand(StandInRobot):
        needs_operator = True

        def begin(self, start: StartingPosition, seed: int) -> None:
            if len(asked) < 3:
                raise NotPlacedError(f"wheel drop {len(asked)}")
            super().begin(start, seed)

    class Person(AbsentOperator):
        def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
            asked.append((start.number, problem))

    with StopRequests() as stop:
        plan = replace(PLAN, start=APARTMENT.starts[3])
        run_episode(ByHand(), ScriptedPolicy([Action.STOP]), plan, MemoryRecorder(), Person(), stop)
    assert asked == [(4, ""), (4, "wheel drop 1"), (4, "wheel drop 2")]


def test_an_unattended_robot_that_is_not_placed_cannot_begin() -> None:
    class ByHand(StandInRobot):
        needs_operator = True

        def begin(self, start: StartingPosition, seed: int) -> None:
            raise NotPlacedError("the base still reports: wheel drop")

    outcome = run(ByHand(), [Action.STOP], MemoryRecorder())
    assert outcome.error == (
        "could not begin: starting position 1: the base still reports: wheel drop, and the run is unattended"
    )


def test_a_request_to_end_the_episode_does_not_end_the_session() -> None:
    robot, recorder = StandInRobot(simulated=False), MemoryRecorder()
    with StopRequests() as stop:

        def press(_action: Action) -> MotionResult:
            pressing = threading.Thread(target=stop.ask, args=(PRESSED,))
            pressing.start()
            pressing.join(30)
            return MotionResult(completed=True)

        robot.on_execute = press
        outcome = run_episode(robot, ScriptedPolicy([Action.TURN_LEFT]), PLAN, recorder, NOBODY, stop)
        stop.episode_is_over()
        with stop.interruptible():
            pass
    assert outcome.verdict.end_reason is EndReason.ABORTED
    assert recorder.interventions == ["stopped with the emergency stop key"]
    assert robot.halts


def test_a_verdict_on_a_real_robot_is_only_proposed() -> None:
    assert run(StandInRobot(simulated=False), [Action.STOP], MemoryRecorder()).proposed
    assert not run(StandInRobot(), [Action.STOP], MemoryRecorder()).proposed


def test_a_policy_that_needs_the_survey_gets_site_start_and_base() -> None:
    @dataclass
    class Surveyed(ScriptedPolicy):
        needs_survey = True
        told: tuple[str, Pose, Base, ProtocolParameters] | None = None

        def survey(self, site: Site, start: Pose, base: Base, parameters: ProtocolParameters) -> None:
            self.told = (site.name, start, base, parameters)

    policy = Surveyed([Action.STOP])
    with StopRequests() as stop:
        run_episode(StandInRobot(), policy, PLAN, MemoryRecorder(), NOBODY, stop)
    assert policy.told == ("apartment", PLAN.start.pose, PROFILE.base, PLAN.parameters)
