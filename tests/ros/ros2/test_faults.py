"""Faults of a ROS 2 robot during discrete actions: the base stops, the episode ends for the reason, and none follows.

`FAULT_TABLE=1 pytest tests/ros/ros2/test_faults.py -s` prints the table, and has `doctor` examine each fault. The base
would never stop by itself, except in the last two tests, where it has a limit of 0.5 s, like a Create 3.
"""

import math
import signal
import time
from collections.abc import Iterator

import pytest

from tests.processes import wait_until
from tests.robots.client import ClientError
from tests.robots.fault_table import Attempt, FaultRow, held
from tests.robots.faulty_rig import STOPS_WITHIN_S
from tests.ros.ros1.network import PATIENCE_S
from tests.ros.ros2.graph import (
    HERE,
    client_of,
    is_at,
    live_graph,
    moves,
    send_line,
    stands_since,
    start_discrete_move,
    true_pose,
)
from tests.ros.ros2.rig import Rig2, live_rig

pytestmark = pytest.mark.ros2


@pytest.fixture(scope="module", params=["workstation", "next to the base"])
def shared_rig(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig2]:
    with live_rig(tmp_path_factory.mktemp("ros2"), next_to_base=request.param == "next to the base") as one:
        yield one


@pytest.fixture
def rig(shared_rig: Rig2) -> Rig2:
    """The shared robot, in a new episode."""
    shared_rig.make_good()
    return shared_rig


def row(
    rig: Rig2,
    cause: str,
    times: tuple[float | None, float | None],
    end: tuple[str, str],
    second: Attempt | str = "–",
    *examined: str,
) -> None:
    rig.table.rows.append(FaultRow(cause, *times, *end, rig.doctor(*examined), str(second)))


def ended(result: dict) -> tuple[str, str]:
    return result["end_reason"], result["failure"]


FAULTS = [
    ("silent", "no odometry", True),
    ("nan", "odometry is not finite", True),
    ("jump", "odometry jumped 1.5", True),
    ("bumper", "bumper", False),
    ("cliff", "cliff (cliff_front_left)", False),
    ("stuck", "the base does not follow its commands", False),
]
IN_LANES = [
    pytest.param(lane, *fault, marks=() if (place + number) % 2 == 0 else pytest.mark.long)
    for place, lane in enumerate(("workstation", "next to the base"))
    for number, fault in enumerate(FAULTS)
]
"""Every fault in one lane; in the other it is a long test."""


@pytest.mark.parametrize(("shared_rig", "fault", "said", "sensor_lost"), IN_LANES, indirect=["shared_rig"])
def test_a_fault_in_a_movement_stops_the_base(rig, fault, said, sensor_lost) -> None:
    end = rig.end_by(lambda: send_line(rig.robot, fault), said, "execute", "MOVE_FORWARD")
    second = rig.second("execute", "MOVE_FORWARD")
    row(rig, fault, end.times, ended(end.result), second)
    end.check(said)
    assert end.result["sensor_lost"] is sensor_lost
    assert (end.result["collision"] or {}).get("source") == ("bumper" if fault == "bumper" else None)
    assert not second.started


@pytest.mark.parametrize(
    "shared_rig", ["workstation", pytest.param("next to the base", marks=pytest.mark.long)], indirect=True
)
def test_another_publisher_ends_a_movement_at_once(rig) -> None:
    rival = rig.graph.start(HERE / "nodes" / "rival.py", *(["--stamped"] if rig.node else []))
    try:
        wait_until(lambda: moves(rig.robot), "the rival drives the base")
        # The client may discover the rival's publisher only now, and the name of its node still later.
        discovering = []
        while not (discovering and "/rival" in discovering[-1]["failure"]) and len(discovering) < 5:
            discovering.append(rig.client("execute", "TURN_LEFT"))
            rig.client("halt")
        result = rig.client("execute", "TURN_LEFT")
        second = rig.second("execute", "TURN_RIGHT")
        row(rig, "another publisher", (None, None), ended(result), held(second))
    finally:
        rival.end()
    # The name of a rival of an earlier try stays in the graph for some seconds: "/rival (no. 2)".
    for why in (second.why, result["failure"]):
        assert why.startswith("/rival")
        assert "also commands velocities on /cmd_vel" in why
    assert not any(movement["completed"] for movement in discovering)
    assert abs(second.turned_deg) < 5
    assert abs(result["turn_deg"]) < 15


@pytest.mark.parametrize(
    "shared_rig", ["workstation"], indirect=True
)  # the camera does not depend on the steering node
@pytest.mark.parametrize(
    ("fault", "code"),
    [
        ("blind", "no-image"),
        ("small", "wrong-image-size"),
        pytest.param("past", "no-matching-images", marks=pytest.mark.long),
    ],
)
def test_a_camera_that_fails_is_a_lost_sensor(rig, fault, code) -> None:
    assert rig.client("observe")["rgb"] == [48, 64, 3]
    send_line(rig.robot, fault)
    # Only images from after the last motion count, so there has to be a motion.
    assert rig.undisturbed("execute", "TURN_LEFT")["failure"] == ""
    with pytest.raises(ClientError, match="SensorLostError") as lost:
        rig.client("observe")
    second = rig.second("step", "TURN_LEFT")
    row(rig, f"camera {fault}", (None, None), (lost.value.end_reason, str(lost.value).partition(": ")[2]), second)
    assert lost.value.code == code
    assert not second.started
    assert stands_since(rig.robot) is not None


@pytest.mark.parametrize(
    "shared_rig", ["workstation", pytest.param("next to the base", marks=pytest.mark.long)], indirect=True
)
def test_a_base_stops_when_the_workstation_is_stopped(rig) -> None:
    """The node next to the base stops it, or the base itself, with the limit of a Create 3 and a Stretch."""
    if rig.node is None:
        send_line(rig.robot, "timeout 0.5")
    future = rig.moving("execute", "MOVE_FORWARD")
    stop_s = time.monotonic()
    rig.client.popen.send_signal(signal.SIGSTOP)
    stood_s = rig.stood_after(stop_s)
    zeroed_s = rig.zeroed_after(stop_s)
    wait_until(lambda: time.monotonic() - stop_s > 1.5, "the workstation was stopped for a while")
    stood_at = true_pose(rig.robot)
    rig.client.popen.send_signal(signal.SIGCONT)
    result = future.result(PATIENCE_S)
    row(rig, "workstation stopped, then resumed", (zeroed_s, stood_s), ended(result))
    assert is_at(rig.robot, stood_at)
    assert stood_s < STOPS_WITHIN_S
    says = "the control loop paused" if rig.node is None else "the caller has disconnected"
    # DDS can deliver nothing to a resumed process for two seconds.
    assert any(words in result["failure"] for words in (says, "no odometry", "the robot is silent"))


@pytest.mark.parametrize("shared_rig", ["next to the base"], indirect=True)  # only this rig has a server to kill
def test_a_killed_discrete_move_is_detected_and_a_restarted_one_moves(rig) -> None:
    def kill() -> float:
        rig.node.popen.kill()
        return time.monotonic()

    end = rig.end_by(kill, "has not steered for 3 s", "execute", "MOVE_FORWARD")
    second = rig.second("execute", "TURN_LEFT")
    row(rig, "discrete_move killed", end.times, ended(end.result), second)
    end.check("has not steered for 3 s")
    assert not second.started
    rig.node = start_discrete_move(rig.graph)
    rig.client("begin")
    assert rig.undisturbed("execute", "TURN_LEFT")["failure"] == ""


def test_a_base_stops_when_the_workstation_is_killed(rig) -> None:
    if rig.node is None:
        send_line(rig.robot, "timeout 0.5")
    future = rig.moving("execute", "MOVE_FORWARD")
    kill_s = time.monotonic()
    rig.client.popen.kill()
    stood_s = rig.stood_after(kill_s)
    assert future.exception(PATIENCE_S) is not None
    before = true_pose(rig.robot)
    row(rig, "workstation killed", (rig.zeroed_after(kill_s), stood_s), ("interrupted", ""))
    assert is_at(rig.robot, before)
    assert stood_s < STOPS_WITHIN_S


@pytest.mark.long
def test_a_base_with_noise_at_rest_moves_accurately(tmp_path) -> None:
    """tests/sensing/test_mover.py has the rules; here, messages carry the noise."""
    with live_graph(tmp_path) as graph:
        robot = graph.start(HERE / "nodes" / "robot.py", "--noise", "0.05", "0.002")
        client = client_of(graph)

        try:
            client("begin")
            held_deg = true_pose(robot)[2]
            for action in ["TURN_LEFT", "MOVE_FORWARD", "TURN_RIGHT", "MOVE_BACKWARD", "TURN_LEFT"] * 2:
                before = true_pose(robot)
                result = client("execute", action)
                assert result["completed"], result["failure"]
                after = true_pose(robot)
                if action.startswith("TURN"):
                    held_deg += 30 if action == "TURN_LEFT" else -30
                    assert math.remainder(after[2] - held_deg, 360) == pytest.approx(0, abs=0.1)
                else:
                    assert math.dist(before[:2], after[:2]) == pytest.approx(0.25, abs=0.005)
        finally:
            client.close()
