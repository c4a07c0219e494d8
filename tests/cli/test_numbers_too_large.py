"""Numbers that no column of a database can hold, on the command line."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.results.records_of_a_lab import plan, run, stopped
from vsnbench.cli.main import build_app
from vsnbench.errors import RecordError
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.writing.journal import Journal

TOO_LARGE = str(10**30)


@pytest.mark.parametrize(
    "words",
    [
        ("view", TOO_LARGE, "--path"),
        ("episodes", "show", TOO_LARGE),
        ("episodes", "list", "--limit", TOO_LARGE),
        ("export", "bag", TOO_LARGE, "-o", "x.bag"),
        ("db", "remove-import", TOO_LARGE),
        ("judge", TOO_LARGE, "--confirm"),
    ],
)
def test_a_number_too_large_for_the_database_is_refused(tmp_path: Path, words: tuple[str, ...]) -> None:
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        run(journal, journal.find_or_create_campaign(plan()).trials[0], stopped(success=True), steps=1)
    result = CliRunner().invoke(build_app(words[0]), [*words, "--results", str(tmp_path)])
    assert isinstance(result.exception, RecordError), result.output
