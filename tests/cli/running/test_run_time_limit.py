"""The time limit for actions in vsnbench.toml applies to each model of a command in the way that the model has one."""

import json
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from tests.cli.console import vsnbench
from tests.models.remote.servers import stub_server

TURNS = """
class Model:
    card = {"name": "turns"}

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        return "TURN_LEFT"
"""


def test_a_limit_in_the_file_applies_to_a_served_model_next_to_one_of_this_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "vsnbench.toml").write_text("[models]\nact_timeout_s = 7.5\n")
    with stub_server(TURNS, tmp_path) as (url, _):
        answer = vsnbench(
            monkeypatch,
            capsys,
            "run",
            "--model",
            f"oracle,{url}",
            "--goal",
            "chair",
            "--starts",
            "1",
            "--max-steps",
            "3",
        )
    assert answer.code == 0, answer.err
    with closing(sqlite3.connect(tmp_path / "results" / "vsnbench.db")) as database:
        rows = database.execute("SELECT details FROM step ORDER BY episode_id, number").fetchall()
    served = [
        details["wire"]["act_timeout_s"] for details in map(json.loads, (row[0] for row in rows)) if "wire" in details
    ]
    assert len(rows) == 6
    assert served == [60.0, 7.5, 7.5]  # the first action of a connection has the time of `reset`


def test_an_option_that_was_typed_is_refused_for_two_models(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = vsnbench(
        monkeypatch, capsys, "run", "--model", "oracle,pirlnav", "--goal", "chair", "--weights", "embedded"
    )
    assert answer.code == 2
    assert "--weights is for one model" in answer.err
    assert not (tmp_path / "results").exists()
