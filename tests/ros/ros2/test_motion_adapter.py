"""A robot whose profile names no velocities, driven by the example of an adapter over ROS 2."""

import sqlite3
from pathlib import Path

import pytest

from tests.processes import wait_until
from tests.ros.ros2.graph import HERE, PROFILE, live_graph

pytestmark = pytest.mark.ros2
EXAMPLE = HERE.parents[2] / "examples" / "motion_adapters" / "ros2_adapter.py"
SITE = HERE.parents[1] / "robots" / "lab_room.yaml"
ATTEMPTS = 4
"""A busy machine delays a base by more than the checks allow, and a sensor may fall silent for a second."""
JUDGED = """
    select verdict.success, verdict.end_reason from verdict join episode on episode.id = episode_id
    where state = 'judged'
"""


def profile_with_adapter(directory: Path, tolerances: str = "position_m: 0.01, turn_deg: 0.5") -> Path:
    path = directory / "robot.yaml"
    adapter = '  kind: ros2\n  command: ""\n  discrete_move: motion_adapter\n'
    text = PROFILE.read_text(encoding="utf-8").replace("  kind: ros2\n", adapter)
    path.write_text(text.replace("interface:\n", f"tolerances: {{{tolerances}}}\ninterface:\n"), encoding="utf-8")
    return path


@pytest.mark.long
@pytest.mark.timeout(1500)
def test_doctor_checks_an_adapter_and_misses_one_that_does_not_run(tmp_path: Path) -> None:
    profile = profile_with_adapter(tmp_path)
    with live_graph(tmp_path) as graph:
        robot = graph.start(HERE / "nodes" / "robot.py")
        wait_until(lambda: "up" in robot.output, "the robot is up")
        words = ["doctor", "--robot", profile, "--results", tmp_path]
        without = graph.vsnbench(*words, COLUMNS="200")
        assert without.wait(300) == 1, without.output
        assert "no motion adapter serves it" in without.output
        adapter = graph.start(EXAMPLE, "twist:TwistBase")
        wait_until(lambda: "serving" in adapter.output, "the adapter is up")
        for _ in range(ATTEMPTS):
            done = graph.vsnbench(*words, "--move", COLUMNS="200")
            if done.wait(300) == 0:
                break
        assert done.popen.returncode == 0, done.output
        for check in ("the motion adapter twist-base 1 answers", "Left 30°", "deadline", "lost client"):
            assert check in done.output


@pytest.mark.long
@pytest.mark.timeout(1500)
@pytest.mark.parametrize("model", ["oracle", "oracle-waypoints"])
def test_a_trial_runs_through_the_adapter(tmp_path: Path, model: str) -> None:
    profile, results = profile_with_adapter(tmp_path), tmp_path / "results"
    with live_graph(tmp_path, shares_memory=True) as graph:
        robot = graph.vsnbench("robots", "simulate", profile, "--site", SITE)
        wait_until(lambda: "simulating" in robot.output, "the robot is simulated", 150)  # after the first compilation
        adapter = graph.start(EXAMPLE, "twist:TwistBase")
        wait_until(lambda: "serving" in adapter.output, "the adapter is up")
        words = ["--robot", profile, "--site", SITE, "--model", model, "--goal", "chair", "--starts", "1"]
        for _ in range(ATTEMPTS):
            done = graph.vsnbench("run", *words, "--results", results)
            if done.wait(300) == 0 or "the same command resumes" not in done.output:
                break
        assert done.popen.returncode == 0, done.output + adapter.output
    with sqlite3.connect(results / "vsnbench.db") as connection:
        assert connection.execute(JUDGED).fetchall() == [(1, "stop")]
        (conditions,) = connection.execute("select conditions from campaign").fetchone()
        assert "twist-base" in conditions
