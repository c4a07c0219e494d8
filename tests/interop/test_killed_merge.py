"""A merge killed before, between and after moving its files and committing its rows."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.interop.test_merge import content, copy_of, everything, lab, merged_into
from tests.results.records_of_a_lab import plan, run, stopped
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.files.images import EpisodeImages
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.setup.cleanup import sweep_results

DYING = """
import os, signal, sys
from pathlib import Path
from vsnbench.interop.merge import merge, merge_source
from vsnbench.results.writing.journal import Journal
from vsnbench.results.files import staged_import
from vsnbench.results.files.directory import ResultsDirectory

name, calls, after = sys.argv[1], int(sys.argv[2]), sys.argv[3] == "after"
owner = {"copy": staged_import.StagedImport, "place": staged_import.StagedImport, "merge": Journal}[name]
real = getattr(owner, name)

def dying(*words):
    global calls
    calls -= 1
    if calls == 0 and not after:
        os.kill(os.getpid(), signal.SIGKILL)
    real(*words)
    if calls == 0:
        os.kill(os.getpid(), signal.SIGKILL)

setattr(owner, name, dying)
merge(ResultsDirectory.locate(Path(sys.argv[4]), None, {}), [merge_source(sys.argv[5])])
"""


@pytest.fixture(scope="module")
def two_labs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, dict[str, object]]:
    """Two records, and the content of their merge."""
    folder = tmp_path_factory.mktemp("labs")
    here, there = lab(folder / "here", plan(), seed=1), lab(folder / "there", plan(), plan(seed=8), seed=2)
    both = copy_of(here, folder / "both")
    merged_into(both, there)
    return here, there, content(both)["episodes"]


@pytest.mark.parametrize(
    ("moment", "done"),
    [
        (("copy", "3", "after"), False),
        (("place", "3", "after"), False),
        (("merge", "1", "before"), False),
        (("merge", "1", "after"), True),
    ],
)
def test_a_killed_merge_leaves_the_record_as_it_was_or_done_and_nothing_else(
    tmp_path: Path,
    two_labs: tuple[Path, Path, dict[str, object]],
    moment: tuple[str, str, str],
    done: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    here, there, both = two_labs
    target = copy_of(here, tmp_path / "target")
    before, files = content(target)["episodes"], set(everything(target / "episodes"))
    root = Path(__file__).parents[2]
    copies = tmp_path / "copies"
    copies.mkdir()
    killed = subprocess.run(
        [sys.executable, "-c", DYING, *moment, str(target), str(there)],
        cwd=root,
        env={**os.environ, "PYTHONPATH": str(root), "TMPDIR": str(copies)},
    )
    assert killed.returncode == -signal.SIGKILL
    assert set(content(target)["episodes"]) == (set(both) if done else set(before))
    place = ResultsDirectory.locate(target, None, {})
    with Journal.open(place.database_url) as journal:
        sweep_results(place, journal)
    left = {name for name in everything(target) if not name.startswith("vsnbench.db")}
    assert not any("arriv" in name for name in left)
    assert [path.name for path in target.iterdir() if path.name.startswith(".")] == []
    if done:
        assert content(target)["episodes"] == both
    else:
        assert {name.removeprefix("episodes/") for name in left} == files
    monkeypatch.setattr("tempfile.tempdir", str(copies))
    merged_into(target, there)
    assert content(target)["episodes"] == both
    assert [*copies.glob("*/*")] == [], "the killed merge's copy of the other database"


def test_a_number_of_a_killed_merge_is_reused_without_the_files_of_the_merge(tmp_path: Path) -> None:
    directory = tmp_path / "episodes" / "000004"
    (directory / "rgb").mkdir(parents=True)
    (directory / "rgb" / "0050.jpg").write_bytes(b"another lab's")
    (directory / ".arriving").write_text("elsewhere.1 uuid")
    EpisodeImages(directory)
    assert everything(directory) == {}


def test_what_a_living_merge_brings_in_is_left_alone(tmp_path: Path) -> None:
    place = ResultsDirectory.locate(tmp_path, None, {})
    place.prepare()
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        run(journal, journal.find_or_create_campaign(plan()).trials[0], stopped(success=True))
        directory = tmp_path / "episodes" / "000004"
        directory.mkdir()
        (directory / ".arriving").write_text(f"{os.uname().nodename}.{os.getpid()} uuid")
        sweep_results(place, journal)
        assert directory.exists()
