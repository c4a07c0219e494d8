import json
from pathlib import Path

import pytest

from tests.cli.test_record_verbs import vsnbench
from tests.results.records_of_a_lab import plan, run, stopped
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.writing.journal import Journal


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three successes of one model."""
    monkeypatch.setenv("VSNBENCH_OPERATOR", "ada")
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        for trial in journal.find_or_create_campaign(plan()).trials[:3]:
            run(journal, trial, stopped(success=True))
    return tmp_path


def listed(results: Path, *words: str) -> list[int]:
    return [episode["id"] for episode in json.loads(vsnbench(results, "episodes", "list", "--json", *words).stdout)]


def test_tags_and_notes_are_added_shown_and_searched(results: Path) -> None:
    done = vsnbench(results, "note", "1,3", "the lamp [red]flickered", "--tag", "Lamp,dark")
    assert (done.returncode, done.stdout) == (
        0, "episode 1: noted; tags dark, lamp\nepisode 3: noted; tags dark, lamp\n",
    )  # fmt: skip
    assert json.loads(vsnbench(results, "note", "3", "--untag", "lamp", "--json").stdout) == [
        {"id": 3, "tags": ["dark"], "author": "ada"}
    ]
    assert listed(results, "--tag", "dark") == [1, 3]
    assert listed(results, "--tag", "dark,lamp") == [1]
    assert listed(results, "--note", "[RED]") == [1, 3]
    assert listed(results, "--note", "nothing") == []
    assert "dark, lamp" in vsnbench(results, "episodes", "list").stdout
    shown = json.loads(vsnbench(results, "episodes", "show", "3", "--json").stdout)
    assert shown["tags"] == ["dark"]
    assert [(event["kind"], event["text"], event["author"]) for event in shown["events"]] == [
        ("note", "the lamp [red]flickered", "ada"),
        ("tagged", "lamp", "ada"),
        ("tagged", "dark", "ada"),
        ("untagged", "lamp", "ada"),
    ]
    assert "the lamp [red]flickered" in vsnbench(results, "episodes", "show", "1").stdout
