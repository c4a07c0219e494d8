"""`vsnbench run` from the command line, in the embedded apartment with a real database."""

import os
import pty
import select
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from tests.cli.console import Answer, vsnbench, vsnbench_process
from tests.processes import has_ended
from vsnbench.sites.site import load_site

Run = Callable[..., Answer]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    monkeypatch.setenv("VSNBENCH_ROBOT", "simulated:turtlebot2@64x48")  # a tenth of the time of its own camera
    return lambda *words: vsnbench(monkeypatch, capsys, "run", *map(str, words))


def rows(results: Path, query: str) -> list[tuple[object, ...]]:
    connection = sqlite3.connect(f"file:{results / 'vsnbench.db'}?mode=ro", uri=True, timeout=10)
    try:
        return connection.execute(query).fetchall()
    finally:
        connection.close()


def wait_for_steps(results: Path, count: int, process: "subprocess.Popen[str]") -> None:
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline:
        assert process.poll() is None, process.stderr.read() if process.stderr else ""
        if (results / "vsnbench.db").is_file():
            try:
                if rows(results, "SELECT COUNT(*) FROM step")[0] >= (count,):
                    return
            except sqlite3.OperationalError:  # the tables do not exist yet
                pass
        time.sleep(0.02)
    pytest.fail(f"no {count} steps within two minutes")


STORY = """
    SELECT t.goal, t.start, e.seed, e.end_reason, e.distance_to_goal_m, v.success, s.number, s.action, s.blocked,
           s.observed_x_m, s.observed_y_m, s.observed_heading_rad, s.world_x_m, s.world_y_m, s.world_heading_rad,
           s.rgb_digest, s.depth_digest
    FROM step s JOIN episode e ON e.id = s.episode_id JOIN trial t ON t.id = e.trial_id
    JOIN verdict v ON v.episode_id = e.id ORDER BY e.id, s.number
"""


def test_the_oracle_reaches_its_goal_and_everything_is_recorded(run: Run, tmp_path: Path) -> None:
    answer = run("--model", "oracle", "--goal", "bed", "--starts", "2-3", "--results", tmp_path)
    assert answer.code == 0
    assert "all 2 trials are done" in answer.err
    episodes = rows(tmp_path, "SELECT id, end_reason, actions, images_directory, path_length_m FROM episode")
    assert [episode[1] for episode in episodes] == ["stop", "stop"]
    assert rows(tmp_path, "SELECT success, source FROM verdict") == [(1, "protocol"), (1, "protocol")]
    for number, _, actions, directory, path_length_m in episodes:
        files = tmp_path / str(directory)
        steps = rows(tmp_path, f"SELECT number FROM step WHERE episode_id = {number} ORDER BY number")
        assert [step[0] for step in steps] == list(range(1, int(str(actions)) + 1))
        assert sorted(path.stem for path in (files / "rgb").iterdir()) == [f"{step:04d}" for (step,) in steps]
        assert sorted(path.stem for path in (files / "depth").iterdir()) == [f"{step:04d}" for (step,) in steps]
        assert (files / "trajectory.tum").read_text().count("\n") == len(steps) + 2
        assert not (files / "episode.rrd").exists(), "the copy for Rerun is created when an episode is viewed"
        assert float(str(path_length_m)) > 0.2


def test_the_same_command_again_has_nothing_to_do_and_a_new_seed_is_a_new_campaign(run: Run, tmp_path: Path) -> None:
    words = ("--model", "random", "--goal", "chair", "--starts", "1", "--results", tmp_path)
    assert run(*words).code == 0
    again = run(*words)
    assert again.code == 0
    assert "nothing to do" in again.err
    assert rows(tmp_path, "SELECT COUNT(*) FROM episode") == [(1,)]
    assert run(*words, "--seed", "1").code == 0
    assert rows(tmp_path, "SELECT COUNT(*) FROM campaign") == [(2,)]


def test_the_same_seed_gives_the_same_actions_poses_verdicts_and_pixels(run: Run, tmp_path: Path) -> None:
    for name in ("one", "two"):
        words = ("--model", "random", "--goal", "chair,bed", "--starts", "1-4", "--noise", "--seed", "11")
        assert run(*words, "--max-steps", "12", "--results", tmp_path / name).code == 0
    story = rows(tmp_path / "one", STORY)
    assert len(story) >= 8
    assert story == rows(tmp_path / "two", STORY)


def test_the_live_viewer_stays_until_ctrl_c_where_a_person_sits_at_a_terminal(tmp_path: Path) -> None:
    leader, follower = pty.openpty()
    environment = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    words = ("run", "--model", "tests.cli.turning:Turning", "--goal", "chair", "--starts", "1", "--max-steps", "2")
    process = subprocess.Popen(
        [sys.executable, "-m", "vsnbench.cli.main", *words, "--live", "--results", str(tmp_path)],
        stdout=subprocess.DEVNULL,
        stderr=follower,
        env=environment,
    )
    os.close(follower)
    try:
        seen = read_until(leader, "Rerun stays open: press Ctrl-C to end")
        assert "watch live at http://127.0.0.1:" in seen
        assert rows(tmp_path, "SELECT end_reason FROM episode") == [("step_limit",)]
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        assert "the only trial is done" in read_until(leader, "vsnbench report")
        assert process.wait(30) == 0
    finally:
        process.kill()
        process.wait()
        os.close(leader)


def read_until(terminal: int, words: str) -> str:
    """Return the terminal's output up to a text."""
    seen, deadline = "", time.monotonic() + 120
    while words not in seen:
        assert time.monotonic() < deadline, seen
        ready, _, _ = select.select([terminal], [], [], 1.0)
        if ready:
            try:
                seen += os.read(terminal, 4096).decode(errors="replace")
            except OSError:  # the other end is closed
                pytest.fail(seen)
    return seen


LONG = ("run", "--model", "tests.cli.turning:Turning", "--goal", "chair", "--starts", "1-2", "--max-steps", "25")


def test_a_killed_run_loses_no_committed_step_and_the_same_command_finishes_it(run: Run, tmp_path: Path) -> None:
    words = (*LONG, "--results", str(tmp_path))
    with vsnbench_process(words) as process:
        wait_for_steps(tmp_path, 5, process)
        process.send_signal(signal.SIGKILL)
        process.wait(30)
    assert rows(tmp_path, "SELECT end_reason FROM episode") == [(None,)]
    kept = rows(tmp_path, "SELECT number FROM step ORDER BY number")
    directory = tmp_path / "episodes" / "000001"
    for (number,) in kept:
        assert (directory / "rgb" / f"{number:04d}.jpg").is_file()
        assert (directory / "depth" / f"{number:04d}.png").is_file()

    assert run(*words[1:]).code == 0
    assert rows(tmp_path, "SELECT end_reason FROM episode ORDER BY id") == [
        ("interrupted",),
        ("step_limit",),
        ("step_limit",),
    ]
    assert rows(tmp_path, "SELECT success FROM verdict ORDER BY episode_id") == [(None,), (0,), (0,)]
    assert rows(tmp_path, "SELECT number FROM step WHERE episode_id = 1 ORDER BY number") == kept
    assert rows(tmp_path, "SELECT COUNT(DISTINCT trial_id) FROM episode WHERE end_reason = 'step_limit'") == [(2,)]


@pytest.mark.parametrize(
    ("number", "code", "reason"), [(signal.SIGINT, 130, "aborted"), (signal.SIGTERM, 143, "interrupted")]
)
def test_a_stopped_run_says_how_to_go_on(number: signal.Signals, code: int, reason: str, tmp_path: Path) -> None:
    with vsnbench_process((*LONG, "--results", str(tmp_path))) as process:
        wait_for_steps(tmp_path, 3, process)
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
    assert process.returncode == code
    assert "The same command resumes" in err
    assert "Traceback" not in err
    assert rows(tmp_path, "SELECT end_reason FROM episode") == [(reason,)]
    assert rows(tmp_path, "SELECT success FROM verdict") == [(None,)]


def test_a_model_that_fails_voids_its_episodes_and_ends_the_session(run: Run, tmp_path: Path) -> None:
    answer = run("--model", "tests.cli.turning:Broken", "--goal", "chair", "--starts", "1-5", "--results", tmp_path)
    assert answer.code == 1
    assert "3 consecutive void episodes" in answer.err
    assert "5 of 5 trials left" in answer.err
    assert rows(tmp_path, "SELECT DISTINCT end_reason FROM episode") == [("model_error",)]


def test_a_model_that_ends_its_process_fails_and_its_trials_are_recorded(run: Run, tmp_path: Path) -> None:
    answer = run("--model", "tests.cli.turning:Exiting", "--goal", "chair", "--starts", "1-5", "--results", tmp_path)
    assert answer.code == 1
    assert rows(tmp_path, "SELECT end_reason, count(*) FROM episode GROUP BY 1") == [("model_error", 3)]


def test_a_model_that_never_returns_from_close_costs_no_result(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vsnbench.runner.setup.trial_setup.CLOSE_TIMEOUT_S", 0.2)
    answer = run("--model", "tests.cli.turning:EndlessClose", "--goal", "chair", "--starts", "1", "--results", tmp_path)
    assert answer.code == 0
    assert "the only trial is done" in answer.err


@pytest.mark.parametrize("workers", ["1", "2"])
def test_processes_that_a_model_leaves_behind_end_with_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workers: str
) -> None:
    monkeypatch.setenv("FORKED", str(tmp_path / "forked"))
    words = ["--model", "tests.cli.turning:Forking", "--goal", "chair", "--starts", "1-2", "--results", str(tmp_path)]
    with vsnbench_process(["run", *words, "--workers", workers]) as process:
        assert process.wait(120) == 0
    left = [int(line) for line in (tmp_path / "forked").read_text().split()]
    assert len(left) == 2
    assert not [pid for pid in left if psutil.pid_exists(pid) and not has_ended(psutil.Process(pid))]


def test_a_site_of_ones_own_is_run_by_its_path(run: Run, tmp_path: Path) -> None:
    from vsnbench.settings.yaml_text import dump_yaml

    site = load_site("apartment").model_copy(update={"name": "mine"})
    path = tmp_path / "mine.yaml"
    path.write_text(dump_yaml(site.content()))
    results = tmp_path / "results"
    assert run("--model", "oracle", "--goal", "bed", "--starts", "3", "--site", path, "--results", results).code == 0
    assert rows(results, "SELECT name FROM site") == [("mine",)]


def test_what_is_wrong_with_a_site_of_ones_own_is_said_before_it_is_run(
    run: Run, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    from vsnbench.settings.yaml_text import dump_yaml

    site = load_site("apartment")
    few = site.model_copy(update={"name": "few", "starts": site.starts[:3]})
    path = tmp_path / "few.yaml"
    path.write_text(dump_yaml(few.content()))
    words = ("--model", "random", "--goal", "bed", "--starts", "1", "--max-steps", "1", "--site", path)
    assert run(*words, "--results", tmp_path / "results").code == 0
    assert "few.yaml: site few has 3 starting positions" in caplog.text


def test_another_file_behind_the_same_name_is_another_model_and_says_so(
    run: Run, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    weights = tmp_path / "net.pt"
    words = ("--model", "tests.cli.turning:Loaded", "--weights", weights, "--goal", "chair", "--starts", "1")
    again = (*words, "--max-steps", "1", "--results", tmp_path / "results")
    weights.write_bytes(b"first")
    run(*again)
    assert "nothing to do" in run(*again).err
    assert "is new" not in caplog.text
    weights.write_bytes(b"second")
    answer = run(*again)
    assert "campaign 2 is new: model loaded differs from that of campaign 1: file --weights (" in caplog.text
    assert "the only trial is done" in answer.err
    assert rows(tmp_path / "results", "SELECT count(*) FROM episode") == [(2,)]
    weights.write_bytes(b"first")
    assert "nothing to do" in run(*again).err, "the first campaign is reused"
