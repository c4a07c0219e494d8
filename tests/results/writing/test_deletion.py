"""Deletion of episodes and campaigns: complete, also after a kill at any time, and limited to what is theirs."""

import errno
import itertools
import json
import os
import shutil
import signal
import sqlite3
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, TextIO

import pytest

from tests.cli.test_record_verbs import vsnbench
from tests.processes import Fork
from tests.results.locked_study import lock_drawn, run_ranks
from tests.results.records_of_a_lab import begun, plan, run, stopped
from tests.shared_records import write_copy
from vsnbench.errors import RecordError
from vsnbench.evidence.bundle.make import BundleRequest, make_bundle
from vsnbench.evidence.bundle.selection import select_campaigns
from vsnbench.evidence.verification.verify import verify
from vsnbench.report.frames import open_results
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing import deletion
from vsnbench.results.writing.deletion import delete_for_good, finish_deletions
from vsnbench.results.writing.journal import Journal
from vsnbench.settings.user_config import BundleConfig

COUNTED = ("campaign", "trial", "episode", "step", "verdict", "placement")


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Campaign 1 with episodes 1 and 2 and their images, campaign 2 with episode 3 and a running one (4)."""
    monkeypatch.setenv("VSNBENCH_OPERATOR", "ada")
    write_copy(tmp_path, write_two_campaigns)
    return tmp_path


def write_two_campaigns(directory: Path) -> None:
    with Journal.open(sqlite_url(directory / "vsnbench.db")) as journal:
        first, second = (journal.find_or_create_campaign(plan(seed=seed)).trials for seed in (1, 2))
        for trial in (*first[:2], second[0]):
            claim = run(journal, trial, stopped(success=True))
            image = directory / claim.images_directory / "rgb" / "0001.jpg"
            image.parent.mkdir(parents=True)
            image.write_bytes(b"jpeg")
        begun(journal, second[1])


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


def test_a_link_in_the_place_of_images_is_moved_and_not_followed(results: Path, tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "kept").write_text("kept")
    moved = results / "episodes" / "000001"
    moved.rename(tmp_path / "elsewhere")
    moved.symlink_to(outside)
    done = vsnbench(results, "db", "delete", "--episode", "1", "--reason", "why", "--yes", "--json")
    assert (outside / "kept").read_text() == "kept"
    assert not moved.is_symlink()
    assert (Path(json.loads(done.stdout)["backup"]) / "episodes" / "000001").readlink() == outside


@pytest.mark.parametrize("named", ["episodes", "episodes/000002", ".", "episodes/000001/rgb", "../outside"])
def test_an_episode_that_names_other_files_than_its_own_is_not_deleted(results: Path, named: str) -> None:
    with sqlite3.connect(results / "vsnbench.db") as database:
        database.execute("UPDATE episode SET images_directory = ? WHERE id = 1", (named,))
    before, files = rows(results), sorted((results / "episodes").rglob("*"))
    done = vsnbench(results, "db", "delete", "--episode", "1", "--reason", "why", "--yes")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
    assert "nothing was deleted" in done.stderr
    assert rows(results) == before
    assert sorted((results / "episodes").rglob("*")) == files


DELETE = ("db", "delete", "--episode", "1,2", "--reason", "a face", "--yes", "--json")


@pytest.fixture(params=["this disk", "another disk"])
def on_a_disk(request: pytest.FixtureRequest, results: Path) -> Iterator[bool]:
    """Return whether deleted files go to another disk."""
    if request.param == "this disk":
        yield False
        return
    shared_memory = Path("/dev/shm")
    if not shared_memory.is_dir() or shared_memory.stat().st_dev == results.stat().st_dev:
        pytest.skip("/dev/shm, the second disk of every Linux, is missing or holds the results")
    with tempfile.TemporaryDirectory(dir=shared_memory) as directory:
        (results / "deleted").symlink_to(directory)
        yield True


def kill_during_deletion(results: Path, owner: str, name: str, call: str, when: str) -> None:
    """Delete episodes 1 and 2 in another process, which is killed before or after a certain call of a function."""
    owned = {"deletion": deletion, "shutil": shutil, "Path": Path}[owner]
    original, calls = getattr(owned, name), itertools.count(1)

    def killing(*arguments: Any, **keywords: Any) -> Any:
        is_this_call = next(calls) == int(call)
        if is_this_call and when == "before":
            os.kill(os.getpid(), signal.SIGKILL)
        result = original(*arguments, **keywords)
        if is_this_call:
            os.kill(os.getpid(), signal.SIGKILL)
        return result

    def delete(_sink: TextIO) -> None:
        setattr(owned, name, killing)  # in the fork only
        delete_for_good(ResultsDirectory.locate(results), [1, 2], [], author="ada", reason="a face")

    killed = Fork.of(delete)
    assert killed.wait() == -signal.SIGKILL
    killed.stdout.close()


def assert_deleted(results: Path, aside: Path, before: dict[str, int]) -> None:
    assert rows(results)["episode"] == before["episode"] - 2
    assert [path.name for path in (results / "episodes").iterdir()] == ["000003"]
    assert {path.name for path in aside.iterdir()} == {"vsnbench.db", "episodes"}
    for name in ("000001", "000002"):
        assert (aside / "episodes" / name / "rgb" / "0001.jpg").read_bytes() == b"jpeg"
    assert len(list((aside / "episodes").iterdir())) == 2
    assert rows(results, aside / "vsnbench.db") == before


@pytest.mark.parametrize(
    ("point", "rows_are_gone"),
    [
        (("deletion", "_list_unfinished", "1", "after"), False),
        (("deletion", "backup", "1", "after"), False),
        (("deletion", "_delete", "1", "after"), False),
        (("deletion", "_move_files", "1", "before"), True),
        (("Path", "rename", "1", "before"), True),
        (("Path", "rename", "1", "after"), True),
        (("Path", "rename", "2", "before"), True),
        (("deletion", "_move", "2", "after"), True),
    ],
    ids=lambda value: "-".join(value[1:]) if isinstance(value, tuple) else "",
)
def test_a_deletion_that_was_killed_is_finished_by_repeating_it(
    results: Path, point: tuple[str, ...], rows_are_gone: bool
) -> None:
    before = rows(results)
    kill_during_deletion(results, *point)
    assert rows(results)["episode"] == before["episode"] - 2 * rows_are_gone
    done = vsnbench(results, *DELETE)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["episodes"] == [1, 2]
    assert_deleted(results, Path(answer["backup"]), before)
    assert len(list((results / "deleted").iterdir())) == 1
    assert len(events(results)) == 2


@pytest.mark.parametrize(
    "point",
    [("shutil", "copytree", "1", "after"), ("shutil", "copytree", "2", "before"), ("shutil", "rmtree", "1", "before")],
    ids="-".join,
)
@pytest.mark.parametrize("on_a_disk", ["another disk"], indirect=True)
def test_a_deletion_to_another_disk_that_was_killed_is_finished(
    results: Path, on_a_disk: bool, point: tuple[str, ...]
) -> None:
    before = rows(results)
    kill_during_deletion(results, *point)
    assert vsnbench(results, "episodes", "list").returncode == 0
    (aside,) = (results / "deleted").iterdir()
    assert_deleted(results, aside, before)


def test_deleted_files_can_go_to_another_disk(results: Path, on_a_disk: bool) -> None:
    before = rows(results)
    done = vsnbench(results, *DELETE)
    assert done.returncode == 0, done.stderr
    assert_deleted(results, Path(json.loads(done.stdout)["backup"]), before)


@pytest.mark.parametrize(
    ("function", "rows_are_gone", "left"),
    [("_delete", False, 0), ("_move_files", True, 1)],
)
def test_readers_are_unaffected_by_an_interrupted_deletion(
    results: Path, monkeypatch: pytest.MonkeyPatch, function: str, rows_are_gone: bool, left: int
) -> None:
    interrupt_deletion_of_1(results, monkeypatch, function)
    place, files = ResultsDirectory.locate(results), sorted(results.rglob("*"))
    assert (1 in set(open_results(results).episodes().episode)) is not rows_are_gone
    request = BundleRequest(partial(select_campaigns, numbers=[1]), BundleConfig(), with_images=False)
    assert make_bundle(place, request, results.parent / f"{results.name}.zip").episodes == 2 - rows_are_gone
    checked = next(check for check in verify(results, lambda *_: None).checks if check.name == "files")
    assert "no episode of the record has it" not in {found.text for found in checked.findings}
    assert not any("db delete" in found.text for found in checked.findings)
    named = {reason: count for reason, count in checked.not_checked.items() if "db delete" in reason}
    assert list(named.values()) == [1] * left
    assert all(f"episodes list{place.options}`" in reason for reason in named)
    assert sorted(results.rglob("*")) == files, "these readers write nothing"


def interrupt_deletion_of_1(results: Path, monkeypatch: pytest.MonkeyPatch, function: str) -> None:
    """Leave what a process leaves that is killed at the begin of `_move_files`, or after another function."""
    original = getattr(deletion, function)

    def interrupted(*arguments: Any, **keywords: Any) -> None:
        if function != "_move_files":
            original(*arguments, **keywords)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(deletion, function, interrupted)
        with pytest.raises(KeyboardInterrupt):
            delete_for_good(ResultsDirectory.locate(results), [1], [], author="ada", reason="a face")


def test_files_that_cannot_be_moved_are_moved_by_the_next_command(
    results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = rows(results)

    def full(self: Path, _target: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self))

    monkeypatch.setattr(Path, "rename", full)
    with pytest.raises(RecordError) as refused:
        delete_for_good(ResultsDirectory.locate(results), [1, 2], [], author="ada", reason="a face")
    assert refused.value.code == "unfinished-deletion"
    assert rows(results)["episode"] == before["episode"] - 2
    monkeypatch.undo()
    assert vsnbench(results, "episodes", "list").returncode == 0
    (aside,) = (results / "deleted").iterdir()
    assert_deleted(results, aside, before)


@pytest.mark.parametrize("function", ["_delete", "_move_files"])
def test_a_list_of_another_database_stays_and_a_deletion_that_cannot_be_finished_is_a_warning(
    results: Path, monkeypatch: pytest.MonkeyPatch, function: str
) -> None:
    copy = sqlite_url(Path(shutil.copy(results / "vsnbench.db", results.parent / f"{results.name}-copy.db")))
    empty = sqlite_url(results.parent / f"{results.name}-empty.db")
    with Journal.open(empty):
        pass
    interrupt_deletion_of_1(results, monkeypatch, function)
    files = sorted(results.rglob("*"))
    for url in (copy, empty):
        assert finish_deletions(ResultsDirectory.locate(results, url)) == []
        assert sorted(results.rglob("*")) == files
    place = ResultsDirectory.locate(results)
    with monkeypatch.context() as patch:
        patch.setattr(deletion, "_move", raise_full)
        assert finish_deletions(place) == [], "a command that only reads goes on"
    assert len(finish_deletions(place, required=True)) == (function == "_move_files")


def raise_full(source: Path, _target: Path) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(source))


@pytest.mark.parametrize(
    "listed",
    [
        {"images_directories": ["episodes"]},
        {"images_directories": ["episodes/000002"]},
        {"images_directories": ["../outside"]},
        {"episodes": [3], "images_directories": ["episodes/000003"]},
        {"uuids": [["x"]]},
        {"more": []},
        [],
    ],
    ids=str,
)
def test_a_list_of_unknown_origin_moves_nothing_that_a_row_names(results: Path, listed: object) -> None:
    aside = results / "deleted" / "2026-01-01T00-00-00"
    aside.mkdir(parents=True)
    whole = {"database": "vsnbench.db", "episodes": [1], "campaigns": [], "uuids": ["a"]}
    whole |= {"images_directories": ["episodes/000001"]}
    (aside / "unfinished.json").write_text(json.dumps(whole | listed if isinstance(listed, dict) else listed))
    files = sorted((results / "episodes").rglob("*"))
    assert vsnbench(results, "episodes", "list").returncode == 0
    assert sorted((results / "episodes").rglob("*")) == files
