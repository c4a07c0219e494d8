"""The attitude of a base from IMUs on a ROS 2 graph: used, or refused with one line that says what to change."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.processes import wait_until
from tests.ros.ros2.graph import HERE, PROFILE, Graph2, live_graph

pytestmark = [pytest.mark.ros2, pytest.mark.long]


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph2]:
    with live_graph(tmp_path_factory.mktemp("ros2")) as one:
        for node in ("robot.py", "imus.py"):
            started = one.start(HERE / "nodes" / node)
            wait_until(lambda process=started: "up" in process.output, "the node is up")
        yield one


def typed(graph: Graph2, imu: str, *words: str) -> tuple[int, str]:
    """Return exit code and output of a command whose robot has its attitude from an IMU."""
    profile = Path(graph.directory) / f"{imu}.yaml"
    frame = f"  attitude: {{topic: imu/{imu}, frame: imu_link}}\n"
    profile.write_text(PROFILE.read_text().replace("  kind: ros2\n", f"  kind: ros2\n{frame}"))
    done = graph.vsnbench(*words, "--robot", profile, "--results", graph.directory / imu, COLUMNS="300")
    return done.wait(150), done.output


REFUSED = {
    "weightless": (
        "the acceleration of /imu/weightless is 0.00 m/s², not 9.81: without gravity its attitude cannot be checked. "
        "Have its driver publish m/s² with gravity, or take the attitude from the odometry (interface.attitude.topic)"
    ),
    "tilted": (
        "/imu/tilted is in the frame camera_imu_optical_frame, not in imu_link: if its axes are those of the base, set "
        "interface.attitude.frame to it"
    ),
}


def test_doctor_shows_the_attitude_of_an_imu(graph: Graph2) -> None:
    _, output = typed(graph, "level", "doctor")
    (line,) = (line for line in output.splitlines() if "roll" in line)
    assert line.startswith("ok "), output


@pytest.mark.parametrize("imu", REFUSED)
def test_doctor_refuses_an_imu_in_one_line(graph: Graph2, imu: str) -> None:
    code, output = typed(graph, imu, "doctor")
    assert code == 1
    (line,) = (line for line in output.splitlines() if REFUSED[imu] in line)
    assert line.startswith("failed"), output


@pytest.mark.parametrize("imu", REFUSED)
def test_a_run_is_refused_in_one_line(graph: Graph2, imu: str) -> None:
    code, output = typed(graph, imu, "run", "--model", "random", "--goal", "chair", "--starts", "1")
    assert code == 1
    (line,) = (line for line in output.splitlines() if REFUSED[imu] in line)
    assert line.startswith("vsnbench: error: "), output
