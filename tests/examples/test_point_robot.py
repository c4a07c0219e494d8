"""The example of docs/robots.md runs as documented, and an edited copy has another identity."""

import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path

EXAMPLE = Path(__file__).parents[2] / "examples" / "point_robot.py"


def run(directory: Path) -> "subprocess.CompletedProcess[str]":
    words = ["run", "--robot", "point_robot:PointRobot", "--model", "random", "--goal", "chair", "--starts", "1"]
    command = [sys.executable, "-m", "vsnbench.cli.main", *words, "--max-steps", "5", "--results", "results"]
    return subprocess.run(command, cwd=directory, capture_output=True, text=True, timeout=120, check=False)


def robots(directory: Path) -> list[tuple[str, int]]:
    with sqlite3.connect(directory / "results" / "vsnbench.db") as connection:
        return connection.execute("select kind, simulated from robot order by id").fetchall()


def test_the_example_runs_resumes_and_is_another_robot_after_an_edit(tmp_path: Path) -> None:
    mine = tmp_path / EXAMPLE.name
    shutil.copy(EXAMPLE, mine)
    done = run(tmp_path)
    assert done.returncode == 0, done.stderr
    assert robots(tmp_path) == [("point_robot:PointRobot", 1)]
    again = run(tmp_path)
    assert again.returncode == 0, again.stderr
    assert robots(tmp_path) == [("point_robot:PointRobot", 1)]
    mine.write_text(mine.read_text().replace("120, 136", "121, 136"))
    assert run(tmp_path).returncode == 0
    assert robots(tmp_path) == [("point_robot:PointRobot", 1)] * 2
