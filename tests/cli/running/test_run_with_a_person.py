"""`vsnbench run` on a real terminal with a person who places the robot: keys and hang-ups."""

import fcntl
import os
import pty
import signal
import sqlite3
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[3]
RUN = ("run", "--robot", "tests.cli.by_hand:Slow", "--model", "tests.cli.by_hand:TurnTwice", "--goal", "chair")


class Seat:
    """A terminal of 80 columns that runs `vsnbench run`."""

    def __init__(self, results: Path, *words: str) -> None:
        self.results = results
        self.leader, follower = pty.openpty()
        termios.tcsetwinsize(follower, (40, 80))
        self.process = subprocess.Popen(
            [sys.executable, "-m", "vsnbench.cli.main", *words, "--results", str(results)],
            stdin=follower,
            stdout=follower,
            stderr=follower,
            cwd=ROOT,
            env=os.environ | {"VSNBENCH_OPERATOR": "maria", "TERM": "xterm"},
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),  # noqa: PLW1509 - nothing else runs here yet
        )
        os.close(follower)
        self.seen = ""

    def wait_for(self, words: str) -> None:
        """Read until a text appears after the texts that were awaited before."""
        deadline = time.monotonic() + 120
        while words not in self.seen:
            assert time.monotonic() < deadline, self.seen
            try:
                self.seen += os.read(self.leader, 4096).decode(errors="replace")
            except OSError:
                pytest.fail(self.seen)
        self.seen = self.seen.partition(words)[2]

    def type(self, keys: str) -> None:
        os.write(self.leader, keys.encode())

    def hang_up(self) -> None:
        os.close(self.leader)
        self.leader = -1

    def rows(self, query: str) -> list[tuple[Any, ...]]:
        with closing(sqlite3.connect(self.results / "vsnbench.db", timeout=30)) as connection:
            return connection.execute(query).fetchall()

    @property
    def states(self) -> list[tuple[Any, ...]]:
        return self.rows("SELECT state, end_reason FROM episode ORDER BY id")

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        if self.leader >= 0:
            os.close(self.leader)


@pytest.fixture
def seat(tmp_path: Path) -> Iterator[Seat]:
    at = Seat(tmp_path / "results", *RUN, "--starts", "1-2")
    yield at
    at.close()


def test_what_a_person_types_is_the_verdict_and_enter_is_none(seat: Seat) -> None:
    seat.wait_for("Enter when it is in place")
    assert seat.states == [("claimed", None)]
    seat.type("\n")
    seat.wait_for("Did it touch anything?")
    seat.type("\n")
    seat.wait_for("Did it touch anything?")
    seat.type("nothing\n")
    seat.wait_for("Metres by tape")
    seat.type("84\n")
    seat.wait_for("84 is more than the")
    seat.wait_for("Metres by tape")
    seat.type("keep\n")
    seat.wait_for("#1 judged by you")
    seat.wait_for("starting position 2")
    assert seat.states[0] == ("judged", "stop")
    seat.wait_for("Enter when it is in place")
    seat.type("\x03")
    assert seat.process.wait(60) == 130, "the first Ctrl-C at a prompt acts"
    assert seat.states == [("judged", "stop")], "a trial that had not begun leaves no episode"
    session = "SELECT e.id, operator, s.ended_at IS NULL FROM session s JOIN episode e ON e.session_id = s.id"
    assert seat.rows(session) == [(1, "maria", 0)]


def test_a_hang_up_at_a_question_loses_nothing(seat: Seat) -> None:
    seat.wait_for("Enter when it is in place")
    seat.type("\n")
    seat.wait_for("Did it touch anything?")
    seat.hang_up()
    assert seat.process.wait(60) == 129
    assert seat.states == [("awaiting", "stop")]
    assert seat.rows("SELECT count(*) FROM step") == [(3,)]


def test_ctrl_c_at_a_question_leaves_the_episode_awaiting_judgement(seat: Seat) -> None:
    seat.wait_for("Enter when it is in place")
    seat.type("\n")
    seat.wait_for("Did it touch anything?")
    seat.type("\x03")
    seat.wait_for("#1 awaits judgement")
    assert seat.process.wait(60) == 130
    assert seat.states == [("awaiting", "stop")]


def test_the_space_bar_ends_the_episode_and_the_session_goes_on(seat: Seat) -> None:
    seat.wait_for("Enter when it is in place")
    seat.type("\n")
    seat.wait_for("the space bar stops the robot")
    deadline = time.monotonic() + 60
    while seat.states[0][0] != "running":
        assert time.monotonic() < deadline
    seat.type(" ")
    seat.wait_for("starting position 2")
    assert seat.states[0] == ("void", "aborted")
    seat.type("\x03")
    assert seat.process.wait(60) == 130


def alone(tmp_path: Path, model: str) -> "subprocess.Popen[str]":
    """Start a simulated run without a terminal."""
    words = ("run", "--model", model, "--goal", "chair", "--starts", "1", "--results", str(tmp_path / "results"))
    return subprocess.Popen(
        [sys.executable, "-m", "vsnbench.cli.main", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )


def test_a_second_sigterm_ends_a_model_that_never_comes_back_from_reset(tmp_path: Path) -> None:
    process = alone(tmp_path, "tests.cli.by_hand:Stuck")
    try:
        deadline = time.monotonic() + 120
        while not (tmp_path / "in-reset").exists():
            assert time.monotonic() < deadline
            assert process.poll() is None, process.communicate()[1]
        for _ in range(2):
            process.send_signal(signal.SIGTERM)
            time.sleep(1.0)  # SIGTERMs to a process and its group within half a second count once
        _, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 143
    assert "ended at once" in err


def test_a_models_own_threads_do_not_outlive_the_run(tmp_path: Path) -> None:
    process = alone(tmp_path, "tests.cli.by_hand:Straying")
    try:
        _, err = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 0, err
    assert "not waiting for threads that the model left running: straying" in err
