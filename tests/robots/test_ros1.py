"""The client of a ROS robot: what it sees, what it asks for, and how it ends when a part of the robot fails."""

import re
import signal
import time
from collections.abc import Iterator

import pytest

from tests.robots.client import ClientError, can
from tests.robots.ros1_rig import PROFILE, Rig, client_of, live_rig
from tests.ros1.network import HERE, PATIENCE_S, wait_until

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def shared_rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with live_rig(tmp_path_factory.mktemp("ros")) as rig:
        yield rig


@pytest.fixture
def rig(shared_rig: Rig) -> Iterator[Rig]:
    """The shared robot with an episode begun, and put right again after the test."""
    shared_rig.client("begin")
    yield shared_rig
    shared_rig.put_right()


def test_a_robot_that_nothing_can_place_is_placed_by_a_person(rig) -> None:
    begun = rig.client("begin")
    assert begun["asked"] == [""]
    assert begun["simulated"] is False
    assert begun["sensors"] == ["depth", "odometry", "rgb"]


def test_a_person_is_asked_again_while_a_wheel_hangs(rig) -> None:
    rig.fault("base", "drop")
    future = rig.client.later("begin")
    wait_until(lambda: not future.done(), "the person is asked")
    time.sleep(0.5)
    rig.fault("base", "raise")
    asked = future.result(PATIENCE_S)["asked"]
    assert asked[1:]
    assert all("wheel drop" in problem for problem in asked[1:])


def test_odometry_and_place_are_reckoned_from_the_start(rig) -> None:
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
    ("word", "says"),
    [
        ("silent", "SensorLostError: no image on /camera/color/image_raw and /camera/depth/image_raw"),
        ("blind", "SensorLostError: no image on /camera/depth/image_raw"),
        ("small", "SensorLostError: the color image is 32x24, the profile says 64x48"),
        ("yuv", "SensorLostError: a colour image is encoded as 'yuv422'"),
        ("past", "SensorLostError: images come on .* are the clocks in step"),
    ],
)
def test_a_camera_that_fails_is_a_lost_sensor(rig, word, says) -> None:
    rig.fault("camera", word)

    def failure() -> str:
        # Frames from before the fault may still do for one look.
        try:
            rig.client("observe")
            rig.client("execute", "STOP")
        except ClientError as error:
            return str(error)
        return ""

    failures = iter(failure, None)
    assert re.search(says, next(text for text in failures if text))
    rig.fault("camera", "good")
    wait_until(lambda: can(lambda: rig.client("observe")), "the camera is back")


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
def test_a_base_that_fails_during_a_movement_stands_still_and_says_why(rig, word, says, sensor_lost) -> None:
    future = rig.moving("TURN_LEFT")
    fault_s = rig.fault("base", word)
    result = future.result(PATIENCE_S)
    assert result["completed"] is False
    assert says in result["failure"]
    assert result["sensor_lost"] is sensor_lost
    assert result["collision"] is None
    assert rig.stands_still_within(1.0, fault_s)


def test_a_bumper_is_a_collision(rig) -> None:
    future = rig.moving("MOVE_FORWARD")
    fault_s = rig.fault("base", "bumper")
    result = future.result(PATIENCE_S)
    assert result["completed"] is False
    assert result["collision"] == {"source": "bumper", "touched": "centre"}
    assert rig.stands_still_within(1.0, fault_s)


def test_odometry_that_stays_silent_is_a_lost_sensor_before_the_next_action(rig) -> None:
    rig.fault("base", "silent")

    def lost() -> bool:
        try:
            rig.client("observe")
        except ClientError as error:
            return "no odometry on /odom" in str(error)
        return False

    wait_until(lost, "the silence is noticed")


def test_a_server_killed_during_a_movement_is_noticed_and_the_base_told_to_stand(rig) -> None:
    future = rig.moving("TURN_LEFT")
    rig.server.signal(signal.SIGKILL)
    killed_s = time.monotonic()
    result = future.result(PATIENCE_S)
    assert "/discrete_move went away" in result["failure"]
    assert rig.stands_still_within(1.0, killed_s)
    with pytest.raises(ClientError, match="vsnbench ros1 discrete-move"):
        rig.client("begin")
    rig.start_server()
    assert rig.client("begin")
    assert rig.client("execute", "TURN_LEFT")["completed"]


def test_a_server_wedged_during_a_movement_is_noticed_and_the_base_told_to_stand(rig) -> None:
    future = rig.moving("TURN_LEFT")
    rig.server.signal(signal.SIGSTOP)
    stopped_s = time.monotonic()
    result = future.result(PATIENCE_S)
    assert "has not steered" in result["failure"]
    assert rig.stands_still_within(1.0, stopped_s)
    rig.server.signal(signal.SIGCONT)
    assert rig.client("begin")
    assert rig.client("execute", "TURN_LEFT")["completed"]


def test_a_client_that_is_killed_leaves_a_base_that_stands(rig) -> None:
    rig.moving("TURN_LEFT")
    rig.client.popen.kill()
    killed_s = time.monotonic()
    assert rig.stands_still_within(2.0, killed_s)
    rig.client.close()
    rig.client = client_of(rig.network)


def test_a_second_client_is_refused_and_told_who_is_there(rig) -> None:
    second = rig.network.start(HERE / "nodes" / "client.py", str(PROFILE), "6")
    assert second.wait() != 0
    assert f"/vsnbench is already running on this robot (process {rig.client.popen.pid}" in second.output
    assert rig.client("execute", "STOP")["completed"]


def test_a_server_that_behaves_as_upstreams_is_checked_against_the_odometry(rig) -> None:
    """It assumes heading 0 at start-up, so its first turn goes anywhere; it says True all the same."""
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
        assert "answered True to Left, but the odometry" in turned["failure"]
        # From now on its own idea of its heading is right, to its tolerance of 4.6 degrees.
        turned = rig.client("execute", "TURN_LEFT")
        assert turned["completed"], turned["failure"]
        assert turned["turn_deg"] == pytest.approx(30, abs=9.2)
        rig.fault("base", "slip")
        shorter = rig.client("execute", "MOVE_FORWARD")
        assert shorter["completed"], "odometry reports what was driven, however slowly"
    finally:
        like_upstream.end()
        rig.start_server()
        rig.restart_client()
        wait_until(lambda: can(lambda: rig.client("begin")), "our own server serves again")


def test_a_master_that_dies_does_not_end_an_episode_but_the_next_one_cannot_begin(rig) -> None:
    rig.network.roscore.signal(signal.SIGKILL)
    rig.network.roscore.wait()
    assert rig.client("observe")
    assert rig.client("execute", "TURN_LEFT")["completed"]
    with pytest.raises(ClientError, match=r"no ROS master answers at .* is roscore running there"):
        rig.client("begin")
