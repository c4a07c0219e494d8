"""Movements with parameters over ROS 1: accuracy, and faults while one is in flight."""

import math
import signal
import time
from collections.abc import Iterator

import pytest

from tests.robots.drives import FAULTS, FAULTS_IN_FLIGHT, FREE, IN_FLIGHT
from tests.robots.fault_table import FaultRow
from tests.robots.faulty_rig import STOPS_WITHIN_S, Ending
from tests.robots.ros1_rig import Rig, live_rig
from tests.ros.ros1.network import HERE, PATIENCE_S, wait_until

pytestmark = pytest.mark.ros
CAMERA_SILENT_S = 1.0
"""The camera is silent for longer than any image counts (0.5 s), also if the last one was late."""


@pytest.fixture(scope="module")
def shared_rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with live_rig(tmp_path_factory.mktemp("ros")) as rig:
        yield rig


@pytest.fixture
def rig(shared_rig: Rig) -> Rig:
    """The shared robot, in a new episode."""
    shared_rig.make_good()
    return shared_rig


def check(rig: Rig, cause: str, end: Ending, movement: str, says: str) -> None:
    """Check that the base stopped, and that no further movement starts while the fault lasts."""
    second = rig.second("drive", IN_FLIGHT[movement])
    rig.row(f"{movement}: {cause}", end.result, end.times, "–", second)
    end.check(says)
    assert not second.started


@pytest.mark.parametrize("name", FREE)
def test_a_movement_ends_where_it_was_asked_to(rig: Rig, name: str) -> None:
    movement, (x_m, y_m) = FREE[name]
    before = rig.client("observe")["pose"]
    result = rig.undisturbed("drive", movement, between=rig.make_good)  # each begins an episode, at the same pose
    assert (result["completed"], result["failure"], result["blocked"]) == (True, "", "")
    at_m = [result["pose"][axis] - before[k] for k, axis in enumerate(("x_m", "y_m"))]
    cos, sin = math.cos(before[2]), math.sin(before[2])
    along_m, left_m = at_m[0] * cos + at_m[1] * sin, at_m[1] * cos - at_m[0] * sin
    assert math.hypot(along_m - x_m, left_m - y_m) < 0.02
    assert result["path_m"] >= math.hypot(x_m, y_m) - 0.03


def test_the_robot_of_vsnbenchs_own_node_executes_every_kind(rig: Rig) -> None:
    assert rig.client("kinds") == ["discrete", "move", "sidestep", "trajectory", "velocity", "waypoint"]


@pytest.mark.parametrize(("movement", "fault"), FAULTS_IN_FLIGHT)
def test_a_fault_of_the_base_ends_a_movement_in_flight(rig: Rig, movement: str, fault: str) -> None:
    says, sensor_lost = FAULTS[fault]
    end = rig.end_by(lambda: rig.fault("base", fault), says, "drive", IN_FLIGHT[movement])
    check(rig, fault, end, movement, says)
    assert end.result["sensor_lost"] is sensor_lost
    assert (end.result["collision"] or {}).get("source") == ("bumper" if fault == "bumper" else None)


@pytest.mark.parametrize("movement", ["waypoint", pytest.param("velocity", marks=pytest.mark.long)])
def test_a_silent_depth_camera_blocks_a_movement_in_flight(rig: Rig, movement: str) -> None:
    says = "no depth image"
    end = rig.end_by(lambda: rig.fault("camera", "silent"), says, "drive", IN_FLIGHT[movement])
    ended_s = time.monotonic()
    wait_until(lambda: time.monotonic() - ended_s > CAMERA_SILENT_S, "the camera is silent for a while")
    check(rig, "depth camera silent", end, movement, says)
    assert end.result["blocked"]


@pytest.mark.parametrize(
    ("movement", "ending"),
    [
        ("waypoint", signal.SIGKILL),
        ("velocity", signal.SIGSTOP),
        pytest.param("velocity", signal.SIGKILL, marks=pytest.mark.long),
        pytest.param("waypoint", signal.SIGSTOP, marks=pytest.mark.long),
    ],
)
def test_a_lost_server_stops_the_base(rig: Rig, movement: str, ending: signal.Signals) -> None:
    says = "disappeared" if ending is signal.SIGKILL else "has not steered"
    end = rig.end_by(lambda: rig.signalled(ending), says, "drive", IN_FLIGHT[movement])
    check(rig, f"discrete_move {ending.name}", end, movement, says)


@pytest.mark.parametrize("movement", ["waypoint", pytest.param("velocity", marks=pytest.mark.long)])
def test_a_killed_client_leaves_a_base_at_rest(rig: Rig, movement: str) -> None:
    rig.moving("drive", IN_FLIGHT[movement])
    rig.client.popen.kill()
    killed_s = time.monotonic()
    times = rig.zeroed_after(killed_s), rig.stood_after(killed_s)
    rig.table.rows.append(FaultRow(f"{movement}: vsnbench killed", *times, "interrupted", ""))
    assert max(times) < STOPS_WITHIN_S


@pytest.mark.parametrize(
    "fault", ["bumper", *(pytest.param(name, marks=pytest.mark.long) for name in FAULTS if name != "bumper")]
)
def test_a_fault_of_the_base_ends_driving_on(rig: Rig, fault: str) -> None:
    """The robot drives on, with a new path every 0.3 s."""
    says, sensor_lost = FAULTS[fault]
    end = rig.end_by(lambda: rig.fault("base", fault), says, "drive_on", IN_FLIGHT["waypoint"])
    end.check(says)
    assert end.result["sensor_lost"] is sensor_lost
    rig.row(f"driving on: {fault}", end.result, end.times, "–", "–")


@pytest.mark.long
def test_a_silent_camera_blocks_driving_on(rig: Rig) -> None:
    end = rig.end_by(lambda: rig.fault("camera", "silent"), "no depth image", "drive_on", IN_FLIGHT["waypoint"])
    end.check("no depth image")
    assert end.result["blocked"]


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_client_that_is_gone_leaves_a_base_that_drove_on_at_rest(rig: Rig, number: signal.Signals) -> None:
    """The node stops the base; the resumed client does not continue."""
    future = rig.moving("drive_on", IN_FLIGHT["waypoint"])
    rig.client.popen.send_signal(number)
    gone_s = time.monotonic()
    times = rig.zeroed_after(gone_s), rig.stood_after(gone_s)
    if number is signal.SIGSTOP:
        wait_until(lambda: time.monotonic() - gone_s > 2.0, "the client is stopped for a while")
        stood_at = rig.true_pose
        rig.client.popen.send_signal(signal.SIGCONT)
        assert future.result(PATIENCE_S)["completed"] is False
        assert math.dist(rig.true_pose[:2], stood_at[:2]) < 0.005
    rig.table.rows.append(FaultRow(f"driving on: vsnbench {number.name}", *times, "", ""))
    assert max(times) < STOPS_WITHIN_S


@pytest.mark.long
@pytest.mark.parametrize("ending", [signal.SIGKILL, signal.SIGSTOP])
def test_a_lost_server_stops_a_base_that_drove_on(rig: Rig, ending: signal.Signals) -> None:
    end = rig.end_by(lambda: rig.signalled(ending), "has not steered", "drive_on", IN_FLIGHT["waypoint"])
    end.check("has not steered")


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
