"""What no session may begin with over ROS 2 is said in one line, before the robot moves."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.ros1.network import wait_until
from tests.ros2.graph import HERE, PROFILE, Graph2, live_graph, stands_since

pytestmark = pytest.mark.ros2

ROBOT = HERE / "nodes" / "robot.py"
NO_RCLPY = """
import importlib.util, sys
find = importlib.util.find_spec
importlib.util.find_spec = lambda name: None if name == "rclpy" else find(name)
from vsnbench.cli.main import main
sys.argv = ["vsnbench", *sys.argv[1:]]
main()
"""


def refusal(graph: Graph2, robot: str | Path = PROFILE, domain: int | None = None) -> str:
    """Return the line in which a client says why it cannot reach the robot."""
    words = [sys.executable, str(HERE / "nodes" / "refused.py"), str(robot), "4"]
    environment = graph.environment | ({"ROS_DOMAIN_ID": str(domain)} if domain else {})
    done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=90)
    return done.stdout.strip().splitlines()[-1]


@pytest.mark.parametrize("words", [["ros2", "simulate"], ["ros2", "discrete-move"]])
def test_without_rclpy_one_line_says_what_to_install(words) -> None:
    done = subprocess.run([sys.executable, "-c", NO_RCLPY, *words], capture_output=True, text=True, timeout=90)
    assert done.returncode == 1
    assert "ROS 2 is not installed for this Python (no module rclpy): pip install 'vsnbench[ros2]'" in done.stderr
    assert done.stderr.count("\n") == 1


def test_in_the_wrong_domain_the_domain_is_named(tmp_path) -> None:
    with live_graph(tmp_path) as graph:
        other = graph.domain % 101 + 1
        said = refusal(graph, domain=other)
    assert "nobody listens to velocities on /cmd_vel" in said
    assert "waited 4 s" in said


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--deaf"], "nobody listens to velocities on /cmd_vel"),
        (["--lasting"], "/cmd_vel: /test_robot asks for transient local and would never hear"),
        (
            ["--stamped"],
            "TwistStamped on /cmd_vel, the profile says geometry_msgs/msg/Twist; set interface.command_type",
        ),
    ],
)
def test_a_base_that_would_not_hear_us_is_refused(tmp_path, options, said) -> None:
    profile = tmp_path / "robot.yaml"
    profile.write_text(PROFILE.read_text() + "  command_type: geometry_msgs/msg/Twist\n")
    with live_graph(tmp_path) as graph:
        robot = graph.start(ROBOT, *options)
        assert said in refusal(graph, profile)
        assert stands_since(robot) is None
        assert "moves" not in robot.output


def test_two_robots_without_a_namespace_are_refused_and_a_stamped_one_is_driven(tmp_path) -> None:
    with live_graph(tmp_path) as graph:
        first = graph.start(ROBOT, "--stamped")
        assert refusal(graph) == "reached"
        second = graph.start(ROBOT, "--name", "second_robot")
        wait_until(lambda: "both publish" in refusal(graph), "two robots are seen")
        said = refusal(graph)
        assert "/second_robot" in said
        assert "/test_robot" in said
        assert "give each robot a namespace" in said
        assert "moves" not in first.output + second.output
