"""`vsnbench sites scan` as a person calls it: a map that the editor takes, and one line for what cannot be done."""

import os
import signal
import subprocess
from pathlib import Path

import pytest

from tests.cli.console import vsnbench, vsnbench_process
from tests.cli.scans import SHORT_DRIVE, scanned_alike
from tests.processes import Process
from tests.ros1.network import live_network
from vsnbench.exchange.ros_map import read_ros_map
from vsnbench.sensing.plan_grid import OCCUPIED


def test_a_scan_writes_a_map_and_says_what_is_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "drive.txt").write_text("left 3\nforward 2\n")
    output = tmp_path / "map.yaml"
    robot = "simulated:turtlebot2@160x120"
    words = ["--robot", robot, "--drive", str(tmp_path / "drive.txt"), "--output", str(output)]
    answer = vsnbench(monkeypatch, capsys, "sites", "scan", *words)
    assert answer.code == 0, answer.err
    assert "5 actions" in answer.out
    assert f"vsnbench sites edit lab.yaml --underlay {output}" in answer.out
    assert (read_ros_map(output).cells == OCCUPIED).sum() > 20
    again = vsnbench(monkeypatch, capsys, "sites", "scan", *words)
    assert (again.code, again.err) == (
        2,
        f"vsnbench: error: {output} is there already: name another file with --output\n",
    )


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--output", "map.png"], "cannot write a map to map.png"),
        (["--auto", "--drive", "drive.txt"], "--auto and --drive both say where to go: name one"),
        (["--drive", "nowhere.txt"], "cannot read nowhere.txt"),
        ([], "driving by hand needs a terminal"),
        (["--auto", "--start", "99"], "has no starting position 99"),
        (["--robot", "no-such-robot"], "no robot 'no-such-robot'"),
    ],
)
def test_what_cannot_be_done_is_one_line(
    words: list[str],
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    with Path(os.devnull).open() as nobody:  # no terminal, whoever runs the tests
        monkeypatch.setattr("sys.stdin", nobody)
        answer = vsnbench(monkeypatch, capsys, "sites", "scan", *words)
    assert answer.code == 2
    assert says in answer.err
    assert answer.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_ctrl_c_keeps_what_was_mapped(tmp_path: Path) -> None:
    output = tmp_path / "map.yaml"
    words = ["sites", "scan", "--auto", "--robot", "simulated:turtlebot2@160x120", "--output", str(output)]
    with vsnbench_process(words) as process:
        assert process.stderr is not None
        process.stderr.readline()  # the first look
        process.send_signal(signal.SIGINT)
        try:
            out, err = process.communicate(timeout=200)
        except subprocess.TimeoutExpired:
            pytest.fail("it goes on after Ctrl-C")
    assert process.returncode == 130, err
    assert "stopped with Ctrl-C; the map so far is kept" in out
    assert (read_ros_map(output).cells == OCCUPIED).any()


@pytest.mark.ros
def test_over_ros_1_the_map_is_that_of_the_simulation(tmp_path: Path) -> None:
    """`vsnbench ros1 simulate`, `vsnbench ros1 discrete-move` and `vsnbench sites scan`, on a real master."""
    (tmp_path / "drive.txt").write_text(SHORT_DRIVE)
    with live_network(tmp_path) as network:

        def vsnbench_there(*words: str | Path) -> Process:
            return network.start("-m", "vsnbench.cli.main", *words)

        vsnbench_there("ros1", "simulate", "--robot", "turtlebot2")
        vsnbench_there("ros1", "discrete-move", "--robot", "turtlebot2")
        network.wait_for_service("/discrete_move")
        scanned_alike(vsnbench_there, "turtlebot2", tmp_path)
