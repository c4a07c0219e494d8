"""A foreign results directory is only data: nothing outside it is accessed, nothing in it is run."""

import os
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from tests.cli.console import Answer
from tests.cli.console import vsnbench as type_in
from tests.viewer.synthetic_episode import record
from vsnbench.results.files.directory import ResultsDirectory


def vsnbench(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run the console script in the directory `cwd`."""
    program = "import sys; sys.path.pop(0); from vsnbench.cli.main import main; main()"  # -c puts the directory first
    inherited = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return subprocess.run(
        [sys.executable, "-c", program, *words], cwd=cwd, env=inherited, capture_output=True, text=True, timeout=120
    )


Typed = Callable[..., Answer]


@pytest.fixture
def typed(archive: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Typed:
    """Types words after `vsnbench` in the directory of the archive, in this process."""
    monkeypatch.chdir(archive.parent)
    return lambda *words: type_in(monkeypatch, capsys, *words)


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    path = tmp_path / "archive"
    record(ResultsDirectory.locate(path, environment={}), 2)
    return path


def say(archive: Path, images_directory: str) -> None:
    with closing(sqlite3.connect(archive / "vsnbench.db")) as database, database:
        database.execute("UPDATE episode SET images_directory = ?", [images_directory])


@pytest.mark.parametrize("elsewhere", ["../elsewhere", "/tmp/../{0}/elsewhere", "episodes/link"])
def test_an_episode_that_claims_to_lie_elsewhere_is_neither_read_nor_written(
    archive: Path, elsewhere: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(archive.parent)
    outside = archive.parent / "elsewhere"
    (outside / "rgb").mkdir(parents=True)
    (archive / "episodes" / "link").symlink_to(outside)
    say(archive, elsewhere.format(archive.parent))
    for words in (["view", "1", "--path"], ["episodes", "show", "1"], ["export", "bag", "1", "-o", "x.bag"]):
        done = type_in(monkeypatch, capsys, *words, "--results", str(archive))
        assert done.code == 1, done.out + done.err
        assert "leads out of it" in done.err
        assert "Traceback" not in done.err
    done = type_in(monkeypatch, capsys, "report", "--results", str(archive), "--output", "report")
    assert done.code == 0, done.err
    assert sorted(path.name for path in outside.rglob("*")) == ["rgb"]


@pytest.mark.parametrize(
    "words", [["view", "1", "--path"], ["episodes", "show", "1"], ["episodes", "list"], ["report"], ["judge", "1"]]
)
def test_no_text_of_an_archive_controls_the_terminal(archive: Path, words: list[str], typed: Typed) -> None:
    escapes = "\x1b]0;owned\x07\x9b2J"
    with closing(sqlite3.connect(archive / "vsnbench.db")) as database, database:
        database.execute("UPDATE episode SET images_directory = ?, error = ?", [f"../{escapes}\nforged", escapes])
        database.execute("UPDATE model SET name = ?, weights_label = ?", [f"m{escapes}", escapes])
        database.execute("UPDATE verdict SET reason = ?, author = ?", [escapes, escapes])
        database.execute("UPDATE process SET host = ?, command = ?", [escapes, escapes])
        database.execute("UPDATE event SET text = ?, kind = ?", [escapes, escapes])
    done = typed(*words, "--results", str(archive))
    assert not set("\x1b\x07\x9b") & set(done.out + done.err)
    assert "Traceback" not in done.err
    if words[0] == "view":
        assert done.err.count("\n") == 1


@pytest.mark.parametrize(
    "words",
    [
        *(
            ["report"],
            ["episodes", "show", "1"],
            ["episodes", "list"],
            ["export", "csv", "-o", "s.csv"],
            ["view", "1", "--path"],
        ),
        *(["judge", "1", "--void", "why"], ["run", "--model", "forward", "--goal", "chair", "--starts", "1"]),
        ["db", "status"],
    ],
)
def test_a_record_with_an_endless_view_ends_every_command_in_a_line(
    archive: Path, words: list[str], typed: Typed
) -> None:
    endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS id FROM n"
    with closing(sqlite3.connect(archive / "vsnbench.db")) as database:
        database.executescript(f"DROP TABLE event; CREATE VIEW event AS {endless}")
    done = typed(*words, "--results", str(archive))
    assert done.code in (1, 2)
    assert "has a view 'event'" in done.err
    assert done.err.count("\n") == 1


def test_a_link_that_waits_where_a_recording_is_written_is_not_followed(archive: Path, typed: Typed) -> None:
    precious = archive.parent / "precious"
    precious.write_text("kept")
    folder = archive / "episodes" / "000001"
    for name in ("episode.rrd", "episode.rrd.part", ".episode.rrd.part"):
        (folder / name).symlink_to(precious)
    done = typed("view", "1", "--path", "--results", str(archive))
    assert done.code == 0, done.err
    assert precious.read_text() == "kept"
    assert not (folder / "episode.rrd").is_symlink()


def test_a_picture_that_is_a_link_is_not_shown(archive: Path, typed: Typed) -> None:
    secret = archive.parent / "secret"
    secret.write_bytes(b"the key")
    picture = archive / "episodes" / "000001" / "rgb" / "0001.jpg"
    picture.unlink()
    picture.symlink_to(secret)
    done = typed("view", "1", "--path", "--results", str(archive))
    assert done.code == 1
    assert "leads out of it" in done.err


@pytest.mark.parametrize(
    "words", [["report"], ["episodes", "list"], ["view", "1", "--path"], ["export", "csv", "-o", "s.csv"]]
)
def test_nothing_is_imported_from_the_archive_in_which_one_stands(archive: Path, words: list[str]) -> None:
    for name in ("cloudpickle", "numpy", "yaml", "sitecustomize", "psycopg2", "fsspec", "pyarrow", "IPython"):
        (archive / f"{name}.py").write_text(f"open({str(archive.parent / 'ran')!r}, 'w').write({name!r})\n")
    done = vsnbench(*words, "--results", ".", cwd=archive)
    assert done.returncode == 0, done.stderr
    assert not (archive.parent / "ran").exists()
