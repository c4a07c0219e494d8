"""A command that cannot be executed ends with one line, its exit code and its error code, and writes nothing."""

import re
import shlex
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.cli.console import vsnbench
from tests.results.records_of_a_lab import begun, plan, run, stopped, void
from tests.sites.goal_sites import write_site
from tests.study.studies import study_text
from tests.web.results_browser.served_record import make_record
from tests.web.second_judgement import blind_record
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.writing.journal import Journal
from vsnbench.settings.yaml_text import load_yaml

TABLE = load_yaml((Path(__file__).parent / "commands.yaml").read_text(encoding="utf-8"))
ROWS = [(where, *row) for where, rows in TABLE.items() for row in rows]
EQUIVALENCE = {"primary": {"kind": "equivalence"}}
STUDIES: dict[str, dict[str, Any]] = {
    "one-start": {"starting_positions": "3"},
    "one-start-decided": {"starting_positions": "3", "stopping": "decided"},
    "late-look": {"starting_positions": "1-8", "stopping": "decided", "looks": [8, 15]},
    "zero-margin": {**EQUIVALENCE, "margin": 0},
    "wide-margin": {**EQUIVALENCE, "margin": 1.2},
}
"""Plans in the folder `record` that a study refuses."""
ENDED = re.compile(r"\(code ([\w-]+), exit code \d\)$", re.MULTILINE)
"""The code of an error in a log file."""


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a record of two models, a site with goals of every kind, and faulty files."""
    folder = tmp_path_factory.mktemp("record")
    make_record(folder / "results")
    write_site(folder)
    (folder / "broken.yaml").write_text("name: lab\nrooms: []\nwalls: []\nstarts: []\nceiling_height_m: low\n")
    (folder / "file").write_text("no directory")
    for name, changes in STUDIES.items():
        (folder / f"{name}.yaml").write_text(study_text(**changes), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def nothing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return an empty folder."""
    return tmp_path_factory.mktemp("nothing")


@pytest.fixture(scope="module")
def judging(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder whose record has a proposed success (1), a void attempt (2), a success (3), a running episode."""
    folder = tmp_path_factory.mktemp("judging")
    (folder / "results").mkdir()
    with Journal.open(sqlite_url(folder / "results" / "vsnbench.db")) as journal:
        trials = journal.find_or_create_campaign(plan()).trials
        run(journal, trials[0], replace(stopped(success=True), proposed=True))
        run(journal, trials[1], void())
        run(journal, trials[2], stopped(success=True))
        begun(journal, trials[3])
    return folder


@pytest.fixture(scope="module")
def blind(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder whose record has 40 episodes that one person has judged."""
    folder = tmp_path_factory.mktemp("blind")
    blind_record.make_record(folder / "results")
    return folder


def contents(folder: Path) -> dict[str, int]:
    """Return the files below a folder with their sizes, a database with the number of its rows."""
    return {
        str(path): rows_of(path) if path.suffix == ".db" else path.lstat().st_size
        for path in folder.rglob("*")
        if path.suffix[-4:] not in ("-wal", "-shm")
    }


def rows_of(database: Path) -> int:
    with closing(sqlite3.connect(database)) as connection:
        tables = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall()
        counted = [name for (name,) in tables if name != "process"]  # one row for every process that opened it to write
        return sum(connection.execute(f"SELECT count(*) FROM {name}").fetchone()[0] for name in counted)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[1].encode("unicode_escape").decode()[:60])
def test_a_mistake_ends_in_a_line_and_writes_nothing(
    row: Any,
    capsys: pytest.CaptureFixture[str],
    request: pytest.FixtureRequest,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    where, words, exit_code, code, *mentioned = row
    folder = request.getfixturevalue(where)
    monkeypatch.chdir(folder)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    before = contents(folder)
    answer = vsnbench(monkeypatch, capsys, "--log-file", str(tmp_path / "log"), *shlex.split(words))
    assert (answer.code, answer.out) == (exit_code, ""), answer
    assert answer.err.startswith("vsnbench: error: ")
    assert answer.err.count("\n") == 1
    assert answer.err.removesuffix("\n").isprintable()
    assert [each for each in mentioned if each not in answer.err] == [], answer.err
    log = (tmp_path / "log").read_text(encoding="utf-8") if (tmp_path / "log").exists() else ""
    assert (ENDED.findall(log) or [""]) == [code]
    assert contents(folder) == before
