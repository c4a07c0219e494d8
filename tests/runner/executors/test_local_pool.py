"""Local workers: same results as one process, no lost trials and no processes left."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import psutil
import pytest

from tests.processes import has_ended, wait_until
from vsnbench.files.atomic import PART
from vsnbench.runner.executors import local_pool
from vsnbench.runner.executors.capacity import WorkerRequest
from vsnbench.runner.executors.local_pool import LocalPool
from vsnbench.runner.executors.process import PROGRAM, ForkServer
from vsnbench.runner.setup.trial_setup import TrialSetupSpec
from vsnbench.sites.site import load_site

STORY = """
    SELECT t.goal, t.start, e.seed, e.end_reason, e.distance_to_goal_m, v.success, s.number, s.action, s.blocked,
           s.observed_x_m, s.observed_y_m, s.observed_heading_rad, s.world_x_m, s.world_y_m, s.world_heading_rad,
           s.rgb_digest, s.depth_digest, s.probabilities, s.details
    FROM step s JOIN episode e ON e.id = s.episode_id JOIN trial t ON t.id = e.trial_id
    JOIN verdict v ON v.episode_id = e.id WHERE e.state = 'judged' ORDER BY t.goal, t.start, s.number
"""
JUDGED = "SELECT COUNT(*), COUNT(DISTINCT trial_id) FROM episode WHERE state = 'judged'"
DEADLINE_S = 120.0


def rows(results: Path, query: str) -> list[tuple[object, ...]]:
    with closing(sqlite3.connect(f"file:{results / 'vsnbench.db'}?mode=ro", uri=True, timeout=10)) as connection:
        return connection.execute(query).fetchall()


@contextmanager
def running(results: Path, *words: str) -> Iterator["subprocess.Popen[str]"]:
    """Start `vsnbench run` in a separate process; end it and its workers with the block."""
    command = [sys.executable, "-m", "vsnbench.cli.main", "run", *words, "--results", str(results)]
    environment = os.environ | {"COLUMNS": "200", "VSNBENCH_ROBOT": "simulated:turtlebot2@160x120"}
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment)
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        assert process.stderr is not None
        process.stderr.close()


def run(results: Path, *words: str) -> str:
    """Run to the end and return its output."""
    with running(results, *words) as process:
        _, output = process.communicate(timeout=DEADLINE_S)
        assert process.returncode == 0, output
        return output


def workers_at_a_trial(process: "subprocess.Popen[str]", results: Path, count: int = 1) -> Sequence[psutil.Process]:
    """Wait until a number of workers have begun an episode, and return them."""
    query = "SELECT p.pid FROM episode e JOIN process p ON p.id = e.process_id WHERE e.state = 'running'"
    deadline = time.monotonic() + DEADLINE_S
    while time.monotonic() < deadline:
        assert process.poll() is None, process.stderr.read() if process.stderr else ""
        try:
            found = [psutil.Process(int(str(pid))) for (pid,) in rows(results, query)]
        except (
            sqlite3.OperationalError,
            psutil.NoSuchProcess,
        ):  # the tables do not exist yet, or the process has just ended
            found = []
        if len(found) >= count and not any(map(has_ended, found)):  # workers of an earlier run may not be reaped yet
            return found
        time.sleep(0.02)
    pytest.fail(f"no {count} workers at a trial within two minutes")


def assert_gone(workers: Sequence[psutil.Process]) -> None:
    wait_until(lambda: all(map(has_ended, workers)), f"these end: {workers}")


def workers_of_this_process() -> list[psutil.Process]:
    """Return the processes that a fork server of this one has forked."""
    found = []
    for child in psutil.Process().children():
        with suppress(psutil.Error):  # a process of another test that is ending
            if PROGRAM in child.cmdline():
                found += child.children()
    return found


def half_written(results: Path) -> list[Path]:
    return list(results.rglob(f"*{PART}"))


def test_two_workers_give_the_same_bits_as_one(tmp_path: Path) -> None:
    words = ("--model", "random", "--goal", "chair,bed", "--starts", "1-3", "--noise", "--max-steps", "6")
    run(tmp_path / "one", *words, "--workers", "1")
    output = run(tmp_path / "two", *words, "--workers", "2")
    assert "2 workers: " in output
    assert "all 6 trials are done" in output
    story = rows(tmp_path / "one", STORY)
    assert len(story) >= 12
    assert rows(tmp_path / "two", STORY) == story
    by = (
        "SELECT DISTINCT json_extract(p.platform, '$.compute_threads') FROM episode e "
        "JOIN process p ON p.id = e.process_id"
    )
    assert rows(tmp_path / "one", by) == rows(tmp_path / "two", by) == [("1",)]
    assert rows(tmp_path / "two", "SELECT COUNT(DISTINCT process_id) FROM episode") == [(2,)]


def test_ctrl_c_at_the_driver_ends_every_episode_recorded(tmp_path: Path) -> None:
    words = ("--model", "tests.cli.turning:Turning", "--goal", "chair", "--starts", "1-3", "--max-steps", "5000")
    with running(tmp_path, *words, "--workers", "2") as process:
        workers = workers_at_a_trial(process, tmp_path, 2)
        process.send_signal(signal.SIGINT)
        _, output = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 130, output
    assert rows(tmp_path, "SELECT end_reason FROM episode") == [("aborted",), ("aborted",)]
    assert_gone(workers)


def test_killed_workers_and_drivers_lose_no_trial_and_leave_no_files(tmp_path: Path) -> None:
    words = ("--model", "tests.cli.turning:Turning", "--goal", "chair", "--starts", "1-4", "--max-steps", "30")
    command = (*words, "--workers", "2")
    with running(tmp_path, *command) as process:
        workers = workers_at_a_trial(process, tmp_path, 2)
        process.kill()
        process.wait()
        assert_gone(workers)
    with running(tmp_path, *command) as process:
        workers = workers_at_a_trial(process, tmp_path, 2)
        workers[0].kill()
        _, output = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, output
    assert "a worker ended with SIGKILL at chair from" in output
    assert rows(tmp_path, JUDGED) == [(4, 4)]
    assert rows(tmp_path, "SELECT end_reason, COUNT(*) FROM episode WHERE state = 'void'") == [("interrupted", 3)]
    assert half_written(tmp_path) == []
    assert_gone(workers)


def test_trials_of_a_killed_fork_server_run_again(
    tmp_path: Path,
) -> None:
    words = ("--model", "tests.cli.turning:Turning", "--goal", "chair", "--starts", "1-2", "--max-steps", "60")
    with running(tmp_path, *words, "--workers", "2") as process:
        workers = workers_at_a_trial(process, tmp_path, 2)
        parent = workers[0].parent()
        assert parent is not None
        assert parent.pid != process.pid
        parent.kill()
        _, output = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, output
    assert "a worker ended with SIGKILL at chair from" in output
    assert rows(tmp_path, JUDGED) == [(2, 2)]
    assert_gone([parent, *workers])


def test_a_late_setup_of_an_earlier_campaign_is_not_used() -> None:
    before, now = (TrialSetupSpec(load_site("apartment"), model, ("chair",)) for model in ("forward", "random"))
    with LocalPool(before, WorkerRequest(2, is_explicit=True)) as pool:
        one, late = workers_of_this_process()
        late.suspend()
        for plan in (now, before, now):
            pool.prepare(plan, WorkerRequest(2, is_explicit=True))
            assert pool.description.card.name == plan.model
        assert pool.free == 1
        late.resume()
        wait_until(lambda: pool.reports(0.1) == [] and pool.free == 2, "the late worker makes the last setup")
    assert_gone([one, late])


def test_two_lost_fork_servers_are_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    servers = [ForkServer() for _ in range(3)]
    for killed in servers[1:]:
        os.kill(killed.pid, signal.SIGKILL)
    monkeypatch.setattr(local_pool, "fork_server", servers.pop)
    with LocalPool(
        TrialSetupSpec(load_site("apartment"), "forward", ("chair",)), WorkerRequest(1, is_explicit=True)
    ) as pool:
        assert pool.free == 1
    assert not servers
    assert not workers_of_this_process()
