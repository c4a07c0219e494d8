"""A scan: the drivers, the map that is kept, and every way in which it ends."""

import math
import os
import pty
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from vsnbench.errors import RobotError, SensorLostError, UsageError
from vsnbench.protocol.actions import Action
from vsnbench.protocol.motion_result import MotionResult
from vsnbench.protocol.observation import Observation, Sensor
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.site import load_site
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.scan import Scan, ScanResult, ScanState
from vsnbench.runner.scan_drivers import Explorer, Script
from vsnbench.runner.scan_keys import Keys
from vsnbench.runner.stopping import StopAuthor, Stopping, StopRequest
from vsnbench.sensing.occupancy_map import OccupancyMap
from vsnbench.sensing.plan_grid import OCCUPIED, PlanGrid
from vsnbench.simulator.noise import NoiseSettings, OdometryNoise

PARAMETERS = ProtocolParameters()
SITE = load_site("apartment")
STATE = ScanState(OccupancyMap(), Pose(0, 0), 0, False, False, "", Pose(0, 0))


@pytest.fixture
def robot() -> Iterator[SimulatedRobot]:
    profile = load_profile("turtlebot2")
    small = profile.model_copy(update={"camera": profile.camera.cut_to(160, 120)})
    with SimulatedRobot(SITE, small, PARAMETERS, read=frozenset({Sensor.DEPTH, Sensor.ODOMETRY})) as opened:
        yield opened


def walls_on_the_map(grid: PlanGrid, *points: tuple[float, float]) -> list[bool]:
    rows, columns = np.nonzero(grid.cells == OCCUPIED)
    centres = grid.in_site(np.column_stack((columns + 0.5, rows + 0.5)))
    return [bool(np.hypot(*(centres - point).T).min() < 0.05) for point in points]


def test_a_scan_draws_what_it_sees_into_the_sites_frame(robot: SimulatedRobot) -> None:
    start = SITE.start(1)
    kept: list[PlanGrid] = []
    with Stopping() as stop:
        scan = Scan(robot, start, PARAMETERS, stop)
        result = scan.run(Script("around forward", "drive.txt", PARAMETERS), kept.append, lambda _: None)
    assert result.actions == 13
    assert result.stopped is None
    ahead = robot.locate().pose
    depth_m = robot.observe().depth_m
    assert depth_m is not None
    middle_m = float(np.nanmedian(depth_m[40:60, 78:82]))
    far = robot.profile.camera.mount_forward_m + middle_m
    seen = (ahead.x_m + far * math.cos(ahead.heading_rad), ahead.y_m + far * math.sin(ahead.heading_rad))
    assert walls_on_the_map(kept[-1], seen) == [True]
    assert result.seen_free_m2 > 3


@pytest.mark.slow
def test_the_walls_say_how_far_odometry_is_off() -> None:
    profile = load_profile("turtlebot2")
    small = profile.model_copy(update={"camera": profile.camera.cut_to(160, 120)})
    noise = NoiseSettings(odometry=OdometryNoise(turn_scale_std=0.02))
    read = frozenset({Sensor.DEPTH, Sensor.ODOMETRY})
    start = SITE.start(1)
    with Stopping() as stop, SimulatedRobot(SITE, small, PARAMETERS, noise, read) as drifting:
        scan = Scan(drifting, start, PARAMETERS, stop, seed=4)
        script = Script("around forward 2 around", "drive.txt", PARAMETERS)
        result = scan.run(script, lambda _: None, lambda _: None)
        said, true = drifting.observe().pose, drifting.locate().pose.relative_to(start.pose)
    off_deg = math.degrees(math.remainder(said.heading_rad - true.heading_rad, math.tau))
    assert abs(off_deg) > 8
    assert result.drift.heading_deg == pytest.approx(off_deg, abs=1.0)
    assert result.drift.position == pytest.approx((said.x_m - true.x_m, said.y_m - true.y_m), abs=0.03)


def test_what_was_mapped_is_kept_when_somebody_stops_it(robot: SimulatedRobot) -> None:
    kept: list[PlanGrid] = []
    with Stopping() as stop:

        def told(state: ScanState) -> None:
            if state.actions == 3:
                stop.ask(StopRequest(StopAuthor.PERSON, "Ctrl-C"))

        scan = Scan(robot, SITE.start(1), PARAMETERS, stop)
        result = scan.run(Script("around", "drive.txt", PARAMETERS), kept.append, told)
    assert result.stopped is not None
    assert result.actions <= 3
    assert (kept[-1].cells == OCCUPIED).any()


class StuckRobot(SimulatedRobot):
    """Its base does not turn."""

    halts = 0

    def execute(self, action: Action) -> MotionResult:
        return MotionResult(completed=False, failure=f"{action} failed: the base is stuck")

    def halt(self) -> None:
        self.halts += 1


def test_a_base_that_is_stuck_ends_a_scan_halted_and_the_map_is_kept() -> None:
    kept: list[PlanGrid] = []
    with Stopping() as stop, StuckRobot(SITE, load_profile("turtlebot2"), PARAMETERS) as stuck:
        scan = Scan(stuck, SITE.start(1), PARAMETERS, stop)
        with pytest.raises(RobotError, match="3 movements that failed: TURN_LEFT failed: the base is stuck"):
            scan.run(Script("around", "drive.txt", PARAMETERS), kept.append, lambda _: None)
        assert stuck.halts == 1
    assert kept


class SilentRobot(SimulatedRobot):
    """Its camera falls silent for some looks."""

    silences = 0

    def observe(self) -> Observation:
        if self.silences:
            self.silences -= 1
            raise SensorLostError("no image for 3 s")
        return super().observe()


def scanned(robot: SimulatedRobot) -> tuple[ScanResult, int]:
    """Return what three turns of a robot leave, and how many cells were mapped in the end."""
    kept: list[PlanGrid] = []
    with Stopping() as stop:
        scan = Scan(robot, SITE.start(1), PARAMETERS, stop)
        result = scan.run(Script("left 3", "drive.txt", PARAMETERS), kept.append, lambda _: None)
    return result, int((kept[-1].cells == OCCUPIED).sum())


def test_a_camera_that_is_silent_for_a_moment_is_waited_for_and_one_that_stays_silent_ends_a_scan() -> None:
    with SilentRobot(SITE, load_profile("turtlebot2"), PARAMETERS) as robot:
        robot.silences = 3
        result, mapped = scanned(robot)
        assert (result.actions, result.failed) == (3, 0)
        assert mapped > 20
        robot.silences = 4
        with pytest.raises(SensorLostError, match="no image for 3 s"):
            scanned(robot)


def test_a_script_says_each_action_and_how_often() -> None:
    script = Script("forward 2 left # a turn\n\nBack; right\n", "drive.txt", PARAMETERS)
    actions = list(iter(lambda: script.next(STATE), None))
    forward, back = Action.MOVE_FORWARD, Action.MOVE_BACKWARD
    assert actions == [forward, forward, Action.TURN_LEFT, back, Action.TURN_RIGHT]


def test_a_script_ends_where_the_robot_touched_something() -> None:
    script = Script("forward 3", "drive.txt", PARAMETERS)
    assert script.next(STATE) is Action.MOVE_FORWARD
    assert script.next(replace(STATE, refused=True, collided=True)) is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("forward\nsideways", "drive.txt:2: 'sideways' is no action"),
        ("3 forward", "drive.txt:1: '3' is no action"),
        ("forward 0", "drive.txt:1: '0' is no action"),
        ("forward 99999 left 99999", "drive.txt:1: more than 100,000 actions"),
        ("# nothing", "drive.txt has no action in it"),
    ],
)
def test_a_script_that_is_none_is_refused_with_its_line(text: str, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        Script(text, "drive.txt", PARAMETERS)


def test_the_explorer_looks_around_where_it_begins_and_then_goes_where_it_has_not_seen(robot: SimulatedRobot) -> None:
    actions: list[Action | None] = []

    class Watched(Explorer):
        def next(self, state: ScanState) -> Action | None:
            actions.append(super().next(state))
            return actions[-1]

    with Stopping() as stop:
        start = SITE.start(1)
        scan = Scan(robot, start, PARAMETERS, stop)
        driver = Watched(robot.profile.base, PARAMETERS)
        scan.run(driver, lambda _: None, lambda _: None, most_actions=24)
    assert len({*actions[:12]}) == 1
    assert Action.MOVE_FORWARD in actions[12:]
    assert robot.locate().pose.distance_to(start.pose) > 0.4


def test_keys_drive_and_the_space_bar_halts_at_once() -> None:
    halted: list[bool] = []
    ours, theirs = pty.openpty()
    try:
        with Keys(PARAMETERS, lambda: halted.append(True), descriptor=theirs) as keys:
            os.write(ours, b"w")
            assert keys.next(STATE) is Action.MOVE_FORWARD
            os.write(ours, b"\x1b[D")
            assert keys.next(STATE) is Action.TURN_LEFT
            os.write(ours, b"o ")
            os.write(ours, b"q")
            assert keys.next(STATE) in (None, Action.TURN_LEFT)
            while keys.next(STATE) is not None:
                pass
            assert halted == [True]
    finally:
        os.close(ours)
        os.close(theirs)


def test_a_key_that_is_held_down_drives_one_movement_ahead() -> None:
    ours, theirs = pty.openpty()
    try:
        with Keys(PARAMETERS, lambda: None, descriptor=theirs) as keys:
            os.write(ours, b"wwwwwwa")
            os.write(ours, b"z")
            first = keys.next(STATE)
            os.write(ours, b"q")
            rest = list(iter(lambda: keys.next(STATE), None))
    finally:
        os.close(ours)
        os.close(theirs)
    assert len([first, *rest]) <= 2


def test_keys_need_a_terminal() -> None:
    reading, writing = os.pipe()
    try:
        with pytest.raises(UsageError, match="driving by hand needs a terminal"):
            Keys(PARAMETERS, lambda: None, descriptor=reading)
    finally:
        os.close(reading)
        os.close(writing)
