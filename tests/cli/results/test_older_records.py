"""Archived records of older schemas are read through an upgraded copy; nothing in their directory changes."""

import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path

import pytest

from tests.cli.test_record_verbs import vsnbench
from tests.processes import wait_until
from tests.web.results_browser.served_record import entered, served
from vsnbench import open_results
from vsnbench.report.comparison.looks import LOOKS_FILE

RECORD = Path(__file__).parents[2] / "data" / "records" / "0001.sql"


@pytest.fixture
def archived(tmp_path: Path) -> Path:
    """A record of the first schema."""
    results = tmp_path / "results"
    results.mkdir()
    with closing(sqlite3.connect(results / "vsnbench.db")) as database:
        database.executescript(RECORD.read_text(encoding="utf-8"))
    return results


def content(results: Path) -> dict[str, bytes]:
    """Return every file but the looks at comparisons, which `compare` writes beside any record."""
    return {file.name: file.read_bytes() for file in results.iterdir() if file.name != LOOKS_FILE}


@pytest.mark.parametrize(
    "words",
    [
        ["report"],
        ["compare", "pirlnav", "vlv"],
        ["episodes", "list"],
        ["episodes", "show", "1"],
        ["export", "csv", "-o", "{}.csv"],
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_a_command_reads_an_older_record_and_leaves_it_as_it_is(archived: Path, words: list[str]) -> None:
    before = content(archived)
    done = vsnbench(archived, *(word.format(archived) for word in words))
    assert done.returncode == 0, done.stderr
    assert done.stdout
    assert content(archived) == before


@pytest.mark.parametrize(
    "words",
    [
        ["note", "1", "seen"],
        ["judge", "1", "--void", "visitor", "--yes"],
        ["judge", "1", "--second", "Grace", "--retract"],
        ["db", "delete", "--episode", "1", "--reason", "a face", "--yes"],
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_a_command_that_writes_to_an_older_record_is_refused(archived: Path, words: list[str]) -> None:
    before = content(archived)
    done = vsnbench(archived, *words)
    assert done.returncode != 0
    assert "`vsnbench db upgrade` upgrades it" in done.stderr
    assert content(archived) == before


def test_python_and_the_page_read_an_older_record(archived: Path) -> None:
    before = content(archived)
    episodes = open_results(archived).episodes()
    with served(archived) as address:
        client = entered(address)
        wait_until(lambda: client.ask("GET", "/data/episodes.json").status == 200, "the list is there")
        rows = client.ask("GET", "/data/episodes.json").json["rows"]
        refused = client.post("/annotate", episodes=[1], note="seen")
        assert refused.status >= 400
        assert "db upgrade" in refused.json["message"]
    assert [row[0] for row in rows] == sorted(episodes["episode"])
    assert len(rows) > 10
    assert content(archived) == before
    assert not list(Path(tempfile.gettempdir()).glob("vsnbench-older-*/vsnbench.db-journal"))
