"""`vsnbench doctor` over ROS 2: watchdog, odometry and bumper of a base."""

import pytest

from tests.processes import Process, wait_until
from tests.ros.ros2.graph import HERE, PROFILE, Graph2, live_graph, send_line, stands_since
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros.watchdog import WatchdogMeasurement

pytestmark = pytest.mark.ros2
ATTEMPTS = 4


def doctor(graph: Graph2) -> Process:
    """Let `doctor` move the base, again if it finds this machine overloaded."""
    for _ in range(ATTEMPTS):
        done = graph.vsnbench("doctor", "--robot", PROFILE, "--move", "--results", graph.directory, COLUMNS="200")
        done.wait(120)
        if "its machine is overloaded" not in done.output:
            break
    return done


def stored(graph: Graph2) -> WatchdogMeasurement:
    (file,) = (graph.directory / "state" / "vsnbench" / "watchdogs").iterdir()
    return WatchdogMeasurement.model_validate_json(file.read_bytes())


def refusal(graph: Graph2) -> str:
    words = ["--robot", PROFILE, "--model", "random", "--goal", "chair", "--starts", "1", "--unattended"]
    run = graph.vsnbench("run", *words, "--results", graph.directory / "r", COLUMNS="300")
    assert run.wait(120) == 1, run.output
    return run.output


@pytest.mark.long
def test_a_base_whose_watchdog_failed_is_refused_until_a_measurement_passes(tmp_path) -> None:
    with live_graph(tmp_path) as graph:
        robot = graph.start(HERE / "nodes" / "robot.py")
        wait_until(lambda: "up" in robot.output, "the robot is up")
        failed = doctor(graph)
        assert failed.popen.returncode == 1, failed.output
        assert "the base still moved" in failed.output
        assert stands_since(robot) is not None
        assert stored(graph).stopped_s is None
        assert "the base still moved" in refusal(graph)
        send_line(robot, "timeout 0.5")
        passed = doctor(graph)
        assert passed.popen.returncode == 0, passed.output
        assert "dead time" in passed.output
        assert "the base follows" in passed.output
        stopped_s = stored(graph).stopped_s
        assert stopped_s is not None
        assert 0.3 < stopped_s < stored(graph).allowed_s
        assert stored(graph).robot == load_profile(str(PROFILE)).name


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        pytest.param("nan", "odometry is not finite", marks=pytest.mark.long),
        ("bumper", "the base reports: bumper"),
    ],
)
def test_doctor_fails_with_bad_odometry_or_a_pressed_bumper(tmp_path, fault, says) -> None:
    with live_graph(tmp_path) as graph:
        robot = graph.start(HERE / "nodes" / "robot.py")
        wait_until(lambda: "up" in robot.output, "the robot is up")
        done = graph.vsnbench("doctor", "--robot", PROFILE, "--results", tmp_path, COLUMNS="200")
        # A bumper of type Bool publishes its state continuously.
        wait_until(lambda: send_line(robot, fault) and done.popen.poll() is not None, "doctor is done", 120)
    assert done.popen.returncode == 1
    assert says in done.output
