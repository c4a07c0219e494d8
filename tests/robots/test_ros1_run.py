"""`vsnbench run` with a ROS 1 robot, in separate processes: completed, refused, and killed."""

import json
import signal
import sqlite3
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.robots.drives import DRIVING_ON, check_answers
from tests.ros.ros1.network import HERE, Probe, Process, RosNetwork, live_network, wait_until
from vsnbench.sites.site import embedded_sites

pytestmark = pytest.mark.ros

PROFILE = HERE / "profile_of_test_base.yaml"


@dataclass
class Stack:
    """A robot as close to a real one as possible: base, camera, discrete_move, no placement service."""

    network: RosNetwork
    probe: Probe
    results: Path

    def run(self, *words: str) -> Process:
        command = ["run", "--robot", str(PROFILE), "--goal", "chair", "--model", "forward"]
        return self.network.start("-m", "vsnbench.cli.main", *command, "--results", str(self.results), *words)

    def rows(self, query: str) -> list[tuple]:
        with sqlite3.connect(self.results / "vsnbench.db") as connection:
            return connection.execute(query).fetchall()

    def stands_still_within(self, limit_s: float, since_s: float) -> bool:
        wait_until(lambda: self.probe.stopped_at(since_s) is not None, "the base stands still")
        took_s = self.probe.stopped_at(since_s) - since_s
        sys.stdout.write(f"stood still {took_s:.2f} s after the fault\n")
        return took_s < limit_s


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RosNetwork]:
    with live_network(tmp_path_factory.mktemp("ros")) as ros:
        ros.start(HERE / "nodes" / "kinematic_base.py", "_command_timeout_s:=1000")
        ros.start(HERE / "nodes" / "camera.py")
        ros.start("-m", "vsnbench.cli.main", "robots", "serve", str(PROFILE))
        ros.wait_for_service("/discrete_move")
        yield ros


@pytest.fixture
def stack(network, tmp_path) -> Iterator[Stack]:
    probe = Probe(network)
    yield Stack(network, probe, tmp_path / "results")
    probe.close()


def test_without_a_terminal_a_robot_that_needs_an_operator_is_refused(stack) -> None:
    run = stack.run("--starts", "1")
    assert run.wait(90) == 2
    assert "an operator must put test-base at each starting position" in run.output
    assert "--unattended" in run.output


def test_an_unattended_run_records_estimated_distances(stack) -> None:
    run = stack.run("--starts", "1", "--max-steps", "2", "--unattended")
    assert run.wait(120) == 0, run.output
    ((reason, source),) = stack.rows("select end_reason, distance_source from verdict")
    assert reason == "step_limit"
    assert source == "estimated"
    assert stack.rows("select count(*) from step") == [(2,)]


@pytest.mark.long
def test_a_run_that_drives_on_is_recorded_with_the_ages_of_its_answers(stack) -> None:
    """The node next to the base follows the paths while the model thinks."""
    run = stack.run("--model", "oracle-waypoints", *DRIVING_ON, "--unattended")
    assert run.wait(180) == 0, run.output
    assert stack.rows("select end_reason from verdict") == [("time_limit",)]
    check_answers(stack.rows("select stamp_s, movement, duration_s from step order by number"))


@pytest.mark.parametrize(("number", "limit_s"), [(signal.SIGTERM, 1.0), (signal.SIGINT, 1.0), (signal.SIGKILL, 2.0)])
def test_an_ended_run_leaves_a_robot_at_rest(stack, number, limit_s) -> None:
    run = stack.run("--starts", "1", "--max-steps", "100", "--unattended")
    wait_until(lambda: stack.probe.speed > 0.05, "the robot moves", 90)
    ended_s = time.monotonic()
    run.signal(number)
    assert stack.stands_still_within(limit_s, ended_s)
    assert run.wait() == (-signal.SIGKILL if number == signal.SIGKILL else 128 + number)
    if number != signal.SIGKILL:
        reason = "aborted" if number == signal.SIGINT else "interrupted"
        assert stack.rows("select end_reason from episode") == [(reason,)]
        assert "every finished step is recorded" in run.output


def test_a_silent_camera_makes_the_episode_void_and_the_run_gives_advice(stack) -> None:
    run = stack.run("--starts", "1", "--max-steps", "100", "--unattended")
    wait_until(lambda: stack.probe.speed > 0.05, "the robot moves", 90)
    stack.probe.tell("/camera/fault", "silent")
    try:
        assert run.wait(120) == 1
        assert "void: a sensor went silent or sent what cannot be used" in run.output
        assert "check the camera driver" in run.output
        assert stack.rows("select end_reason from episode") == [("sensor_lost",)]
    finally:
        stack.probe.tell("/camera/fault", "good")


ATTEMPTS = 4
"""On a machine with other work a sensor may fall silent for a second: the episode is void, and is run again."""
JUDGED = "join episode on episode.id = episode_id where state = 'judged'"
ACTIONS = f"select action from step {JUDGED} order by episode_id, number"


@pytest.mark.parametrize("robot", ["turtlebot2", pytest.param("lola2", marks=pytest.mark.long)])
def test_the_stack_in_three_processes_acts_as_the_simulation(tmp_path, robot) -> None:
    """`vsnbench robots simulate`, `vsnbench robots serve` and `vsnbench run`, on a real master in real time."""
    with live_network(tmp_path) as network:

        def run(who: str) -> Process:
            command = ["run", "--robot", who, "--model", "oracle", "--goal", "sofa", "--starts", "7"]
            return network.start("-m", "vsnbench.cli.main", *command, "--results", str(tmp_path / who))

        def rows(who: str, query: str) -> list[tuple]:
            with sqlite3.connect(tmp_path / who / "vsnbench.db") as connection:
                return connection.execute(query).fetchall()

        network.start("-m", "vsnbench.cli.main", "robots", "simulate", "--site", "apartment", robot)
        network.start("-m", "vsnbench.cli.main", "robots", "serve", robot)
        network.wait_for_service("/discrete_move")
        elsewhere = tmp_path / "elsewhere.yaml"
        elsewhere.write_text(embedded_sites()["apartment"].read_text().replace("name: apartment", "name: elsewhere"))
        words = ["run", "--robot", robot, "--model", "oracle", "--goal", "sofa", "--results", str(tmp_path / "no")]
        refused = network.start("-m", "vsnbench.cli.main", *words, "--site", str(elsewhere))
        assert refused.wait(120) == 1
        assert f"robot {robot} is simulated in another site than elsewhere" in refused.output.splitlines()[-1]
        assert not (tmp_path / "no").exists()
        second = network.start("-m", "vsnbench.cli.main", "robots", "simulate", robot, "__name:=second")
        assert second.wait(60) == 1
        assert "/simulation/place_robot is already served by /simulated_robot" in second.output
        compare = network.start(HERE / "nodes" / "compare_with_simulation.py", robot, "7")
        assert compare.wait(120) == 0, compare.output
        difference = json.loads(compare.output.splitlines()[-1])
        assert difference["place_m"] < 0.001
        assert difference["rgb"] < 0.02
        assert difference["instances"] < 0.002
        assert difference["categories"] is True
        assert difference["depth_m"] < 0.02
        assert difference["invalid"] < 0.01
        assert difference["pose"] == pytest.approx([0, 0, 0], abs=1e-6)
        in_process = run(f"simulated:{robot}")
        assert in_process.wait(120) == 0, in_process.output
        for _ in range(ATTEMPTS):
            over_ros = run(robot)
            if over_ros.wait(240) == 0 or "the same command resumes" not in over_ros.output:
                break
        assert over_ros.popen.returncode == 0, over_ros.output
        assert rows(robot, ACTIONS) == rows(f"simulated:{robot}", ACTIONS)
        ((kind, simulated, conditions),) = rows(
            robot, "select kind, simulated, conditions from campaign join robot on robot.id = robot_id"
        )
        assert (kind, simulated) == ("ros1", 1)
        assert {"simulator", "odometry_rate_hz", "rate_factor", "depth_frames"} <= set(json.loads(conditions))
        judged = rows(robot, f"select success, verdict.end_reason, verdict.distance_source from verdict {JUDGED}")
        assert judged == [(1, "stop", "simulated")]
        distances = f"select distance_m from verdict {JUDGED}"
        ((ours,), (theirs,)) = (rows(who, distances)[0] for who in (robot, f"simulated:{robot}"))
        assert ours == pytest.approx(theirs, abs=0.05)
