"""Movements with parameters over ROS 2: accuracy, and faults while one is in flight."""

import math
import signal
import time
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from tests.processes import wait_until
from tests.robots.drives import FREE, IN_FLIGHT
from tests.robots.fault_table import FaultRow
from tests.ros1.network import PATIENCE_S
from tests.ros2.graph import Rig2, is_at, live_rig, moves, send_line, true_pose

pytestmark = pytest.mark.ros2
AT_REST_S = 1.0
"""Limit from a fault to the command of zero velocity, and to rest, measured at the base."""
NEXT_TO_BASE = pytest.mark.parametrize("rig", ["next to the base"], indirect=True)


@pytest.fixture(scope="module", params=["workstation", "next to the base"])
def rig(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig2]:
    with live_rig(tmp_path_factory.mktemp("ros2"), next_to_base=request.param == "next to the base") as shared:
        yield shared


def driving(rig: Rig2, movement: dict[str, Any]) -> "Future[Any]":
    """Start a movement in a new episode, and return once the base is really moving."""
    rig.client("begin")
    future = rig.client.later("drive", movement)
    wait_until(lambda: moves(rig.robot) or future.done(), "the base moves")
    assert not future.done(), future.result()
    return future


def end(rig: Rig2, cause: str, future: "Future[Any]", fault_s: float, movement: dict[str, Any]) -> dict[str, Any]:
    """Check that the base was at rest in time, and that no further movement starts while the fault lasts."""
    stood_s = rig.stood_after(fault_s)
    result = future.result(PATIENCE_S)
    zeroed_s = rig.zeroed_after(fault_s)
    second = rig.second("drive", movement)
    why = result["failure"] or result["blocked"]
    rig.table.rows.append(FaultRow(cause, zeroed_s, stood_s, result["end_reason"], why, "–", str(second)))
    assert result["completed"] is False
    assert not second.started
    assert zeroed_s is not None
    assert max(zeroed_s, stood_s) < AT_REST_S
    return dict(result)


@pytest.mark.parametrize("name", FREE)
def test_a_movement_ends_where_it_was_asked_to(rig: Rig2, name: str) -> None:
    movement, (x_m, y_m) = FREE[name]
    rig.client("begin")
    before = rig.client("observe")["pose"]
    result = rig.client("drive", movement)
    assert (result["completed"], result["failure"], result["blocked"]) == (True, "", "")
    at_m = [result["pose"][axis] - before[k] for k, axis in enumerate(("x_m", "y_m"))]
    cos, sin = math.cos(before[2]), math.sin(before[2])
    along_m, left_m = at_m[0] * cos + at_m[1] * sin, at_m[1] * cos - at_m[0] * sin
    assert math.hypot(along_m - x_m, left_m - y_m) < 0.02
    assert rig.client("kinds") == ["discrete", "move", "trajectory", "velocity", "waypoint"]


@pytest.mark.parametrize("movement", IN_FLIGHT)
@pytest.mark.parametrize(
    ("fault", "sensor_lost"),
    [("silent", True), ("nan", True), ("jump", True), ("bumper", False), ("cliff", False), ("stuck", False)],
)
def test_a_fault_of_the_base_ends_a_movement_in_flight(rig: Rig2, movement: str, fault: str, sensor_lost: bool) -> None:
    future = driving(rig, IN_FLIGHT[movement])
    fault_s = send_line(rig.robot, fault)
    try:
        result = end(rig, f"{movement}: {fault}", future, fault_s, IN_FLIGHT[movement])
    finally:
        rig.put_right()
    assert result["failure"]
    assert result["sensor_lost"] is sensor_lost


@pytest.mark.parametrize("movement", IN_FLIGHT)
def test_a_silent_camera_blocks_a_movement_in_flight(rig: Rig2, movement: str) -> None:
    future = driving(rig, IN_FLIGHT[movement])
    fault_s = send_line(rig.robot, "blind")
    try:
        result = end(rig, f"{movement}: camera silent", future, fault_s, IN_FLIGHT[movement])
    finally:
        rig.put_right()
    assert result["blocked"]


@pytest.mark.parametrize("movement", IN_FLIGHT)
def test_a_stopped_workstation_ends_a_movement_for_good(rig: Rig2, movement: str) -> None:
    """The node next to the base, or the base's own limit, stops it; the resumed workstation does not continue."""
    send_line(rig.robot, "timeout 0.5" if rig.node is None else "timeout 1000")
    try:
        future = driving(rig, IN_FLIGHT[movement])
        stop_s = time.monotonic()
        rig.client.popen.send_signal(signal.SIGSTOP)
        try:
            stood_s = rig.stood_after(stop_s)
            wait_until(lambda: time.monotonic() - stop_s > 1.5, "the workstation was stopped for a while")
            stood_at = true_pose(rig.robot)
        finally:
            rig.client.popen.send_signal(signal.SIGCONT)
        result = future.result(PATIENCE_S)
        why = result["failure"] or result["blocked"]
        row = FaultRow(f"{movement}: workstation stopped", rig.zeroed_after(stop_s), stood_s, result["end_reason"], why)
        rig.table.rows.append(row)
    finally:
        send_line(rig.robot, "timeout 1000")
    assert result["completed"] is False
    assert is_at(rig.robot, stood_at)
    assert stood_s < AT_REST_S


@NEXT_TO_BASE
@pytest.mark.parametrize("movement", IN_FLIGHT)
def test_a_stopped_node_next_to_the_base_stops_it(rig: Rig2, movement: str) -> None:
    assert rig.node is not None
    future = driving(rig, IN_FLIGHT[movement])
    lost_s = time.monotonic()
    rig.node.signal(signal.SIGSTOP)
    try:
        end(rig, f"{movement}: discrete_move stopped", future, lost_s, IN_FLIGHT[movement])
        stood_at = true_pose(rig.robot)
    finally:
        rig.node.signal(signal.SIGCONT)
    resumed_s = time.monotonic()
    wait_until(lambda: time.monotonic() - resumed_s > 1.0, "the resumed node could act on the old requests")
    assert is_at(rig.robot, stood_at)
    rig.client("begin")


@pytest.mark.parametrize("movement", IN_FLIGHT)
def test_a_killed_node_next_to_the_base_stops_it(tmp_path: Path, movement: str) -> None:
    """Uses its own graph, because a killed process disturbs later ones on the same machine."""
    with live_rig(tmp_path, next_to_base=True) as rig:
        assert rig.node is not None
        future = driving(rig, IN_FLIGHT[movement])
        lost_s = time.monotonic()
        rig.node.popen.kill()
        end(rig, f"{movement}: discrete_move killed", future, lost_s, IN_FLIGHT[movement])


@pytest.mark.parametrize("movement", IN_FLIGHT)
@pytest.mark.parametrize("who", ["workstation", "next to the base"])
def test_a_killed_workstation_leaves_a_base_at_rest(tmp_path: Path, movement: str, who: str) -> None:
    with live_rig(tmp_path, next_to_base=who == "next to the base") as rig:
        if rig.node is None:
            send_line(rig.robot, "timeout 0.5")
        future = driving(rig, IN_FLIGHT[movement])
        kill_s = time.monotonic()
        rig.client.popen.kill()
        stood_s = rig.stood_after(kill_s)
        assert future.exception(PATIENCE_S) is not None
        zeroed_s, stood_at = rig.zeroed_after(kill_s), true_pose(rig.robot)
        rig.table.rows.append(FaultRow(f"{movement}: workstation killed", zeroed_s, stood_s, "interrupted", ""))
        assert stood_s < AT_REST_S
        assert is_at(rig.robot, stood_at)
