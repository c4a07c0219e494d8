import json
import sqlite3
from pathlib import Path

import pytest

from tests.cli.test_record_verbs import vsnbench
from tests.results.locked_study import lock_drawn, run_ranks
from tests.results.records_of_a_lab import begun, plan, run, stopped
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.writing.journal import Journal

COUNTED = ("campaign", "trial", "episode", "step", "verdict", "placement")


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Campaign 1 with episodes 1 and 2 and their images, campaign 2 with episode 3 and a running one (4)."""
    monkeypatch.setenv("VSNBENCH_OPERATOR", "ada")
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        first, second = (journal.find_or_create_campaign(plan(seed=seed)).trials for seed in (1, 2))
        for trial in (*first[:2], second[0]):
            claim = run(journal, trial, stopped(success=True))
            image = tmp_path / claim.images_directory / "rgb" / "0001.jpg"
            image.parent.mkdir(parents=True)
            image.write_bytes(b"jpeg")
        begun(journal, second[1])
    return tmp_path


def rows(results: Path, file: Path | None = None) -> dict[str, int]:
    with sqlite3.connect(file or results / "vsnbench.db") as database:
        return {table: database.execute(f"SELECT count(*) FROM {table}").fetchone()[0] for table in COUNTED}


def events(results: Path) -> list[tuple[str, str, str]]:
    with sqlite3.connect(results / "vsnbench.db") as database:
        return database.execute("SELECT kind, author, text FROM event ORDER BY id").fetchall()


def test_an_episode_goes_with_its_rows_and_the_backup_has_them(results: Path) -> None:
    before = rows(results)
    done = vsnbench(results, "db", "delete", "--episode", "1", "--reason", "a face", "--yes", "--json")
    assert done.returncode == 0, done.stderr
    aside = Path(json.loads(done.stdout)["backup"])
    assert rows(results) == before | {"episode": 3, "step": before["step"] - 3, "verdict": before["verdict"] - 1}
    assert rows(results, aside / "vsnbench.db") == before
    assert not (results / "episodes" / "000001").exists()
    assert (aside / "episodes" / "000001" / "rgb" / "0001.jpg").read_bytes() == b"jpeg"
    assert (results / "episodes" / "000002" / "rgb" / "0001.jpg").exists()
    ((kind, author, words),) = events(results)
    assert (kind, author) == ("deleted", "ada")
    assert words.startswith("episode 1 (")
    assert words.endswith("): a face")
    with Journal.open(sqlite_url(results / "vsnbench.db")) as journal:
        again = journal.find_or_create_campaign(plan(seed=1))
        assert run(journal, again.trials[0], stopped(success=True)).id == 5, "the trial runs again under a new number"


def test_a_campaign_goes_with_everything_in_it(results: Path) -> None:
    assert vsnbench(results, "db", "delete", "--campaign", "1", "--reason", "wrong robot", "--yes").returncode == 0
    assert rows(results)["campaign"] == 1
    assert rows(results)["episode"] == 2
    assert rows(results)["trial"] == 4
    assert [words.split(" ")[:2] for _, _, words in events(results)] == [
        ["campaign", "1"], ["episode", "1"], ["episode", "2"],
    ]  # fmt: skip
    assert vsnbench(results, "report").returncode == 0


@pytest.mark.parametrize(
    "words",
    [
        ["--reason", "why", "--yes"],
        ["--episode", "1", "--yes"],
        ["--episode", "1", "--reason", "  ", "--yes"],
        ["--episode", "1", "--reason", "why"],
        ["--episode", "99", "--reason", "why", "--yes"],
        ["--campaign", "99", "--reason", "why", "--yes"],
        ["--episode", "1-4", "--reason", "why", "--yes"],
        ["--campaign", "2", "--reason", "why", "--yes"],
        ["--episode", "one", "--reason", "why", "--yes"],
    ],
)
def test_what_may_not_be_deleted_stays_and_is_said_in_one_line(results: Path, words: list[str]) -> None:
    before = rows(results)
    done = vsnbench(results, "db", "delete", *words)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert rows(results) == before
    assert not (results / "deleted").exists()


def test_a_locked_study_keeps_its_data(tmp_path: Path) -> None:
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        study = lock_drawn(journal)
        run_ranks(journal, study, range(2))
    for words in (["--episode", "1"], ["--campaign", "1"]):
        done = vsnbench(tmp_path, "db", "delete", *words, "--reason", "why", "--yes")
        assert (done.returncode, "locked study" in done.stderr) == (2, True)
    assert rows(tmp_path)["episode"] == 2


def test_a_link_in_the_place_of_images_is_not_followed(results: Path, tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "kept").write_text("kept")
    moved = results / "episodes" / "000001"
    moved.rename(tmp_path / "elsewhere")
    moved.symlink_to(outside)
    vsnbench(results, "db", "delete", "--episode", "1", "--reason", "why", "--yes")
    assert (outside / "kept").read_text() == "kept"
