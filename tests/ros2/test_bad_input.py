"""What no session may begin with over ROS 2 is said in one line, before the robot moves."""

import json
import subprocess
import sys
from collections.abc import Iterator

import pytest

from tests.processes import Process, wait_until
from tests.ros2.graph import HERE, PROFILE, Domain, live_graph

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
    "deaf": "nobody listens to velocities",
    "lasting": "asks for transient local",
    "stamped": "listens to geometry_msgs/msg/TwistStamped",
    "docked": "stands on its dock",
    "two": "both publish",
}
"""Namespaces, and what is wrong with the robot in each."""


def answers(process: Process) -> list[str]:
    return json.loads(process.output.splitlines()[-1])


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """What a client is told of each robot, all of them on one graph, and of one in a domain where there is none."""
    directory = tmp_path_factory.mktemp("ros2")
    profile = directory / "robot.yaml"
    profile.write_text(PROFILE.read_text() + "  command_type: geometry_msgs/msg/Twist\n")
    with live_graph(directory) as graph:
        elsewhere = Domain()
        robots = graph.start(HERE / "nodes" / "refused_robots.py")
        ask = HERE / "nodes" / "refused.py"
        lost = graph.start(ask, json.dumps({str(profile): ""}), ROS_DOMAIN_ID=str(elsewhere.number))
        wait_until(lambda: "up" in robots.output, "the robots are up", LONG_S)
        # A namespace goes with a profile's name, which here is its file's path.
        asked = graph.start(ask, json.dumps({f"{profile}@{name}": words for name, words in REFUSALS.items()}))
        assert asked.wait(LONG_S) == 0, asked.output
        assert lost.wait(LONG_S) == 0, lost.output
        elsewhere.close()
        assert "moves" not in robots.output
        yield dict(zip([*REFUSALS, "nowhere"], answers(asked) + answers(lost), strict=True))


@pytest.mark.parametrize("words", [["ros2", "simulate"], ["ros2", "discrete-move"]])
def test_without_rclpy_one_line_says_what_to_install(words) -> None:
    done = subprocess.run([sys.executable, "-c", NO_RCLPY, *words], capture_output=True, text=True, timeout=90)
    assert done.returncode == 1
    assert "ROS 2 is not installed for this Python (no module rclpy): pip install 'vsnbench[ros2]'" in done.stderr
    assert done.stderr.count("\n") == 1


def test_in_the_wrong_domain_the_waiting_is_named(said) -> None:
    assert "nobody listens to velocities on /cmd_vel" in said["nowhere"]
    assert "(waited 4 s)" in said["nowhere"]


def test_a_base_that_would_not_hear_us_is_refused(said) -> None:
    assert "nobody listens to velocities on /deaf/cmd_vel" in said["deaf"]
    assert "/lasting/cmd_vel: /lasting/test_robot asks for transient local and would never hear" in said["lasting"]


def test_a_base_that_listens_to_the_other_type_is_refused_with_the_field_to_set(said) -> None:
    stamped = "geometry_msgs/msg/TwistStamped"
    begins = f"/stamped/test_robot listens to {stamped} on /stamped/cmd_vel, the profile says geometry_msgs/msg/Twist ("
    assert said["stamped"].startswith(begins)
    assert said["stamped"].endswith(f": set interface.command_type to {stamped}")


def test_a_robot_on_its_dock_is_refused_with_the_command_that_undocks_it(said) -> None:
    assert said["docked"].startswith("the robot stands on its dock")
    assert "vsnbench ros2 undock --robot test-base-2@docked, or push it off by hand" in said["docked"]


def test_two_robots_in_one_namespace_are_refused(said) -> None:
    assert "/two/second_robot and /two/test_robot both publish /two/odom" in said["two"]
    assert "give each robot a namespace" in said["two"]
