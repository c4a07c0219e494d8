"""`vsnbench protocol`, and --protocol of `vsnbench run`."""

import contextlib
import json
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.console import Answer, vsnbench

Run = Callable[..., Answer]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Run:
    monkeypatch.chdir(tmp_path)
    return lambda *words: vsnbench(monkeypatch, capsys, *words)


def recorded(results: Path) -> list[tuple[dict[str, object], str]]:
    """Return the protocol of every campaign, and its hash."""
    with contextlib.closing(sqlite3.connect(results / "vsnbench.db")) as database:
        rows = database.execute("SELECT protocol, protocol_sha256 FROM campaign ORDER BY id").fetchall()
    return [(json.loads(content), sha256) for content, sha256 in rows]


def test_list_and_show_print_the_named_protocols(run: Run) -> None:
    listed = json.loads(run("protocol", "list", "--json").out)
    assert [each["name"] for each in listed] == ["ros4vsn", "habitat-objectnav", "onsite-instruction", "goat-sequence"]
    shown = json.loads(run("protocol", "show", "onsite-instruction", "--json").out)
    values = {row["name"]: (row["value"], row["unit"], row["default"]) for row in shown["parameters"]}
    assert values["max_time_s"] == (360.0, "s", None)
    assert values["success_distance_m"] == (2.0, "m", 1.0)
    assert "max_time_s" in run("protocol", "show", "onsite-instruction").out


def test_check_reports_faults_by_line_and_fails(run: Run) -> None:
    Path("lab.yaml").write_text("name: lab\nmax_tim_s: 5\nmax_path_m: -1\n")
    answer = run("protocol", "check", "lab.yaml", "--json")
    assert answer.code == 1
    found = [(fault["line"], fault["field"], fault["code"]) for fault in json.loads(answer.out)["faults"]]
    assert found == [(2, "max_tim_s", "unknown-field"), (3, "max_path_m", "invalid-field")]
    Path("lab.yaml").write_text("name: lab\nmax_time_s: 5\nname: lab\n")
    (fault,) = json.loads(run("protocol", "check", "lab.yaml", "--json").out)["faults"]
    assert fault["line"] == 3
    Path("lab.yaml").write_text("name: lab\nmax_time_s: 5\n")
    assert run("protocol", "check", "lab.yaml").code == 0


WORDS = ("run", "--model", "tests.cli.turning:Turning", "--goal", "chair", "--starts", "1")


def test_a_run_under_a_time_limit_ends_by_it_and_is_a_campaign_of_its_own(run: Run, tmp_path: Path) -> None:
    Path("lab.yaml").write_text("name: lab\nmax_time_s: 20\n")
    assert run(*WORDS, "--max-steps", "3").code == 0
    assert run(*WORDS, "--protocol", "lab.yaml").code == 0
    (paper, _), (lab, _) = recorded(tmp_path / "results")
    assert paper.keys().isdisjoint({"name", "max_time_s", "max_path_m"})
    assert (lab["version"], lab["name"], lab["max_time_s"], lab["max_actions"]) == (3, "lab", 20.0, 150)
    (episode,) = json.loads(run("episodes", "list", "--campaign", "2", "--json").out)
    assert (episode["end_reason"], episode["success"]) == ("time_limit", False)
    report = json.loads(run("report", "--json").out)
    assert [one["total"]["time_limits"] for one in report["models"]] == [0, 1]
    assert [one["total"]["step_limits"] for one in report["models"]] == [1, 0]


def test_the_default_protocol_can_be_configured_and_its_cap_replaced(run: Run, tmp_path: Path) -> None:
    Path("vsnbench.toml").write_text('protocol = "habitat-objectnav"\n')
    answer = run(*WORDS, "--max-steps", "2")
    assert answer.code == 0
    assert "protocol habitat-objectnav" in answer.err
    ((protocol, _),) = recorded(tmp_path / "results")
    assert (protocol["name"], protocol["max_actions"]) == ("habitat-objectnav", 2)
