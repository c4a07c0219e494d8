"""A clock that is set during an episode is recorded with it."""

import sqlite3
import time
from pathlib import Path

import pytest

from tests.cli.console import Typed
from vsnbench.runner.episode import recorder
from vsnbench.runtime.clock import ClockReading

RUN = ("run", "--model", "random", "--goal", "chair", "--starts", "1", "--max-steps", "2", "--keep", "none")


def recorded_events(results: Path) -> list[tuple[str, str]]:
    with sqlite3.connect(results / "vsnbench.db") as database:
        return database.execute("SELECT kind, text FROM event WHERE episode_id = 1").fetchall()


@pytest.mark.parametrize(("change_s", "words"), [(-3600, "back by 3600 s"), (86400, "forward by 86400 s"), (0.5, "")])
def test_a_clock_set_during_an_episode_is_an_event_and_a_warning(
    typed: Typed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change_s: float, words: str
) -> None:
    changed_s = 0.0

    def reading() -> ClockReading:
        nonlocal changed_s
        read = ClockReading(time.time() + changed_s)
        changed_s += change_s
        return read

    monkeypatch.setattr(recorder, "ClockReading", reading)
    answer = typed(*RUN, "--results", str(tmp_path))
    assert answer.code == 0, answer.err
    assert [kind for kind, _ in recorded_events(tmp_path)] == ["clock_set"] * bool(words)
    assert all(words in text for _, text in recorded_events(tmp_path))
    assert ("clock was set" in answer.err) == bool(words)
