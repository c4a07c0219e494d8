"""A read-only results directory can be listed, reported and viewed, and stays unchanged."""

import ctypes
import json
import os
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.console import vsnbench

DROP_CAPABILITY = 24
"""PR_CAPBSET_DROP: without capabilities, file modes also apply to root."""
READ_ALL = """
import sys
from vsnbench.cli.main import main

for words in (["episodes", "show", "1", "--json"], ["report", "--json"], ["view", "1", "--path"]):
    sys.argv = ["vsnbench", *words, "--results", sys.argv[-1]]
    try:
        main()
    except SystemExit as end:
        assert not end.code, (words, end.code)
    print("----")
"""
LEAVE_WAL = """
import os, sqlite3, sys
connection = sqlite3.connect(sys.argv[1])
connection.execute("PRAGMA journal_mode = WAL")
connection.execute("UPDATE episode SET error = 'only in the WAL'")
connection.commit()
os._exit(0)
"""


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Path]:
    directory = tmp_path / "results"
    words = ("--model", "random", "--goal", "chair", "--starts", "1", "--max-steps", "2")
    assert vsnbench(monkeypatch, capsys, "run", *words, "--results", str(directory)).code == 0
    yield directory
    for folder in [directory, *(each for each in directory.rglob("*") if each.is_dir())]:
        folder.chmod(0o755)


def obey_modes() -> None:
    for number in range(64):
        ctypes.CDLL(None).prctl(DROP_CAPABILITY, number, 0, 0, 0)


def read_all(results: Path, cache: Path) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", READ_ALL, str(results)],
        env=os.environ | {"XDG_CACHE_HOME": str(cache)},
        preexec_fn=obey_modes,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split("----\n")


@pytest.mark.parametrize("has_wal", [False, True])
def test_a_read_only_record_is_read_whole_and_stays_as_it_is(results: Path, tmp_path: Path, has_wal: bool) -> None:
    if has_wal:
        subprocess.run([sys.executable, "-c", LEAVE_WAL, str(results / "vsnbench.db")], check=True, timeout=60)
        (results / "vsnbench.db-shm").unlink()
    else:
        with sqlite3.connect(results / "vsnbench.db") as connection:
            connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    before = {path: path.stat().st_mtime_ns for path in results.rglob("*")}
    for path in [*before, results]:
        path.chmod(path.stat().st_mode & ~0o222)
    shown, reported, path_shown, _ = read_all(results, tmp_path / "cache")
    assert ("only in the WAL" in shown) == has_wal
    assert json.loads(reported)
    recording = Path(path_shown.strip())
    assert recording.is_relative_to(tmp_path / "cache")
    assert recording.read_bytes()[:4] == b"RRF2"
    assert {path: path.stat().st_mtime_ns for path in results.rglob("*")} == before
