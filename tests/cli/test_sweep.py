import json
from pathlib import Path

import pytest

from tests.cli.test_record_verbs import vsnbench
from vsnbench.cli.sweep_summary import cost_words
from vsnbench.runner.sweep import Cost

SWEEP = ("run", "--model", "forward,random", "--seeds", "0-1", "--goal", "chair", "--max-steps", "2", "--workers", "1")


def test_a_sweep_is_run_reported_and_gone_on_with_like_any_run(tmp_path: Path) -> None:
    first = vsnbench(tmp_path, *SWEEP, "--starts", "1")
    assert first.returncode == 0, first.stderr
    assert "4 campaigns, up to 4 trials: about 36 s on 1 worker, at 3 s a trial, a guess" in first.stderr
    assert "all 4 trials are done" in first.stderr
    more = vsnbench(tmp_path, *SWEEP, "--starts", "1-2")
    assert "up to 8 trials, 4 of them done" in more.stderr
    assert "at this record's pace (2 episodes)" in more.stderr
    assert "4/4 seed 1: random in apartment" in more.stderr
    models = json.loads(vsnbench(tmp_path, "report", "--format", "json").stdout)["models"]
    assert [(model["model"], model["seeds"]) for model in models] == [("forward", [0, 1]), ("random", [0, 1])]


def test_a_long_sweep_is_asked_for_on_a_terminal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    asked: list[str] = []
    monkeypatch.setattr("typer.confirm", lambda words, **_: asked.append(words))
    done = vsnbench(tmp_path, "run", "--model", "forward", "--seeds", "0-999", "--goal", "all", "--workers", "1")
    assert (asked, done.returncode) == (["Start?"], 1)
    assert "1,000 campaigns, up to 105,000 trials: about 89 h on 1 worker" in done.stderr
    assert "nothing was run" in done.stderr
    assert not (tmp_path / "vsnbench.db").exists()


def test_a_sweep_that_is_done_says_so() -> None:
    assert cost_words(Cost(1, 20, 20, 0.0, 2, 7)) == "1 campaign, up to 20 trials, 20 of them done"
