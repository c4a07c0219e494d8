"""A ROS 2 base with odometry in TF only; frames that do not connect are named."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

from tests.processes import Process, wait_until
from tests.ros.ros2.graph import HERE, PROFILE, Graph2, client_of, live_graph, send_line
from tests.ros.ros2.interface_package import can_have, has_package, package_of

pytestmark = [
    pytest.mark.ros2,
    pytest.mark.skipif(not can_have("tf2_msgs"), reason="needs tf2_msgs, or gcc and the generators of the wheels"),
]
DISCONNECTED = "odom to base_link: odom has no parent, base_link has no parent; links seen: odom to base_footprint"


LiveRobot = Callable[..., AbstractContextManager[tuple[Graph2, Path, Process]]]


@pytest.fixture
def live_tf_robot(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory) -> LiveRobot:
    packages = package_of("tf2_msgs", tmp_path_factory)
    return lambda *words: _robot(tmp_path, packages, *words)


@contextmanager
def _robot(directory: Path, packages: Path | None, *words: str) -> Iterator[tuple[Graph2, Path, Process]]:
    profile = directory / "tf_base.yaml"
    frames = "  kind: ros2\n  tf: {odom_frame: odom, base_frame: base_link}\n"
    profile.write_text(PROFILE.read_text(encoding="utf-8").replace("  kind: ros2\n", frames))
    with live_graph(directory, packages=packages) as graph:
        robot = graph.start(HERE / "nodes" / "robot.py")
        broadcaster = graph.start(HERE / "nodes" / "tf_broadcaster.py", *words)
        for process in (robot, broadcaster):
            wait_until(lambda one=process: "up" in one.output, "the robot is up")
        send_line(robot, "timeout 0.5")
        yield graph, profile, broadcaster


def doctor(graph: Graph2, profile: Path, *words: str, **environment: str) -> Process:
    command = ["doctor", "--robot", profile, *words, "--results", graph.directory]
    done = graph.vsnbench(*command, COLUMNS="300", **environment)
    done.wait(120)
    return done


def test_a_base_is_driven_by_the_odometry_of_its_frames(live_tf_robot: LiveRobot) -> None:
    with live_tf_robot() as (graph, profile, broadcaster):
        client = client_of(graph, profile)
        try:
            client("begin")
            moved = client("execute", "MOVE_FORWARD")
            assert moved["failure"] == ""
            assert moved["displacement_m"] == pytest.approx(0.25, abs=0.005)
            assert client("execute", "TURN_LEFT")["turn_deg"] == pytest.approx(30, abs=0.2)
            assert broadcaster.popen.poll() is None
        finally:
            client.close()


@pytest.mark.long
def test_a_session_names_frames_that_do_not_connect(live_tf_robot: LiveRobot) -> None:
    with (
        live_tf_robot("--no-fixed") as (graph, profile, _),
        pytest.raises(AssertionError, match=DISCONNECTED),
    ):
        client_of(graph, profile, 2.0)


@pytest.mark.long
@pytest.mark.skipif(has_package("tf2_msgs"), reason="needs a machine without tf2_msgs; the pip wheels have none")
def test_doctor_reports_that_tf2_msgs_is_missing(live_tf_robot: LiveRobot) -> None:
    with live_tf_robot() as (graph, profile, _):
        done = doctor(graph, profile, PYTHONPATH=str(HERE.parents[2]))
        assert done.popen.returncode == 1
        assert "odometry from TF needs the Python module tf2_msgs" in done.output


@pytest.mark.long
def test_doctor_sees_the_odometry_of_frames_follow_a_turn(live_tf_robot: LiveRobot) -> None:
    with live_tf_robot() as (graph, profile, _):
        done = doctor(graph, profile, "--move")
        assert done.popen.returncode == 0, done.output
        assert "TF connects them" in done.output
        assert "the odometry turned +30" in done.output


@pytest.mark.long
def test_doctor_names_frames_that_do_not_connect(live_tf_robot: LiveRobot) -> None:
    with live_tf_robot("--no-fixed") as (graph, profile, _):
        done = doctor(graph, profile)
        assert done.popen.returncode == 1
        assert DISCONNECTED in done.output
