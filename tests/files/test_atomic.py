"""Files are written atomically, and partial files of killed processes are found."""

import os
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from vsnbench.errors import ModelError
from vsnbench.files.atomic import atomic_file, part_path, sweep_parts, write_atomic

FULL_DISK = """
import resource, sys
from pathlib import Path
from vsnbench.errors import RecordError
from vsnbench.files.atomic import write_atomic
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
try:
    write_atomic(Path(sys.argv[1]), bytes(5000))
except RecordError as error:
    print(error)
"""

KILLED = """
import os, signal, sys
from pathlib import Path
from vsnbench.files.atomic import atomic_file
with atomic_file(Path(sys.argv[1])) as part:
    part.write_bytes(b"half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_no_file_remains_if_the_disk_is_full(tmp_path: Path) -> None:
    target = tmp_path / "0001.jpg"
    root = Path(__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(target)], capture_output=True, text=True, env=environment
    )
    assert done.stdout.startswith(f"cannot write {target}: ")
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_replaced_whole(tmp_path: Path) -> None:
    write_atomic(tmp_path / "file", b"one")
    write_atomic(tmp_path / "file", b"two")
    assert (tmp_path / "file").read_bytes() == b"two"
    assert stat.S_ISREG((tmp_path / "file").stat().st_mode)
    assert len(list(tmp_path.iterdir())) == 1


def test_a_block_that_fails_leaves_what_was_there(tmp_path: Path) -> None:
    write_atomic(tmp_path / "file", b"old")

    def fail_half_way() -> None:
        with atomic_file(tmp_path / "file") as part:
            part.write_bytes(b"half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_half_way()
    assert (tmp_path / "file").read_bytes() == b"old"
    assert len(list(tmp_path.iterdir())) == 1


def test_an_error_has_the_class_of_the_caller(tmp_path: Path) -> None:
    (tmp_path / "folder").write_text("a file in the way")
    with pytest.raises(ModelError, match=r"cannot write .*folder/file: .*; free some space"):
        write_atomic(tmp_path / "folder" / "file", b"", ModelError)


def test_only_files_of_dead_processes_are_removed(tmp_path: Path) -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    left, mine = tmp_path / f".a.rrd.{gone.pid}.part", part_path(tmp_path / "b.rrd")
    for path in (left, mine, tmp_path / "c.rrd"):
        path.write_bytes(b"half")
    sweep_parts(tmp_path, "b.rrd")
    assert left.exists(), "another file's"
    sweep_parts(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([mine.name, "c.rrd"])


def test_what_a_killed_process_left_is_removed_by_the_next_that_writes_the_file(tmp_path: Path) -> None:
    killed = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "a[1].mp4")], check=False)
    assert killed.returncode == -signal.SIGKILL
    (left,) = tmp_path.iterdir()
    assert left.suffix == ".part"
    other = left.with_name(left.name.replace("a[1]", "a1"))
    other.write_bytes(b"another file's")
    with atomic_file(tmp_path / "a[1].mp4") as part:
        part.write_bytes(b"whole")
    assert set(tmp_path.iterdir()) == {tmp_path / "a[1].mp4", other}
