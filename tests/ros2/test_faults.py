"""What stops a ROS 2 robot, brought about for real: time to standstill and what the episode is told.

`pytest tests/ros2/test_faults.py -s` prints the table. The base would go on for ever by itself, but
where the last two have it stand still when it hears nothing for 0.5 s, as a Create 3 does.
"""

import signal
import sys
import time
from collections.abc import Iterator

import pytest

from tests.robots.client import complaint
from tests.ros1.network import PATIENCE_S
from tests.ros2.graph import Rig2, live_rig, stands_since, start_discrete_move, told

pytestmark = pytest.mark.ros2
AT_REST_S = 5.0
"""The base would go on for ever; a machine that does much else may look away. What one takes is in docs/robot.md."""

ROWS: list[str] = []


@pytest.fixture(scope="module", params=["workstation", "beside the base"])
def rig(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig2]:
    with live_rig(tmp_path_factory.mktemp("ros2"), beside_base=request.param == "beside the base") as one:
        yield one
    sys.stdout.write("\n".join(["", *ROWS, ""]))
    ROWS.clear()


def row(rig: Rig2, cause: str, stood_s: float | None, said: str) -> None:
    stood = "stands" if stood_s is None else f"{stood_s:.2f} s"
    ROWS.append(f"| {'beside the base' if rig.node else 'workstation'} | {cause} | {stood} | {said} |")


@pytest.mark.parametrize(
    ("fault", "said", "sensor_lost"),
    [
        ("silent", "no odometry", True),
        ("nan", "odometry is not finite", True),
        ("jump", "odometry jumped 1.5", True),
        ("bumper", "bumper", False),
        ("cliff", "cliff (cliff_front_left)", False),
        ("stuck", "the base does not follow its commands", False),
    ],
)
def test_a_fault_in_a_movement_stops_the_base(rig, fault, said, sensor_lost) -> None:
    rig.client("begin")
    future = rig.moving("MOVE_FORWARD")
    fault_s = told(rig.robot, fault)
    stood_s = rig.stood_after(fault_s)
    result = future.result(PATIENCE_S)
    rig.put_right()
    row(rig, fault, stood_s, result["failure"])
    assert not result["completed"]
    assert said in result["failure"]
    assert result["sensor_lost"] is sensor_lost
    assert (result["collision"] or {}).get("source") == ("bumper" if fault == "bumper" else None)
    assert stood_s < AT_REST_S


@pytest.mark.parametrize("rig", ["workstation"], indirect=True)  # who steers changes nothing for the camera
@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("blind", "no image on /camera/color/image_raw and /camera/depth/image_raw"),
        ("small", "the color image is 32x24, the profile says 64x48"),
        ("past", "that was stamped after the motion"),
    ],
)
def test_a_camera_that_fails_is_named_while_the_robot_stands(rig, fault, said) -> None:
    rig.client("begin")
    assert rig.client("observe")["rgb"] == [48, 64, 3]
    told(rig.robot, fault)
    # Images count that were taken after the last motion, so there has to be one.
    assert rig.client("execute", "TURN_LEFT")["failure"] == ""
    refused = complaint(lambda: rig.client("observe"))
    assert said in refused
    assert refused.startswith("SensorLostError")
    rig.put_right()
    row(rig, f"camera {fault}", None, said)
    assert stands_since(rig.robot) is not None or "moves" not in rig.robot.output


def test_a_workstation_that_is_stopped_is_missed(rig) -> None:
    """By the node beside the base, or by the base, whose limit is that of a Create 3 and a Stretch."""
    rig.client("begin")
    if rig.node is None:
        told(rig.robot, "timeout 0.5")
    future = rig.moving("MOVE_FORWARD")
    stop_s = time.monotonic()
    rig.client.popen.send_signal(signal.SIGSTOP)
    try:
        stood_s = rig.stood_after(stop_s)
    finally:
        rig.client.popen.send_signal(signal.SIGCONT)
    result = future.result(PATIENCE_S)
    row(rig, "workstation stopped", stood_s, result["failure"] or "goes on")
    assert stood_s < AT_REST_S
    if rig.node is not None:
        assert "the caller went away" in result["failure"]


@pytest.mark.parametrize("rig", ["beside the base"], indirect=True)  # elsewhere there is none to be killed
def test_a_discrete_move_that_is_killed_is_missed_and_one_that_is_started_again_moves(rig) -> None:
    """After those that only stop: where all is on one machine, a killed process may hold up a base that shares memory
    with it, some 2 s, once in twenty times."""
    rig.client("begin")
    future = rig.moving("MOVE_FORWARD")
    kill_s = time.monotonic()
    rig.node.popen.kill()
    stood_s = rig.stood_after(kill_s)
    result = future.result(PATIENCE_S)
    row(rig, "discrete_move killed", stood_s, result["failure"])
    assert "has not steered for 3 s" in result["failure"]
    assert stood_s < AT_REST_S
    rig.node = start_discrete_move(rig.graph)
    rig.client("begin")
    assert rig.client("execute", "TURN_LEFT")["failure"] == ""


def test_a_workstation_that_is_killed_is_missed(rig) -> None:
    """The last one: the client is gone afterwards."""
    rig.client("begin")
    future = rig.moving("MOVE_FORWARD")
    kill_s = time.monotonic()
    rig.client.popen.kill()
    stood_s = rig.stood_after(kill_s)
    assert future.exception(PATIENCE_S) is not None
    row(rig, "workstation killed", stood_s, "")
    assert stood_s < AT_REST_S
