"""The client of a ROS 1 robot: observations, movements, and faults of the parts of the robot.

`FAULT_TABLE=1 pytest -s tests/robots/test_ros1.py` prints the table of faults, and has `doctor` examine each.
"""

import math
import signal
import time
from collections.abc import Iterator

import pytest

from tests.robots.client import ClientError, can
from tests.robots.fault_table import FaultRow, held
from tests.robots.faulty_rig import STOPS_WITHIN_S
from tests.robots.ros1_rig import PROFILE, Rig, live_rig
from tests.ros.ros1.network import HERE, PATIENCE_S, wait_until

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def shared_rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with live_rig(tmp_path_factory.mktemp("ros")) as rig:
        yield rig


@pytest.fixture
def rig(shared_rig: Rig) -> Rig:
    """The shared robot, in a new episode."""
    shared_rig.make_good()
    return shared_rig


def test_a_robot_without_a_simulator_is_placed_by_an_operator(rig) -> None:
    begun = rig.client("begin")
    assert begun["asked"] == [""]
    assert begun["simulated"] is False
    assert begun["sensors"] == ["depth", "odometry", "rgb"]


def test_the_operator_is_asked_again_while_a_wheel_is_dropped(rig) -> None:
    rig.fault("base", "drop")
    future = rig.client.later("begin")
    wait_until(lambda: not future.done(), "the operator is asked")
    time.sleep(0.5)
    rig.fault("base", "raise")
    asked = future.result(PATIENCE_S)["asked"]
    assert asked[1:]
    assert all("wheel drop" in problem for problem in asked[1:])


def test_odometry_and_pose_are_relative_to_the_start(rig) -> None:
    assert rig.client("observe")["pose"] == pytest.approx([0, 0, 0], abs=1e-6)
    result = rig.client("execute", "MOVE_FORWARD")
    assert result["completed"], result["failure"]
    assert result["displacement_m"] == pytest.approx(0.25, abs=0.005)
    assert result["pose"]["x_m"] == pytest.approx(0.25, abs=0.006)
    turned = rig.client("execute", "TURN_LEFT")
    assert turned["turn_deg"] == pytest.approx(30, abs=0.2)
    x, y, heading, source = rig.client("locate")
    # The start is at (2, 1) and faces 90 degrees.
    assert (x, y) == pytest.approx((2.0, 1.25), abs=0.01)
    assert heading == pytest.approx(2.0944, abs=0.01)
    assert source == "estimated"


def test_another_publisher_ends_a_movement_at_once_and_the_base_is_held(rig) -> None:
    rival = rig.network.start(HERE / "nodes" / "rival.py")
    try:
        wait_until(lambda: rig.probe.speed > 0.15, "the rival drives the base")
        result = rig.client("execute", "TURN_LEFT")
        held_at, began_s = rig.probe.position, time.monotonic()
        wait_until(lambda: time.monotonic() - began_s > 2.0, "the base is held for two seconds")
        moved_m = math.dist(rig.probe.position, held_at)
        second = rig.second("execute", "TURN_RIGHT")
        rig.row("another publisher", result, (None, None), rig.doctor(), held(second))
    finally:
        rival.end()
    assert "/rival also commands velocities on /cmd_vel" in result["failure"]
    assert abs(result["turn_deg"]) < 5
    assert moved_m < 0.2
    assert "/rival also commands velocities on /cmd_vel" in second.why
    assert abs(second.turned_deg) < 5


def test_backward_is_negative_and_stop_moves_nothing(rig) -> None:
    assert rig.client("execute", "MOVE_BACKWARD")["displacement_m"] == pytest.approx(-0.25, abs=0.005)
    stopped = rig.client("execute", "STOP")
    assert stopped["completed"]
    assert stopped["displacement_m"] == pytest.approx(0, abs=1e-6)


def test_images_are_younger_than_the_motion_and_depth_is_the_median_of_several(rig) -> None:
    rig.fault("camera", "holes")
    rig.client("execute", "TURN_RIGHT")
    ended_s = rig.client("stamp")
    seen = rig.client("observe")
    assert seen["rgb"] == [48, 64, 3]
    assert seen["stamp_s"] > ended_s - 0.3
    assert abs(seen["stamp_s"] - seen["depth_stamp_s"]) <= 0.1
    assert seen["capture"]["depth_frames"] == 5
    wait_until(lambda: rig.client("observe")["capture"]["invalid_before"] > 0.02, "the camera has holes")
    seen = rig.client("observe")
    assert seen["capture"]["invalid_after"] < seen["capture"]["invalid_before"]


@pytest.mark.parametrize(
    ("word", "code", "shows"),
    [
        ("silent", "no-image", "/camera/color/image_raw and /camera/depth/image_raw"),
        ("blind", "no-image", "/camera/depth/image_raw"),
        ("small", "wrong-image-size", "32x24"),
        ("yuv", "invalid-image", "'yuv422'"),
        ("past", "no-matching-images", "/camera/color/image_raw"),
    ],
)
def test_a_camera_that_fails_is_a_lost_sensor(rig, word, code, shows) -> None:
    rig.fault("camera", word)
    found: list[ClientError | None] = []

    def failure() -> ClientError | None:
        # Images from before the fault may still serve one observation.
        try:
            rig.client("observe")
            rig.client("execute", "STOP")
        except ClientError as error:
            return error
        return None

    wait_until(lambda: found.append(failure()) or found[-1] is not None, "the fault is detected")
    assert found[-1].code == code
    assert str(found[-1]).startswith("SensorLostError")
    assert shows in str(found[-1])
    second = rig.second("step", "TURN_LEFT")
    end = {"failure": str(found[-1]).partition(": ")[2], "end_reason": found[-1].end_reason}
    rig.row(f"camera {word}", end, (None, None), rig.doctor(), second)
    assert not second.started
    rig.fault("camera", "good")
    wait_until(lambda: can(lambda: rig.client("observe")), "the camera works again")


@pytest.mark.parametrize(
    ("word", "says", "sensor_lost"),
    [
        ("silent", "no odometry", True),
        ("nan", "odometry is not finite", True),
        ("jump", "odometry jumped", True),
        ("cliff", "cliff (left)", False),
        ("drop", "wheel drop (left)", False),
        ("stuck", "does not follow", False),
    ],
)
def test_a_base_that_fails_during_a_movement_stops_with_a_reason(rig, word, says, sensor_lost) -> None:
    end = rig.end_by(lambda: rig.fault("base", word), says, "execute", "TURN_LEFT")
    second = rig.second("execute", "TURN_LEFT")
    rig.row(word, end.result, end.times, rig.doctor(*["--move"] * (word == "stuck")), second)
    end.check(says)
    assert end.result["sensor_lost"] is sensor_lost
    assert end.result["collision"] is None
    assert not second.started


def test_a_bumper_is_a_collision(rig) -> None:
    end = rig.end_by(lambda: rig.fault("base", "bumper"), "bumper", "execute", "MOVE_FORWARD")
    second = rig.second("execute", "MOVE_FORWARD")
    rig.row("bumper", end.result, end.times, rig.doctor(), second)
    end.check("bumper")
    assert end.result["collision"] == {"source": "bumper", "touched": "centre"}
    assert not second.started


def test_odometry_that_stays_silent_is_a_lost_sensor_before_the_next_action(rig) -> None:
    rig.fault("base", "silent")

    def lost() -> bool:
        try:
            rig.client("observe")
        except ClientError as error:
            return error.code == "no-odometry"
        return False

    wait_until(lost, "the silence is detected")


def test_a_server_killed_during_a_movement_is_detected_and_the_base_stopped(rig) -> None:
    end = rig.end_by(lambda: rig.signalled(signal.SIGKILL), "disappeared", "execute", "TURN_LEFT")
    second = rig.second("execute", "TURN_LEFT")
    rig.row("discrete_move killed", end.result, end.times, rig.doctor(), second)
    end.check("/discrete_move disappeared")
    assert not second.started
    with pytest.raises(ClientError, match="vsnbench robots serve"):
        rig.client("begin")
    rig.start_server()
    assert rig.client("begin")
    assert rig.undisturbed("execute", "TURN_LEFT")["completed"]


def test_a_hanging_server_is_detected_during_a_movement_and_the_base_stopped(rig) -> None:
    end = rig.end_by(lambda: rig.signalled(signal.SIGSTOP), "has not steered", "execute", "TURN_LEFT")
    second = rig.second("execute", "TURN_LEFT")
    rig.row("discrete_move stopped", end.result, end.times, rig.doctor(), second)
    end.check("has not steered")
    assert not second.started
    before = rig.probe.pose
    resumed_s = rig.signalled(signal.SIGCONT)
    wait_until(lambda: time.monotonic() - resumed_s > 1.0, "the resumed server could act on the old requests")
    assert rig.probe.pose == before
    assert rig.client("begin")
    assert rig.undisturbed("execute", "TURN_LEFT")["completed"]


def test_a_killed_client_leaves_a_base_at_rest(rig) -> None:
    rig.moving("execute", "TURN_LEFT")
    rig.client.popen.kill()
    killed_s = time.monotonic()
    times = rig.zeroed_after(killed_s), rig.stood_after(killed_s)
    rig.table.rows.append(FaultRow("vsnbench killed", *times, "interrupted", "", rig.doctor()))
    assert max(times) < STOPS_WITHIN_S


def test_a_second_client_is_refused_and_names_the_first(rig) -> None:
    second = rig.network.start(HERE / "nodes" / "client.py", str(PROFILE), "6")
    assert second.wait() != 0
    assert f"/vsnbench is already running on this robot (process {rig.client.popen.pid}" in second.output
    assert rig.client("execute", "STOP")["completed"]


def test_a_server_like_upstreams_is_compared_with_the_odometry(rig) -> None:
    """It assumes heading 0 at start-up, so its first turn is wrong, but it answers True."""
    rig.server.end()
    like_upstream = rig.network.start(HERE / "nodes" / "upstream_like_server.py")
    try:
        rig.network.wait_for_service("/discrete_move")
        rig.restart_client()
        rig.client("begin")
        moved = rig.client("execute", "MOVE_FORWARD")
        assert moved["completed"], moved["failure"]
        assert 0.2 < moved["displacement_m"] < 0.35
        turned = rig.client("execute", "TURN_LEFT")
        assert turned["completed"] is False
        # Each turn ends with its wrong answer, or earlier if it goes too far, until the heading fits.
        for _ in range(20):
            if turned["completed"]:
                break
            failure = turned["failure"]
            assert "answered True to turn left by 30°, but the odometry" in failure or "has turned" in failure
            turned = rig.client("execute", "TURN_LEFT")
        assert turned["completed"], turned["failure"]
        assert turned["turn_deg"] == pytest.approx(30, abs=9.2)
        rig.fault("base", "slip")
        shorter = rig.client("execute", "MOVE_FORWARD")
        assert shorter["completed"], "the odometry reports the distance, however slow the base is"
    finally:
        like_upstream.end()


@pytest.mark.long
def test_a_master_that_dies_does_not_end_an_episode_but_the_next_one_cannot_begin(rig) -> None:
    rig.network.roscore.signal(signal.SIGKILL)
    rig.network.roscore.wait()
    assert rig.client("observe")
    assert rig.undisturbed("execute", "TURN_LEFT")["completed"]
    with pytest.raises(ClientError) as refused:
        rig.client("begin")
    assert refused.value.code == "no-ros-master"
    second = rig.second("begin")
    assert not second.started
    end = {"failure": str(refused.value).partition(": ")[2], "end_reason": "the next episode does not begin"}
    rig.row("master killed", end, (None, None), rig.doctor(), second)
