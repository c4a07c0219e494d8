"""A rehearsal in real time, on a patched clock: what movements take, and that a stop interrupts them."""

import time
from unittest.mock import MagicMock

import pytest

from tests.movements import FORWARD, LEFT
from tests.runner.stand_ins import APARTMENT
from tests.simulator.places import turtlebot2
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing.journal import Journal
from vsnbench.robots.rehearsal import RehearsalRobot
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.executors.in_process import InProcessExecutor
from vsnbench.runner.loop.contract import Session
from vsnbench.runner.operator.contract import AbsentOperator, Operator
from vsnbench.runner.operator.terminal import TerminalOperator
from vsnbench.runner.stopping.emergency_key import PRESSED
from vsnbench.runner.stopping.requests import Stopped, StopRequests
from vsnbench.simulator.dynamics import driven_base
from vsnbench.simulator.dynamics.physics import CONTROL_PERIOD_S
from vsnbench.values.movement import Waypoint
from vsnbench.values.robot_profile import BaseDynamics

START = APARTMENT.start(5)
"""With free space ahead."""
STOPPED_AT_PERIOD = 20


class Clock:
    """A clock that advances only by sleeping, as the module `time`."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.sleeps = 0

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        self.now_s += duration_s
        self.sleeps += 1


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    patched = Clock()
    monkeypatch.setattr(driven_base, "time", patched)
    return patched


def placed(dynamics: BaseDynamics | None = None, *, real_time: bool = True) -> RehearsalRobot:
    profile = turtlebot2()
    camera = profile.camera.resized(16, 12)
    robot = RehearsalRobot(APARTMENT, profile.model_copy(update={"camera": camera, "dynamics": dynamics}))
    if real_time:
        robot.keep_real_time()
    robot.simulate_placement(START, 1)
    robot.begin(START, 1)
    return robot


@pytest.mark.parametrize("dynamics", [None, BaseDynamics(dead_time_s=0.1)], ids=["ideal", "late"])
def test_movements_take_as_long_as_on_the_robot_also_after_pauses(clock: Clock, dynamics: BaseDynamics | None) -> None:
    robot = placed(dynamics)
    for move in (
        lambda: robot.drive(LEFT),
        lambda: robot.drive(FORWARD),
        lambda: robot.drive(Waypoint(0.2, 0.0), lambda _view: ""),
    ):
        clock.now_s += 5.0  # the model thinks: what follows must not catch up
        began_s = clock.now_s
        result = move()
        assert result.duration_s > 0.3
        assert clock.now_s - began_s == pytest.approx(result.duration_s, abs=1.5 * CONTROL_PERIOD_S)


def test_slow_computation_counts_as_time_of_the_movement(clock: Clock) -> None:
    robot, began_s = placed(), clock.now_s

    def look(_view: object) -> str:
        clock.now_s += 0.015
        return ""

    result = robot.drive(Waypoint(0.2, 0.0), look)
    assert clock.now_s - began_s == pytest.approx(result.duration_s, abs=1.5 * CONTROL_PERIOD_S)


def test_a_stop_interrupts_the_movement_while_it_waits(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    robot, slept = placed(), clock.sleep
    with StopRequests() as stop:

        def sleep(duration_s: float) -> None:
            slept(duration_s)
            if clock.sleeps == STOPPED_AT_PERIOD:
                stop.ask(PRESSED)
                time.sleep(30)  # the signal of the request ends it

        monkeypatch.setattr(clock, "sleep", sleep)
        with pytest.raises(Stopped), stop.interruptible():
            robot.drive(FORWARD)
    motion = robot.interrupted_motion()
    assert motion is not None
    assert motion.duration_s == pytest.approx((STOPPED_AT_PERIOD - 1) * CONTROL_PERIOD_S)
    assert 0 < motion.displacement_m < 0.25


def test_only_an_operator_makes_it_real_time(clock: Clock) -> None:
    class Person(AbsentOperator):
        is_present = True

    def waits(operator: Operator) -> bool:
        robot = placed(real_time=False)
        executor = InProcessExecutor(robot, None)  # type: ignore[arg-type]  # no trial is run
        executor.session_begins(
            Session(
                journal=MagicMock(spec=Journal),
                robots=executor,
                recording=RecordingOptions(ResultsDirectory.locate()),
                site=APARTMENT,
                parameters=ProtocolParameters(),
                operator=operator,
            )
        )
        before = clock.sleeps
        robot.drive(LEFT)
        return clock.sleeps > before

    assert TerminalOperator.is_present
    assert waits(Person())
    assert not waits(AbsentOperator())
