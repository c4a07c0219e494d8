"""Movements with parameters over ROS 1: accuracy, and faults while one is in flight."""

import math
import signal
import time
from collections.abc import Iterator
from concurrent.futures import Future
from typing import Any

import pytest

from tests.robots.drives import FREE, IN_FLIGHT
from tests.robots.fault_table import FaultRow
from tests.robots.ros1_rig import Rig, client_of, live_rig
from tests.ros1.network import HERE, PATIENCE_S, wait_until

pytestmark = pytest.mark.ros
AT_REST_S = 1.0
"""Limit from a fault to the command of zero velocity, and to rest, measured at the base."""


@pytest.fixture(scope="module")
def shared_rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with live_rig(tmp_path_factory.mktemp("ros")) as rig:
        yield rig


@pytest.fixture
def rig(shared_rig: Rig) -> Iterator[Rig]:
    """The shared robot in an episode, repaired after the test."""
    shared_rig.client("begin")
    yield shared_rig
    shared_rig.put_right()


def driving(rig: Rig, movement: dict[str, Any]) -> "Future[Any]":
    """Start a movement, and return once the base is really moving."""
    future = rig.client.later("drive", movement)
    wait_until(lambda: rig.probe.speed > 0.05 or future.done(), "the base moves")
    assert not future.done(), future.result()
    return future


def end(rig: Rig, cause: str, result: dict[str, Any], fault_s: float, movement: dict[str, Any]) -> None:
    """Check that the base was at rest in time, and that no further movement starts while the fault lasts."""
    times = rig.times(fault_s)
    second = rig.second("drive", movement)
    rig.row(cause, result, times, "–", second)
    assert not second.started
    assert max(times) < AT_REST_S


@pytest.mark.parametrize("name", FREE)
def test_a_movement_ends_where_it_was_asked_to(rig: Rig, name: str) -> None:
    movement, (x_m, y_m) = FREE[name]
    before = rig.client("observe")["pose"]
    result = rig.client("drive", movement)
    assert (result["completed"], result["failure"], result["blocked"]) == (True, "", "")
    at_m = [result["pose"][axis] - before[k] for k, axis in enumerate(("x_m", "y_m"))]
    cos, sin = math.cos(before[2]), math.sin(before[2])
    along_m, left_m = at_m[0] * cos + at_m[1] * sin, at_m[1] * cos - at_m[0] * sin
    assert math.hypot(along_m - x_m, left_m - y_m) < 0.02
    assert result["path_m"] >= math.hypot(x_m, y_m) - 0.03


def test_the_robot_of_vsnbenchs_own_node_executes_every_kind(rig: Rig) -> None:
    assert rig.client("kinds") == ["discrete", "move", "trajectory", "velocity", "waypoint"]


@pytest.mark.parametrize("movement", IN_FLIGHT)
@pytest.mark.parametrize(
    ("fault", "sensor_lost"),
    [("silent", True), ("nan", True), ("jump", True), ("bumper", False), ("cliff", False), ("stuck", False)],
)
def test_a_fault_of_the_base_ends_a_movement_in_flight(rig: Rig, movement: str, fault: str, sensor_lost: bool) -> None:
    future = driving(rig, IN_FLIGHT[movement])
    fault_s = rig.fault("base", fault)
    result = future.result(PATIENCE_S)
    assert result["completed"] is False
    assert result["failure"]
    assert result["sensor_lost"] is sensor_lost
    assert (result["collision"] or {}).get("source") == ("bumper" if fault == "bumper" else None)
    end(rig, f"{movement}: {fault}", result, fault_s, IN_FLIGHT[movement])


@pytest.mark.parametrize("movement", IN_FLIGHT)
def test_a_silent_depth_camera_blocks_a_movement_in_flight(rig: Rig, movement: str) -> None:
    future = driving(rig, IN_FLIGHT[movement])
    fault_s = rig.fault("camera", "silent")
    result = future.result(PATIENCE_S)
    assert result["completed"] is False
    assert "no depth image" in result["blocked"]
    end(rig, f"{movement}: depth camera silent", result, fault_s, IN_FLIGHT[movement])


@pytest.mark.parametrize("movement", IN_FLIGHT)
@pytest.mark.parametrize("ending", [signal.SIGKILL, signal.SIGSTOP])
def test_a_lost_server_stops_the_base(rig: Rig, movement: str, ending: signal.Signals) -> None:
    future = driving(rig, IN_FLIGHT[movement])
    rig.server.signal(ending)
    lost_s = time.monotonic()
    result = future.result(PATIENCE_S)
    assert result["completed"] is False
    end(rig, f"{movement}: discrete_move {ending.name}", result, lost_s, IN_FLIGHT[movement])
    if ending is signal.SIGSTOP:
        rig.server.signal(signal.SIGCONT)
    else:
        rig.start_server()
    assert rig.client("begin")


@pytest.mark.parametrize("movement", IN_FLIGHT)
def test_a_killed_client_leaves_a_base_at_rest(rig: Rig, movement: str) -> None:
    driving(rig, IN_FLIGHT[movement])
    rig.client.popen.kill()
    killed_s = time.monotonic()
    try:
        times = rig.times(killed_s)
        rig.table.rows.append(FaultRow(f"{movement}: vsnbench killed", *times, "interrupted", ""))
        assert max(times) < AT_REST_S
    finally:
        rig.client.close()
        rig.client = client_of(rig.network)


def test_a_server_like_upstreams_executes_discrete_actions_only(rig: Rig) -> None:
    rig.server.signal(signal.SIGKILL)
    rig.server.wait()
    server = rig.network.start(HERE / "nodes" / "upstream_like_server.py")
    try:
        rig.network.wait_for_service("/discrete_move")
        rig.restart_client()
        assert rig.client("kinds") == ["discrete"]
    finally:
        server.end()
        rig.start_server()
        rig.restart_client()
