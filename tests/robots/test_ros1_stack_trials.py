"""A stack that knows the flat drives ten trials over ROS 1, told on a topic and heard on another."""

from pathlib import Path

import pytest

from tests.robots.oracle_ways import OF_TRIALS, PLANNED, check_ten_successes, write_ways
from tests.robots.test_ros1_stack import WAYS
from tests.ros.ros1.network import HERE, live_network, wait_until

pytestmark = [pytest.mark.ros, pytest.mark.timeout(1500)]


def test_ten_trials_are_announced_driven_and_judged(tmp_path: Path) -> None:
    with live_network(tmp_path) as network:
        network.run(*PLANNED, "--results", str(tmp_path / "oracle")).wait(200)
        write_ways(tmp_path / "oracle", tmp_path / "ways.json")
        network.start("-m", "vsnbench.cli.main", "robots", "simulate", "turtlebot2")
        network.start("-m", "vsnbench.cli.main", "robots", "serve", "turtlebot2")
        network.wait_for_service("/discrete_move", 150.0)
        stack = network.start(HERE / "nodes" / "stack.py", "{}", "arrived", tmp_path / "ways.json")
        wait_until(lambda: "listens" in stack.output, "the stack listens")
        (tmp_path / "stack.yaml").write_text(f'name: theirs\nversion: "1"\n{WAYS}')
        words = ("--robot", "turtlebot2", "--model", f"stack:{tmp_path / 'stack.yaml'}", *OF_TRIALS)
        for _ in range(3):  # the same command runs a void trial again, as where the machine starved the camera
            done = network.run(*words, "--results", str(tmp_path / "results"))
            if done.wait(1200) == 0:
                break
        assert done.popen.returncode == 0, done.output
    check_ten_successes(tmp_path / "results", "declared")
