"""A robot over ROS that drives on, in virtual time: guard and faults while the model thinks, motion without gaps.

The mover, its base, the follower of paths and the watch are the real ones; the network is not there, and the clock is
that of the base.
"""

import math
import threading
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.robots.ros.test_leaning_camera import profile_of
from tests.sensing.stand import Stand
from vsnbench.control.command import STANDSTILL, Command
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.contract import DrivingView
from vsnbench.robots.ros import movement_runner, path_looks, path_runner
from vsnbench.robots.ros.camera import RosCamera
from vsnbench.robots.ros.movement_runner import MovementRunner
from vsnbench.robots.ros.path_looks import PathLooks
from vsnbench.robots.ros.path_runner import PathRunner
from vsnbench.ros.ros2.interface import ros2_interface
from vsnbench.runner.episode.path_guard import PathGuard
from vsnbench.sensing import robot_reports
from vsnbench.sensing.path_driver import PathDriver
from vsnbench.sensing.path_orders import PathOrder, PathState
from vsnbench.sensing.robot_reports import RobotReports, RobotSnapshot
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Trajectory, Waypoint
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import IDEAL_BASE, BaseDynamics

PROFILE = profile_of(None)
IMAGE_DELAY_S = 0.05
START = Pose(0.0, 0.0, 0.3)
AHEAD = Waypoint(4.0, 0.0)
NOW = -math.inf
"""`advance` until then returns at once."""


class Link:
    """What a link has, for a base in this process; images of a wall across the way of the robot."""

    has_labels = False
    image_turns = 0
    others_drive = False

    def __init__(self, speed_m_s: float, dynamics: BaseDynamics) -> None:
        self.names = ros2_interface(PROFILE)
        speeds = PROFILE.speeds.model_copy(update={"linear_m_s": speed_m_s})
        base = PROFILE.base.model_copy(update={"max_linear_m_s": 0.6})
        self.profile = PROFILE.model_copy(update={"speeds": speeds, "base": base})
        self.stand = Stand(dynamics, profile=self.profile)
        self.reports = RobotReports(PROFILE)
        self.loops: list[Callable[[], None]] = []
        self.driver = PathDriver(self.stand.mover, self.loops.append)
        self.stand.mover._send = self.steer
        self.holding = False
        self.sent: list[tuple[float, Command]] = []

    @property
    def now_s(self) -> float:
        return self.stand.base.now_s

    def steer(self, command: Command) -> None:
        command = STANDSTILL if self.holding else command
        self.sent.append((self.now_s, command))
        self.stand.hear(command)
        self.reports.take_own_command()

    def snapshot(self) -> RobotSnapshot:
        return self.reports.snapshot()

    def wait_for(self, condition: Callable[[RobotSnapshot], Any], _timeout_s: float) -> Any:
        return condition(self.snapshot())

    def image(self, payload: Any) -> Any:
        return payload

    def order_path(self, order: PathOrder) -> None:
        self.driver.take(PathOrder.of(order.to_json()))

    @property
    def path_state(self) -> PathState:
        return PathState.of(self.driver.state.to_json())

    def hold_still(self) -> None:
        self.holding = True
        self.stand_still()

    def stand_still(self) -> None:
        self.steer(STANDSTILL)

    def release(self) -> None:
        self.holding = False

    def drive(self, *_: Any) -> bool:
        return True


class Rig:
    """A robot that drives on while a script waits, as the runner does while a model thinks."""

    def __init__(self, patch: pytest.MonkeyPatch, speed_m_s: float = 0.3, dynamics: BaseDynamics = IDEAL_BASE) -> None:
        self.link = link = Link(speed_m_s, dynamics)
        self.wall_m, self.image_delay_s = 50.0, IMAGE_DELAY_S
        self.sees = self.feels = True
        self._camera_due_s = self._odometry_due_s = self._watch_due_s = 0.0
        self._late: list[tuple[float, float, Any]] = []
        clock = SimpleNamespace(monotonic=lambda: link.now_s, sleep=lambda _s: None)
        for module in (robot_reports, movement_runner, path_looks, path_runner):
            patch.setattr(module, "time", clock)
        thread = SimpleNamespace(start=lambda: None, join=lambda _s: None)
        quiet = SimpleNamespace(**{**vars(threading), "Thread": lambda **_: thread})
        patch.setattr(path_runner, "threading", quiet)
        self._base_sleep = link.stand.sleep_until
        link.stand.mover._sleep_until = self.sleep_until
        self._script: Iterator[float] | None = None
        for _ in range(25):
            self.sleep_until(link.now_s + 0.02)
        self.movements = MovementRunner(link, link.stand.settings)  # type: ignore[arg-type]
        self.movements.begin(link.snapshot())
        self.runner = PathRunner(link, self.movements)  # type: ignore[arg-type]
        camera = RosCamera(link, PROFILE)  # type: ignore[arg-type]
        self.guard = PathGuard(link.profile, ProtocolParameters())
        self.looks = PathLooks(camera, self.guard, self.movements.origin)

    @property
    def now_s(self) -> float:
        return self.link.now_s

    @property
    def pose(self) -> Pose:
        return self.link.stand.base.pose.relative_to(START)

    def run(self, script: "Callable[[Rig], Iterator[float]]") -> None:
        self._script, self._due_s = script(self), self.now_s
        while self._script is not None:
            self.sleep_until(self.now_s + 0.02)
            while self.link.loops:
                self.link.loops.pop(0)()
        self._base_sleep(self.now_s + 1.0)

    def sleep_until(self, due_s: float) -> None:
        self._base_sleep(due_s)
        base, now_s = self.link.stand.base, self.now_s
        if self.feels and now_s >= self._odometry_due_s:
            self._odometry_due_s = now_s + 0.02
            here = base.read_odometry()
            self.link.reports.take_odometry((*here.position, here.heading_rad), now_s, "odom", "base")
        if self.sees and now_s >= self._camera_due_s:
            self._camera_due_s = now_s + 0.1
            self._late.append((now_s + self.image_delay_s, now_s, self.picture()))
        while self._late and self._late[0][0] <= now_s:
            _, stamp_s, pictures = self._late.pop(0)
            for field, image in pictures.items():
                self.link.reports.take_image(field, 6, image, stamp_s, field, "camera")
        if self._script is None:
            return
        if now_s >= self._watch_due_s and self.runner._thread is not None:
            self._watch_due_s = now_s + 0.02
            self.runner.look_once()
        if now_s >= self._due_s:
            wait_s = next(self._script, None)
            if wait_s is None:
                self._script = None
                self.runner.halt()
            else:
                self._due_s = now_s + wait_s

    def picture(self) -> dict[str, Any]:
        """Return colour and depth of a wall that the robot drives towards."""
        depth_mm = max(self.wall_m - self.pose.x_m, 0.0) * 1000
        depth_mm = 0.0 if depth_mm > 10_000 or depth_mm < 300 else depth_mm
        depth = np.full((48, 64), min(depth_mm or 8000, 65_000), np.uint16)
        pictures = {"colors": ("rgb8", np.zeros((48, 64, 3), np.uint8)), "depths": ("16UC1", depth)}
        return {
            field: SimpleNamespace(
                height=48, width=64, step=pixels[0].nbytes, encoding=encoding, is_bigendian=0, data=pixels.tobytes()
            )
            for field, (encoding, pixels) in pictures.items()
        }

    def observe(self) -> tuple[Pose, float]:
        """Return pose and time of the newest image."""
        stamp_s = self.link.snapshot().colors[-1].stamp_s
        return self.runner.captured_at(stamp_s), stamp_s

    def follow(self, movement: Waypoint | Trajectory, anchor: Pose | None = None) -> MotionResult:
        """Return the motion before the path begins."""
        self.runner.follow(movement, anchor)
        return self.runner.advance(NOW, self.looks)

    def so_far(self) -> MotionResult:
        return self.runner.advance(NOW, self.looks)

    @property
    def speed_m_s(self) -> float:
        return self.link.sent[-1][1].linear_m_s


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Rig:
    return Rig(monkeypatch)


def test_the_guard_stops_the_robot_while_the_model_thinks(rig: Rig) -> None:
    rig.wall_m = 2.0

    def script(rig: Rig) -> Iterator[float]:
        rig.observe()
        rig.follow(AHEAD)
        yield 2.0
        assert rig.speed_m_s > 0.1
        yield 8.0  # the model takes long
        assert rig.speed_m_s == 0.0
        result = rig.so_far()
        assert "obstacle" in result.blocked
        assert not result.failure
        assert rig.guard.last is not None
        assert rig.guard.last.blocked
        left_m = rig.wall_m - rig.pose.x_m - PROFILE.base.radius_m
        assert 0.1 < left_m < 1.0
        rig.follow(AHEAD)
        yield 2.0
        again = rig.so_far()
        assert again.blocked
        assert again.displacement_m < 0.01, "it looks before it leaves its position"

    rig.run(script)


@pytest.mark.parametrize(
    ("speed_m_s", "image_delay_s"),
    [
        (0.5, 0.3),
        *(
            pytest.param(speed_m_s, delay_s, marks=pytest.mark.long)
            for speed_m_s in (0.2, 0.3, 0.5)
            for delay_s in (0.05, 0.15, 0.3)
        ),
    ],
)
def test_new_paths_towards_a_wall_never_touch_it(
    monkeypatch: pytest.MonkeyPatch, speed_m_s: float, image_delay_s: float
) -> None:
    """On a base with delays, from many distances; each answer comes 0.3 s after its image."""
    rig = Rig(monkeypatch, speed_m_s, BaseDynamics(dead_time_s=0.05, motor_time_constant_s=0.08))
    rig.image_delay_s = image_delay_s
    nearest_m: list[float] = []

    def script(rig: Rig) -> Iterator[float]:
        for away_m in (0.9, 1.2, 1.9):
            rig.wall_m = rig.pose.x_m + away_m
            yield 1.0
            blocks = 0
            captured, _ = rig.observe()
            for _ in range(40):
                yield 0.3
                blocks += bool(rig.follow(AHEAD, captured).blocked)
                captured, _ = rig.observe()
                if blocks > 4:
                    break
            assert blocks > 4
            nearest_m.append(rig.wall_m - rig.pose.x_m - PROFILE.base.radius_m)

    rig.run(script)
    assert min(nearest_m) > 0.05


def test_a_first_check_that_loads_its_code_for_long_does_not_silence_the_workstation(rig: Rig) -> None:
    checks: list[float] = []

    def slow(_view: DrivingView) -> str:
        if not checks:
            rig._base_sleep(rig.now_s + 2.0)  # nothing else of the process runs
        checks.append(rig.now_s)
        return ""

    rig.looks.check = slow

    def script(rig: Rig) -> Iterator[float]:
        rig.observe()
        yield 0.3
        rig.follow(AHEAD)
        yield 2.0
        assert rig.speed_m_s > 0.1
        assert not rig.so_far().failure
        assert len(checks) > 5

    rig.run(script)


def test_a_silent_camera_stops_the_robot_and_then_ends_the_motion(rig: Rig) -> None:
    def script(rig: Rig) -> Iterator[float]:
        rig.observe()
        rig.follow(AHEAD)
        yield 2.0
        rig.so_far()
        rig.sees = False
        yield 0.5
        assert rig.speed_m_s == 0.0
        assert "no depth image" in rig.so_far().blocked
        yield 1.0
        lost = rig.so_far()
        assert lost.sensor_lost
        assert "no image on" in lost.failure

    rig.run(script)


@pytest.mark.parametrize("is_guarded", [True, False])
def test_the_guard_holds_a_base_that_a_stack_drives_towards_a_wall(rig: Rig, is_guarded: bool) -> None:
    rig.link.others_drive, rig.wall_m = True, 2.0
    looks = rig.looks if is_guarded else None

    def script(rig: Rig) -> Iterator[float]:
        rig.observe()
        rig.runner.advance(NOW, looks)
        for _ in range(140):  # 7 s: it would be at the wall
            if not rig.link.holding:  # every command of the stack is answered with zero velocity
                rig.link.stand.hear(Command(0.3, 0.0))
            yield 0.05
        left_m = rig.wall_m - rig.pose.x_m - PROFILE.base.radius_m
        assert rig.link.holding is is_guarded
        assert (0.1 < left_m < 0.5) is is_guarded
        result = rig.runner.advance(rig.now_s + 1.0 if is_guarded else NOW, looks)
        assert ("obstacle" in result.blocked) is is_guarded, "and the motion has ended"
        assert not result.failure

    rig.run(script)


@pytest.mark.parametrize(("fault", "says", "within_s"), [("silent", "no odometry", 1.0), ("jump", "jumped", 0.1)])
def test_lost_odometry_ends_the_motion_at_rest(rig: Rig, fault: str, says: str, within_s: float) -> None:
    def script(rig: Rig) -> Iterator[float]:
        rig.observe()
        rig.follow(AHEAD)
        yield 2.0
        if fault == "silent":
            rig.feels = False
        else:
            rig.link.reports.take_odometry((9.0, 9.0, 0.0), rig.now_s, "odom", "base")
        yield within_s
        assert rig.speed_m_s == 0.0
        result = rig.so_far()
        assert result.sensor_lost
        assert says in result.failure
        rig.follow(AHEAD)
        yield 0.5
        assert rig.speed_m_s == 0.0, "nothing is driven after a failure"

    rig.run(script)


def test_a_network_that_is_cut_is_named_and_not_one_of_the_drivers(rig: Rig) -> None:
    def script(rig: Rig) -> Iterator[float]:
        rig.observe()
        rig.follow(AHEAD)
        yield 2.0
        rig.so_far()
        rig.sees = rig.feels = False
        yield 1.2
        lost = rig.so_far()
        assert lost.sensor_lost
        assert "the robot is silent" in lost.failure

    rig.run(script)


def test_a_halt_from_another_thread_stops_at_once_and_for_good(rig: Rig) -> None:
    def script(rig: Rig) -> Iterator[float]:
        rig.observe()
        rig.follow(AHEAD)
        yield 2.0
        halted_s = rig.now_s
        rig.runner.halt()
        assert rig.link.sent[-1] == (halted_s, STANDSTILL)
        yield 0.5
        rig.follow(AHEAD)
        yield 0.5
        assert {command for at_s, command in rig.link.sent if at_s > halted_s} <= {STANDSTILL}

    rig.run(script)


def test_the_motion_of_the_answers_has_no_gaps(rig: Rig) -> None:
    results: list[MotionResult] = []

    def script(rig: Rig) -> Iterator[float]:
        _, first_s = rig.observe()
        yield 0.4
        results.append(rig.follow(Waypoint(0.6, 0.0)))
        for _ in range(12):
            yield 0.45
            results.append(rig.so_far())
        assert sum(result.duration_s for result in results) == pytest.approx(rig.now_s - first_s, abs=0.03)

    rig.run(script)
    assert results[0].waiting_s == pytest.approx(0.45, abs=0.06)
    assert sum(result.displacement_m for result in results) == pytest.approx(0.6, abs=0.02)
    assert sum(result.path_m or 0.0 for result in results) == pytest.approx(0.6, abs=0.02)
    assert results[-1].waiting_s == pytest.approx(0.45, abs=0.03)
    assert all(result.completed for result in results)


@pytest.mark.parametrize(("anchored", "holds"), [(True, True), (False, False)])
def test_late_answers_stay_on_the_curve_if_they_are_anchored_at_the_capture(
    rig: Rig, anchored: bool, holds: bool
) -> None:
    """The model takes 1 s, and its image was 0.05 to 0.15 s old when it began."""

    def wave(x_m: float) -> tuple[float, float]:
        return x_m, 0.3 * (1 - math.cos(math.tau * x_m / 2.4))

    def answer_at(here: Pose) -> Trajectory:
        return Trajectory(tuple(Pose(*wave(here.x_m + 0.05 * k)).relative_to(here).position for k in range(1, 31)))

    off_m: list[float] = []

    def script(rig: Rig) -> Iterator[float]:
        captured, _ = rig.observe()
        for _ in range(9):
            answer = answer_at(captured)
            yield 1.0
            rig.follow(answer, captured if anchored else None)
            captured, _ = rig.observe()
            at = rig.pose.position
            off_m.append(min(math.dist(at, wave(at[0] + 0.01 * k)) for k in range(-40, 41)))

    rig.run(script)
    assert (max(off_m) < 0.05) is holds
    assert rig.pose.x_m > 1.5 or not anchored


def test_an_order_that_is_not_repeated_ends_by_itself(rig: Rig) -> None:
    """As when the workstation is stopped; the resumed one does not continue."""

    def script(rig: Rig) -> Iterator[float]:
        rig.observe()
        rig.follow(AHEAD)
        yield 2.0
        rig._watch_due_s = rig.now_s + 2.0
        yield 1.0
        assert rig.speed_m_s == 0.0
        rests = rig.pose
        yield 1.5
        result = rig.so_far()
        assert "silent" in result.failure
        assert rig.pose.distance_to(rests) < 0.01

    rig.run(script)
