"""Movements with parameters over ROS 2: accuracy, and faults while one is in flight."""

import math
import signal
import time
from collections.abc import Iterable, Iterator
from typing import Any

import pytest

from tests.processes import wait_until
from tests.robots.drives import FAULTS, FREE, IN_FLIGHT
from tests.robots.fault_table import FaultRow
from tests.robots.faulty_rig import STOPS_WITHIN_S, Ending
from tests.ros.ros1.network import PATIENCE_S
from tests.ros.ros2.graph import is_at, send_line, true_pose
from tests.ros.ros2.rig import Rig2, live_rig

pytestmark = pytest.mark.ros2
NEXT_TO_BASE = pytest.mark.parametrize("shared_rig", ["next to the base"], indirect=True)
CAMERA_SILENT_S = 1.0
"""The camera is silent for longer than any image counts (0.5 s), also if the last one was late."""


@pytest.fixture(scope="module", params=["workstation", "next to the base"])
def shared_rig(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig2]:
    with live_rig(tmp_path_factory.mktemp("ros2"), next_to_base=request.param == "next to the base") as one:
        yield one


@pytest.fixture
def rig(shared_rig: Rig2) -> Rig2:
    """The shared robot, in a new episode."""
    shared_rig.make_good()
    return shared_rig


def check(rig: Rig2, cause: str, end: Ending, movement: str, says: str) -> None:
    """Check that the base stopped, and that no further movement starts while the fault lasts."""
    second = rig.second("drive", IN_FLIGHT[movement])
    reason = end.result["end_reason"], end.why
    rig.table.rows.append(FaultRow(f"{movement}: {cause}", *end.times, *reason, "–", str(second)))
    end.check(says)
    assert not second.started


def by_lane(cases: Iterable[tuple[str, ...]], *daily: tuple[str, ...]) -> list[Any]:
    """Return cases of both lanes; those that are not daily are long tests."""
    both = [(lane, *case) for lane in ("workstation", "next to the base") for case in cases]
    return [pytest.param(*case, marks=() if case in daily else pytest.mark.long) for case in both]


@pytest.mark.parametrize(
    ("shared_rig", "name"),
    by_lane([(name,) for name in FREE], ("workstation", "waypoint"), ("next to the base", "trajectory")),
    indirect=["shared_rig"],
)
def test_a_movement_ends_where_it_was_asked_to(rig: Rig2, name: str) -> None:
    movement, (x_m, y_m) = FREE[name]
    before = rig.client("observe")["pose"]
    result = rig.undisturbed("drive", movement, between=rig.make_good)  # each begins an episode, at the same pose
    assert (result["completed"], result["failure"], result["blocked"]) == (True, "", "")
    at_m = [result["pose"][axis] - before[k] for k, axis in enumerate(("x_m", "y_m"))]
    cos, sin = math.cos(before[2]), math.sin(before[2])
    along_m, left_m = at_m[0] * cos + at_m[1] * sin, at_m[1] * cos - at_m[0] * sin
    assert math.hypot(along_m - x_m, left_m - y_m) < 0.02
    assert rig.client("kinds") == ["discrete", "move", "sidestep", "trajectory", "velocity", "waypoint"]


@pytest.mark.parametrize(
    ("shared_rig", "movement", "fault"),
    by_lane(
        [(movement, fault) for movement in IN_FLIGHT for fault in FAULTS],
        ("workstation", "waypoint", "silent"),
        ("workstation", "velocity", "stuck"),
        ("next to the base", "waypoint", "bumper"),
    ),
    indirect=["shared_rig"],
)
def test_a_fault_of_the_base_ends_a_movement_in_flight(rig: Rig2, movement: str, fault: str) -> None:
    says, sensor_lost = FAULTS[fault]
    end = rig.end_by(lambda: send_line(rig.robot, fault), says, "drive", IN_FLIGHT[movement])
    check(rig, fault, end, movement, says)
    assert end.result["sensor_lost"] is sensor_lost


@pytest.mark.parametrize(
    ("shared_rig", "movement"),
    by_lane([(movement,) for movement in IN_FLIGHT], ("workstation", "waypoint")),
    indirect=["shared_rig"],
)
def test_a_silent_camera_blocks_a_movement_in_flight(rig: Rig2, movement: str) -> None:
    end = rig.end_by(lambda: send_line(rig.robot, "blind"), "no depth image", "drive", IN_FLIGHT[movement])
    ended_s = time.monotonic()
    wait_until(lambda: time.monotonic() - ended_s > CAMERA_SILENT_S, "the camera is silent for a while")
    check(rig, "camera silent", end, movement, "no depth image")
    assert end.result["blocked"]


@pytest.mark.long
@pytest.mark.parametrize("movement", IN_FLIGHT)
def test_a_stopped_workstation_ends_a_movement_for_good(rig: Rig2, movement: str) -> None:
    """The node next to the base, or the base's own limit, stops it; the resumed workstation does not continue."""
    if rig.node is None:
        send_line(rig.robot, "timeout 0.5")
    future = rig.moving("drive", IN_FLIGHT[movement])
    stop_s = time.monotonic()
    rig.client.popen.send_signal(signal.SIGSTOP)
    stood_s = rig.stood_after(stop_s)
    wait_until(lambda: time.monotonic() - stop_s > 1.5, "the workstation was stopped for a while")
    stood_at = true_pose(rig.robot)
    rig.client.popen.send_signal(signal.SIGCONT)
    result = future.result(PATIENCE_S)
    why = result["failure"] or result["blocked"]
    row = FaultRow(f"{movement}: workstation stopped", rig.zeroed_after(stop_s), stood_s, result["end_reason"], why)
    rig.table.rows.append(row)
    assert result["completed"] is False
    assert is_at(rig.robot, stood_at), true_pose(rig.robot)
    assert stood_s < STOPS_WITHIN_S


def signalled(rig: Rig2, number: signal.Signals) -> float:
    """Signal the node next to the base, and return the time."""
    assert rig.node is not None
    rig.node.signal(number)
    return time.monotonic()


@NEXT_TO_BASE
@pytest.mark.parametrize("movement", ["velocity", pytest.param("waypoint", marks=pytest.mark.long)])
def test_a_stopped_node_next_to_the_base_stops_it(rig: Rig2, movement: str) -> None:
    end = rig.end_by(lambda: signalled(rig, signal.SIGSTOP), "has not steered", "drive", IN_FLIGHT[movement])
    check(rig, "discrete_move stopped", end, movement, "has not steered")
    stood_at = true_pose(rig.robot)
    resumed_s = signalled(rig, signal.SIGCONT)
    wait_until(lambda: time.monotonic() - resumed_s > 1.0, "the resumed node could act on the old requests")
    assert is_at(rig.robot, stood_at), true_pose(rig.robot)


@NEXT_TO_BASE
@pytest.mark.long
@pytest.mark.parametrize("movement", IN_FLIGHT)
def test_a_killed_node_next_to_the_base_stops_it(rig: Rig2, movement: str) -> None:
    end = rig.end_by(lambda: signalled(rig, signal.SIGKILL), "has not steered", "drive", IN_FLIGHT[movement])
    check(rig, "discrete_move killed", end, movement, "has not steered")


@pytest.mark.long
@pytest.mark.parametrize("movement", IN_FLIGHT)
def test_a_killed_workstation_leaves_a_base_at_rest(rig: Rig2, movement: str) -> None:
    if rig.node is None:
        send_line(rig.robot, "timeout 0.5")
    future = rig.moving("drive", IN_FLIGHT[movement])
    kill_s = time.monotonic()
    rig.client.popen.kill()
    stood_s = rig.stood_after(kill_s)
    assert future.exception(PATIENCE_S) is not None
    zeroed_s, stood_at = rig.zeroed_after(kill_s), true_pose(rig.robot)
    rig.table.rows.append(FaultRow(f"{movement}: workstation killed", zeroed_s, stood_s, "interrupted", ""))
    assert stood_s < STOPS_WITHIN_S
    assert is_at(rig.robot, stood_at), true_pose(rig.robot)


@pytest.mark.parametrize(
    ("shared_rig", "fault"),
    by_lane([(fault,) for fault in FAULTS], ("next to the base", "bumper")),
    indirect=["shared_rig"],
)
def test_a_fault_of_the_base_ends_driving_on(rig: Rig2, fault: str) -> None:
    """The robot drives on, with a new path every 0.3 s."""
    says, sensor_lost = FAULTS[fault]
    end = rig.end_by(lambda: send_line(rig.robot, fault), says, "drive_on", IN_FLIGHT["waypoint"])
    end.check(says)
    assert end.result["sensor_lost"] is sensor_lost
    row = FaultRow(f"driving on: {fault}", *end.times, end.result["end_reason"], end.why)
    rig.table.rows.append(row)


@pytest.mark.long
def test_a_silent_camera_blocks_driving_on(rig: Rig2) -> None:
    end = rig.end_by(lambda: send_line(rig.robot, "blind"), "no depth image", "drive_on", IN_FLIGHT["waypoint"])
    end.check("no depth image")
    assert end.result["blocked"]


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_workstation_that_is_gone_leaves_a_base_that_drove_on_at_rest(rig: Rig2, number: signal.Signals) -> None:
    """The base's own limit, or the node next to it, stops it; the resumed workstation does not continue."""
    if rig.node is None:
        send_line(rig.robot, "timeout 0.5")
    future = rig.moving("drive_on", IN_FLIGHT["waypoint"])
    gone_s = time.monotonic()
    rig.client.popen.send_signal(number)
    stood_s = rig.stood_after(gone_s)
    wait_until(lambda: time.monotonic() - gone_s > 2.0, "the workstation is gone for a while")
    stood_at = true_pose(rig.robot)
    if number is signal.SIGSTOP:
        rig.client.popen.send_signal(signal.SIGCONT)
        assert future.result(PATIENCE_S)["completed"] is False
    rig.table.rows.append(FaultRow(f"driving on: workstation {number.name}", rig.zeroed_after(gone_s), stood_s, "", ""))
    assert is_at(rig.robot, stood_at), true_pose(rig.robot)
    assert stood_s < STOPS_WITHIN_S


@NEXT_TO_BASE
@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_node_that_is_gone_stops_a_base_that_drove_on(rig: Rig2, number: signal.Signals) -> None:
    end = rig.end_by(lambda: signalled(rig, number), "has not steered", "drive_on", IN_FLIGHT["waypoint"])
    end.check("has not steered")
