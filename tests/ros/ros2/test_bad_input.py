"""A session refuses a faulty ROS 2 robot before the robot moves."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator

import pytest

from tests.processes import Process, wait_until
from tests.ros.ros2.graph import HERE, PROFILE, Domain, live_graph

pytestmark = pytest.mark.ros2

NO_RCLPY = """
import importlib.util, sys
find = importlib.util.find_spec
importlib.util.find_spec = lambda name: None if name == "rclpy" else find(name)
from vsnbench.cli.main import main
sys.argv = ["vsnbench", *sys.argv[1:]]
main()
"""

LONG_S = 150
REFUSALS = {
    "deaf": "no-base",
    "lasting": "incompatible-qos",
    "stamped": "wrong-command-type",
    "docked": "docked",
    "two": "two-publishers",
}
"""Code of the error by the namespace of the robot."""


def answers(process: Process) -> list[list[str]]:
    return json.loads(process.output.splitlines()[-1])


@pytest.fixture(scope="module")
def refused(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, tuple[str, str]]]:
    """Code and text of the error by namespace, and of a robot in another domain."""
    directory = tmp_path_factory.mktemp("ros2")
    profile = directory / "robot.yaml"
    profile.write_text(PROFILE.read_text() + "  command_type: geometry_msgs/msg/Twist\n")
    with live_graph(directory) as graph:
        elsewhere = Domain()
        robots = graph.start(HERE / "nodes" / "refused_robots.py")
        ask = HERE / "nodes" / "refused.py"
        lost = graph.start(ask, json.dumps({str(profile): "no-base"}), ROS_DOMAIN_ID=str(elsewhere.number))
        wait_until(lambda: "up" in robots.output, "the robots are up", LONG_S)
        # A namespace goes with a profile's name, which here is its file's path.
        asked = graph.start(ask, json.dumps({f"{profile}@{name}": code for name, code in REFUSALS.items()}))
        assert asked.wait(LONG_S) == 0, asked.output
        assert lost.wait(LONG_S) == 0, lost.output
        elsewhere.close()
        assert "moves" not in robots.output
        yield dict(zip([*REFUSALS, "nowhere"], answers(asked) + answers(lost), strict=True))


@pytest.mark.parametrize("words", [["robots", "simulate", "turtlebot4"], ["robots", "serve", "turtlebot4"]])
def test_without_rclpy_one_line_names_the_package(words) -> None:
    done = subprocess.run([sys.executable, "-c", NO_RCLPY, *words], capture_output=True, text=True, timeout=90)
    assert done.returncode == 1
    assert "ROS 2 is not installed for this Python (no module rclpy): " in done.stderr
    assert "[ros2]" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("words", [["robots", "serve", "turtlebot4"], ["doctor", "--robot", "turtlebot4"]])
def test_a_middleware_that_is_not_installed_is_named(words, tmp_path) -> None:
    command = [sys.executable, "-m", "vsnbench.cli.main", *words]
    environment = os.environ | {"RMW_IMPLEMENTATION": "rmw_other_cpp", "COLUMNS": "300"}
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=90)
    assert done.returncode == 1
    (line,) = (line for line in (done.stdout + done.stderr).splitlines() if "cannot use the middleware" in line)
    assert "rmw_other_cpp (RMW_IMPLEMENTATION)" in line
    assert "ros-$ROS_DISTRO-rmw-other-cpp" in done.stdout + done.stderr


def test_a_robot_in_another_domain_is_waited_for(refused) -> None:
    code, text = refused["nowhere"]
    assert code == "no-base"
    assert "(waited 4 s)" in text


@pytest.mark.parametrize(
    ("namespace", "shows"),
    [
        ("deaf", "/deaf/cmd_vel"),
        ("lasting", "/lasting/test_robot"),
        ("stamped", "set interface.command_type to geometry_msgs/msg/TwistStamped"),
        ("docked", "robot.yaml@docked, or push it off by hand"),
        ("two", "/two/second_robot and /two/test_robot"),
    ],
)
def test_a_faulty_robot_is_refused(refused, namespace, shows) -> None:
    code, text = refused[namespace]
    assert code == REFUSALS[namespace]
    assert shows in text
