"""Paths that replace each other on a simulated base, in virtual time: orders, silence, faults, the way from rest."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from tests.sensing.stand import Stand
from vsnbench.control.command import STANDSTILL, Command
from vsnbench.sensing.hazards import Hazard
from vsnbench.sensing.path_driver import PathDriver
from vsnbench.sensing.path_orders import SILENT_S, PathEnd, PathOrder, PathState
from vsnbench.values.movement import Drive, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose

AHEAD = Waypoint(3.0, 0.0)


class Caller:
    """Gives orders and repeats them, while the control loop sleeps.

    Args:
        script: yields the seconds until it goes on; between, it may give orders. The test ends with it.
        looks: whether the base may leave rest.
    """

    def __init__(self, script: "Callable[[Caller], Iterator[float]]", *, looks: bool = True, name: str = "one") -> None:
        self.stand = Stand()
        self.stand.mover._send = self.hear
        self.loops: list[Callable[[], None]] = []
        self.driver = PathDriver(self.stand.mover, self.loops.append)
        self.order: PathOrder | None = None
        self.sent: list[tuple[float, Command]] = []
        self.name, self.looks = name, looks
        self.speaks = True
        self.stand.mover._sleep_until = self.sleep_until
        self._script = script(self)
        self._due_s = self.now_s
        self._ended = False
        while not self._ended:
            self.sleep_until(self.now_s + 0.02)
            while self.loops:
                self.loops.pop(0)()
        self.stand.sleep_until(self.now_s + 1.0)

    @property
    def now_s(self) -> float:
        return self.stand.base.now_s

    @property
    def pose(self) -> Pose:
        return self.stand.base.odometry

    @property
    def state(self) -> PathState:
        return self.driver.state

    def hear(self, command: Command) -> None:
        self.sent.append((self.now_s, command))
        self.stand.hear(command)

    def ask(self, task: Drive | PathEnd, origin: Pose | None = None) -> None:
        number = 0 if self.order is None else self.order.number + 1
        self.order = PathOrder(self.name, number, task, origin, 0 if self.order is None else self.order.leaves)

    def sleep_until(self, due_s: float) -> None:
        self.stand.sleep_until(due_s)
        if self.now_s >= self._due_s and not self._ended:
            wait_s = next(self._script, None)
            if wait_s is None:
                self._ended, self.order = True, None
            else:
                self._due_s = self.now_s + wait_s
        if self.order is not None and self.speaks:
            leaves = self.state.asks if self.looks else 0
            self.order = replace(self.order, leaves=leaves)
            self.driver.take(PathOrder.of(self.order.to_json()))


def stopped_after_s(caller: Caller, since_s: float) -> float:
    """Return when the last velocity was commanded, after a time."""
    return max(at_s for at_s, command in caller.sent if command != STANDSTILL) - since_s


def test_a_path_replaces_the_one_before_it_without_a_stop() -> None:
    speeds: list[float] = []

    def script(caller: Caller) -> Iterator[float]:
        start = caller.pose
        for k in range(8):
            caller.ask(AHEAD if k % 2 else Trajectory(((0.5, 0.0), (2.0, 0.0))), start if k % 2 else None)
            yield 0.3
            speeds.append(caller.sent[-1][1].linear_m_s)
        caller.ask(PathEnd.BRAKE)
        yield 1.5
        assert caller.state.waits
        caller.ask(PathEnd.RELEASE)
        yield 0.1

    caller = Caller(script)
    assert min(speeds[3:]) > 0.25
    assert not caller.state.failure
    assert caller.sent[-1][1] == STANDSTILL


def test_a_caller_that_falls_silent_stops_the_base_and_its_path_is_not_driven_later() -> None:
    silent_s, rests = 0.0, Pose(0.0, 0.0)

    def script(caller: Caller) -> Iterator[float]:
        nonlocal silent_s, rests
        caller.ask(AHEAD)
        yield 2.0
        silent_s, caller.speaks = caller.now_s, False
        yield 2.0
        rests, caller.speaks = caller.pose, True
        yield 1.0
        caller.ask(AHEAD)  # it has not noticed yet
        yield 1.0

    caller = Caller(script)
    assert stopped_after_s(caller, silent_s) == pytest.approx(SILENT_S, abs=0.05)
    assert caller.state.failure == "the workstation was silent for 0.6 s"
    assert caller.pose.distance_to(rests) < 0.002


def test_another_episode_drives_after_a_failure() -> None:
    def script(caller: Caller) -> Iterator[float]:
        caller.ask(AHEAD)
        yield 1.0
        caller.stand.mover.take_hazard(Hazard.BUMPER, 0, True, "left")
        yield 0.5
        assert caller.state.failure == "bumper (left)"
        assert caller.sent[-1][1] == STANDSTILL
        caller.stand.mover.take_hazard(Hazard.BUMPER, 0, False, "left")
        caller.name, caller.order = "two", None
        caller.ask(AHEAD)
        yield 1.0
        assert caller.state.caller == "two"
        assert not caller.state.failure
        assert caller.sent[-1][1].linear_m_s > 0.2

    Caller(script)


def test_the_base_leaves_rest_only_after_the_caller_has_looked() -> None:
    def script(caller: Caller) -> Iterator[float]:
        start = caller.pose
        caller.ask(Waypoint(0.0, 1.0))  # to the left: it turns first
        yield 8.0  # longer than it would take to find a base that does not follow
        assert not caller.state.failure
        assert math.degrees(caller.pose.heading_rad - start.heading_rad) == pytest.approx(90, abs=6)
        assert caller.pose.distance_to(start) < 0.005
        assert caller.state.asks == 1
        caller.looks = True
        yield 2.0
        assert caller.pose.distance_to(start) > 0.3

    Caller(script, looks=False)


def test_late_answers_on_a_curve_keep_the_path_that_was_meant_over_orders() -> None:
    """The answers of a model that takes 1 s, in the frame of the capture, are driven from there on."""

    def wave(x_m: float) -> tuple[float, float]:
        return x_m, 0.3 * (1 - math.cos(math.tau * x_m / 2.4))

    def along(pose: Pose, start: Pose) -> Trajectory:
        here = pose.relative_to(start)
        at = (Pose(*wave(here.x_m + 0.05 * k)).relative_to(here).position for k in range(1, 31))
        return Trajectory(tuple(at))

    off_m: list[float] = []

    def script(caller: Caller) -> Iterator[float]:
        start = captured = caller.pose
        answer = along(captured, start)
        for _ in range(12):
            caller.ask(answer, captured)
            captured = caller.pose
            answer = along(captured, start)
            for _ in range(10):
                yield 0.1
                at = caller.stand.base.pose.relative_to(Pose(0.0, 0.0, 0.3)).position
                off_m.append(min(math.dist(at, wave(at[0] + 0.01 * k)) for k in range(-30, 31)))

    Caller(script)
    assert max(off_m) < 0.03


@pytest.mark.parametrize(
    "content",
    [
        None,
        {},
        {"caller": "one", "number": 1},
        {"caller": "one", "number": 1, "end": "fly"},
        {"caller": "one", "number": "1", "end": "stop"},
        {"caller": "one", "number": 1, "movement": {"kind": "move", "distance_m": 1.0, "turn_rad": 0.0}},
        {"caller": "one", "number": 1, "movement": {"kind": "waypoint", "x_m": 1e9, "y_m": 0.0}},
        {"caller": "one", "number": 1, "end": "stop", "origin": [1, 2, 3]},
        {"caller": "one", "number": 1, "end": "stop", "origin": {"x_m": float("nan"), "y_m": 0, "heading_rad": 0}},
    ],
)
def test_a_message_that_is_no_order_is_refused(content: object) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        PathOrder.of(content)


@pytest.mark.parametrize("task", [AHEAD, Trajectory(((0.5, 0.1), (1.0, 0.0))), Velocity(0.2, 0.1, 1.0), PathEnd.BRAKE])
def test_orders_and_states_survive_the_network(task: Drive | PathEnd) -> None:
    order = PathOrder("one", 7, task, Pose(1.0, 2.0, 7.0), 3)
    assert PathOrder.of(order.to_json()) == order
    state = PathState("one", 7, waits=False, remaining_m=0.5, asks=2, failure="stuck", sensor_lost=True)
    assert PathState.of(state.to_json()) == state
