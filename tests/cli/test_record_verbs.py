import contextlib
import io
import json
import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from unittest import mock

import pytest

from tests.results.records_of_a_lab import plan, run, stopped, void
from vsnbench.cli.main import main
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.schema import migrate
from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.journal import Journal


@dataclass(frozen=True)
class Done:
    """Result of a command."""

    returncode: object
    stdout: str
    stderr: str


def vsnbench(results: Path, *words: str) -> Done:
    """Run the console script in this process, which saves the imports."""
    stdout, stderr = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["vsnbench", *words]),
        mock.patch.dict(os.environ, {"VSNBENCH_RESULTS": str(results)}),
        contextlib.redirect_stdout(stdout),
        contextlib.redirect_stderr(stderr),
        pytest.raises(SystemExit) as exit_,
    ):
        main()
    return Done(exit_.value.code, stdout.getvalue(), stderr.getvalue())


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes of a model whose name contains terminal and table markup."""
    folder = tmp_path_factory.mktemp("results")
    given = plan()
    hostile = replace(given, model=replace(given.model, name="[red]evil\x1b[31m\n"))
    with Journal.open(sqlite_url(folder / "vsnbench.db")) as journal:
        trials = journal.find_or_create_campaign(hostile).trials
        run(journal, trials[0], void())
        run(journal, trials[0], stopped(success=True))
    return folder


def test_names_from_the_record_are_printed_as_text(results: Path) -> None:
    for words in (["episodes", "list"], ["episodes", "show", "2", "--steps"], ["db", "status"]):
        done = vsnbench(results, *words)
        assert done.returncode == 0, done.stderr
        assert "[red]evil" in done.stdout
        assert "\x1b" not in done.stdout


def test_the_list_can_be_restricted_and_says_when_it_is_cut(results: Path) -> None:
    void_ones = vsnbench(results, "episodes", "list", "--outcome", "void", "--json").stdout
    assert [row["id"] for row in json.loads(void_ones)] == [1]
    cut = vsnbench(results, "episodes", "list", "--limit", "1")
    assert "latest 1 of 2" in cut.stderr
    assert vsnbench(results, "episodes", "list", "--goal", "bed").stderr.strip() == "no episodes found"


def test_the_database_can_be_found_upgraded_and_backed_up(tmp_path: Path) -> None:
    assert vsnbench(tmp_path, "db", "path").stdout.strip() == str(tmp_path / "vsnbench.db")
    assert vsnbench(tmp_path, "db", "upgrade").stdout.strip().endswith(f"schema none -> {migrate.HEAD}")
    assert "is up to date" in vsnbench(tmp_path, "db", "upgrade").stdout
    state = json.loads(vsnbench(tmp_path, "db", "status", "--json").stdout)
    assert (state["schema"], state["campaigns"]) == (state["newest_schema"], [])
    copy = tmp_path / "copy.db"
    assert vsnbench(tmp_path, "db", "backup", str(copy)).stdout.startswith(str(copy))
    assert copy.is_file()


def test_a_script_gets_every_episode_unless_it_asks_for_fewer(tmp_path: Path) -> None:
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        many = replace(plan(), trials=[Trial("chair", 1, repetition) for repetition in range(1, 54)])
        for trial in journal.find_or_create_campaign(many).trials:
            run(journal, trial, stopped(success=True), steps=0)
    assert len(json.loads(vsnbench(tmp_path, "episodes", "list", "--json").stdout)) == 53
    assert len(json.loads(vsnbench(tmp_path, "episodes", "list", "--json", "--limit", "2").stdout)) == 2
    assert "latest 50 of 53" in vsnbench(tmp_path, "episodes", "list").stderr


def test_a_campaign_is_chosen_by_its_number_or_by_eight_digits_of_its_key(tmp_path: Path) -> None:
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        keys = {}
        for seed in range(20):
            campaign = journal.find_or_create_campaign(plan(seed=seed))
            keys[campaign.id] = plan(seed=seed).key
            run(journal, campaign.trials[0], stopped(success=True), steps=0)

    def listed(word: str) -> set[int]:
        return {
            one["campaign_id"]
            for one in json.loads(vsnbench(tmp_path, "episodes", "list", "--campaign", word, "--json").stdout or "[]")
        }

    assert len({key[0] for key in keys.values()}) < len(keys), "some keys have a common prefix"
    for number, key in keys.items():
        assert listed(str(number)) == {number}
        assert listed(key[0]) <= {int(key[0], 16)}
        assert listed(key[:8]) == {number}
    unknown = vsnbench(tmp_path, "episodes", "list", "--campaign", "21")
    assert (unknown.returncode, unknown.stdout, "'21' does not exist" in unknown.stderr) == (2, "", True)
