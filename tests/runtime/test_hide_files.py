"""A program that cannot read some files or use TCP, and reads all other files."""

import socket
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from tests.models.remote.servers import look
from vsnbench.errors import UsageError
from vsnbench.models.remote import isolation
from vsnbench.models.remote.isolation import IsolatedPolicy, Isolation
from vsnbench.runtime.hide_files import can_hide_files, can_refuse_tcp, command_without

needs_landlock = pytest.mark.skipif(not can_hide_files(), reason="this kernel has no Landlock of Linux 5.19")
READ = """
import sys
for path in sys.argv[1:]:
    try:
        print(open(path).read() or "empty")
    except OSError as error:
        print(type(error).__name__)
"""
TCP = """
import socket, sys
for call, port in ((socket.create_connection, int(sys.argv[1])), (socket.create_server, 0)):
    try:
        call(("127.0.0.1", port)).close()
        print("done")
    except OSError as error:
        print(type(error).__name__)
"""
PEEKING = """
import os, sqlite3

class Model:
    card = {"name": "peeking", "sensors": ["rgb"]}

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        try:
            with sqlite3.connect(f"file:{os.environ['RECORD']}?mode=ro", uri=True) as record:
                found = record.execute("SELECT x_m FROM step").fetchone()[0]
        except sqlite3.Error as error:
            found = type(error).__name__
        return {"action": "STOP", "raw_action": str(found)}
"""


@needs_landlock
def test_hidden_files_cannot_be_read_by_any_name_and_others_can(tmp_path: Path) -> None:
    results, beside = tmp_path / "results", tmp_path / "model"
    for folder in (results / "episodes", beside):
        folder.mkdir(parents=True)
        (folder / "text").write_text("text")
    (tmp_path / "vsnbench.db").write_text("poses")
    (beside / "link").symlink_to(results / "episodes" / "text")
    (beside / "up").symlink_to(tmp_path)
    (tmp_path / "named").symlink_to(results)
    hidden = [tmp_path / "named", tmp_path / "vsnbench.db", tmp_path / "later"]
    paths = [
        *(results / "episodes" / "text", beside / "link", beside / "up" / "results" / "episodes" / "text"),
        *(tmp_path / "vsnbench.db", beside / "text", "/etc/passwd"),
    ]
    command = [sys.executable, "-c", READ, *map(str, paths)]
    plain, hiding = (
        subprocess.run(words, stdout=subprocess.PIPE, text=True, timeout=60, check=True).stdout.splitlines()
        for words in (command, command_without(hidden, command))
    )
    assert plain[:5] == ["text", "text", "text", "poses", "text"]
    assert hiding == ["PermissionError"] * 4 + plain[4:]


@needs_landlock
def test_a_hidden_file_cannot_be_moved_to_where_it_can_be_read(tmp_path: Path) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "record").write_text("poses")
    (tmp_path / "model").mkdir()
    move = "import os, sys; os.rename(sys.argv[1], sys.argv[2])"
    words = [sys.executable, "-c", move, str(tmp_path / "results" / "record"), str(tmp_path / "model" / "record")]
    moved = subprocess.run(command_without([tmp_path / "results"], words), stderr=subprocess.PIPE, check=False)
    assert moved.returncode == 1
    assert (tmp_path / "results" / "record").exists()
    words[3:] = [str(tmp_path / "model" / "own"), str(tmp_path / "own")]
    (tmp_path / "model" / "own").write_text("weights")
    subprocess.run(command_without([tmp_path / "results"], words), check=True)
    assert (tmp_path / "own").read_text() == "weights", "other files go from one directory to another"


@pytest.mark.skipif(not can_refuse_tcp(), reason="this kernel's Landlock is older than Linux 6.7")
def test_a_program_without_files_cannot_use_tcp_either(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        words = [sys.executable, "-c", TCP, str(server.getsockname()[1])]
        plain, refused = (
            subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=60, check=True).stdout.split()
            for command in (words, command_without([tmp_path / "results"], words))
        )
    assert (plain, refused) == (["done", "done"], ["PermissionError", "PermissionError"])


@needs_landlock
def test_an_isolated_model_answers_and_cannot_read_the_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    results = tmp_path / "results"
    results.mkdir()
    with sqlite3.connect(results / "vsnbench.db") as record:
        record.executescript("CREATE TABLE step (x_m REAL); INSERT INTO step VALUES (1.5)")
    (tmp_path / "peeking.py").write_text(PEEKING)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RECORD", str(results / "vsnbench.db"))
    found = []
    for hidden in ((), (results,)):
        policy = IsolatedPolicy("peeking:Model", {}, Isolation(Path(sys.executable), hidden=hidden))
        try:
            policy.reset("chair", 1)
            found.append(policy.act(look()).raw_action)
        finally:
            policy.close()
    assert found == ["1.5", "OperationalError"]


def test_without_landlock_the_run_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(isolation, "can_hide_files", lambda: False)
    with pytest.raises(UsageError) as refused:
        IsolatedPolicy("peeking:Model", {}, Isolation(Path(sys.executable), hidden=(tmp_path,)))
    assert refused.value.code == "no-landlock"
