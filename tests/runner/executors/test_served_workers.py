"""Several workers and one served model: the same results as one process, and kills cost nothing but their episodes."""

import signal
from pathlib import Path

import pytest

from tests.models.remote.servers import free_port, stub_server
from tests.runner.executors.test_local_pool import DEADLINE_S, JUDGED, STORY, rows, run, running, workers_at_a_trial

MODEL = """
import random
import time

class Model:
    card = {"name": "wanders", "sensors": ["rgb", "odometry"]}

    def reset(self, goal, seed):
        random.seed(seed)
        self.turns = 0

    def act(self, observation):
        time.sleep(0.02)
        self.turns += 1
        return "STOP" if self.turns > 8 else random.choice(["TURN_LEFT", "TURN_RIGHT", "MOVE_FORWARD"])
"""
TRIALS = 15
WORDS = ("--goal", "chair", "--robot", "simulated:turtlebot2@160x120", "--keep", "none")
WITHOUT_DETAILS = STORY.replace(", s.details", "")


def served_words(url: str, workers: int, *more: str) -> tuple[str, ...]:
    return ("--model", url, "--workers", str(workers), *WORDS, *more)


def test_any_number_of_workers_gives_the_same_results(tmp_path: Path) -> None:
    with stub_server(MODEL, tmp_path, "served_model:Model", "--sessions", "4") as (url, _):
        for workers in (1, 4):
            run(tmp_path / str(workers), *served_words(url, workers))
    one, four = (rows(tmp_path / str(workers), WITHOUT_DETAILS) for workers in (1, 4))
    assert len(one) > TRIALS
    assert one == four
    assert rows(tmp_path / "4", "SELECT COUNT(DISTINCT process_id) FROM episode")[0][0] == 4


def test_a_killed_worker_costs_its_episode_only(tmp_path: Path) -> None:
    with (
        stub_server(MODEL, tmp_path, "served_model:Model", "--sessions", "3") as (url, _),
        running(tmp_path, *served_words(url, 3)) as process,
    ):
        for worker in workers_at_a_trial(process, tmp_path, 2):
            worker.send_signal(signal.SIGKILL)
        _, output = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, output
    assert rows(tmp_path, JUDGED) == [(TRIALS, TRIALS)]


def test_a_killed_server_that_returns_costs_the_episodes_of_that_moment_only(tmp_path: Path) -> None:
    port = free_port()
    arguments = ("served_model:Model", "--sessions", "4")
    with (
        stub_server(MODEL, tmp_path, *arguments, port=port) as (url, server),
        running(tmp_path, *served_words(url, 4)) as process,
    ):
        workers_at_a_trial(process, tmp_path, 3)
        server.kill()
        server.wait()
        with stub_server(MODEL, tmp_path, *arguments, port=port):
            _, output = process.communicate(timeout=DEADLINE_S)
            assert process.returncode in (0, 1), output
            assert "consecutive void" not in output
            lost = rows(tmp_path, "SELECT COUNT(*) FROM episode WHERE end_reason = 'model_lost'")[0][0]
            assert 1 <= int(str(lost)) <= 4
            run(tmp_path, *served_words(url, 4))
    assert rows(tmp_path, JUDGED) == [(TRIALS, TRIALS)]


@pytest.mark.parametrize("batch", [(), ("--batch", "3")])
def test_more_workers_than_sessions_are_refused_in_one_line(batch: tuple[str, ...], tmp_path: Path) -> None:
    source = MODEL
    if batch:
        source += """
    def new_state(self, goal, seed):
        return []

    def act_batch(self, observations, states):
        return ["STOP"] * (len(states) + 1)
"""
    with (
        stub_server(source, tmp_path, "served_model:Model", "--sessions", "3", *batch) as (url, _),
        running(tmp_path, *served_words(url, 4)) as process,
    ):
        _, output = process.communicate(timeout=DEADLINE_S)
        assert process.returncode == 2
        assert "4 workers need as many sessions, and the model's server has 3: give --workers 3" in output
        if batch:
            output = failing(tmp_path, *served_words(url, 3, "--fail-fast"))
            assert "act_batch returned 2 answers to 1 observations" in output


def failing(results: Path, *words: str) -> str:
    with running(results, *words) as process:
        _, output = process.communicate(timeout=DEADLINE_S)
        assert process.returncode == 1
        return output
