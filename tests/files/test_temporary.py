"""Temporary directories are removed by their owner, or after a kill by the next process; nothing else is removed."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from vsnbench.files.temporary import ScratchDirectory, private_temporary_directory

KILLED = """
import os, signal
from vsnbench.files.temporary import ScratchDirectory
scratch = ScratchDirectory("test")
(scratch.path / "socket").touch()
print(scratch.path, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture
def parent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the user's directory for temporary directories, in an empty $TMPDIR."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return tmp_path / f"vsnbench-{os.getuid()}"


def killed_owner() -> Path:
    killed = subprocess.run([sys.executable, "-c", KILLED], stdout=subprocess.PIPE, text=True, check=False)
    return Path(killed.stdout.strip())


def directories(parent: Path) -> set[Path]:
    return {path for path in parent.iterdir() if path.is_dir()}


def test_directories_of_killed_owners_are_removed(parent: Path) -> None:
    with ScratchDirectory("test") as held:
        left = killed_owner()
        other = ScratchDirectory("other")
        assert directories(parent) == {left, held.path, other.path}
        with ScratchDirectory("test") as scratch:
            assert directories(parent) == {held.path, other.path, scratch.path}
    other.remove()
    assert list(parent.iterdir()) == []
    assert parent.stat().st_mode & 0o777 == 0o700


def test_directories_that_a_user_made_or_copied_are_not_removed(parent: Path, tmp_path: Path) -> None:
    left = killed_owner()
    copied = shutil.copytree(left, parent / "test-copied")
    replaced = killed_owner()
    kept_aside = replaced.rename(tmp_path / "vsnbench-test-moved")
    shutil.copytree(kept_aside, replaced)
    made = [tmp_path / "vsnbench-test-made", parent / "test-made"]
    for directory in made:
        directory.mkdir()
    linked = parent / "test-linked"
    linked.symlink_to(made[0])
    (parent / "test-linked.lock").touch()
    (parent / "test-made.lock").symlink_to(left.with_name(f"{left.name}.lock"))
    (made[1] / "notes").touch()
    ScratchDirectory("test").remove()
    assert not left.exists()
    assert all(path.is_dir() for path in (copied, replaced, kept_aside, linked, *made))


def test_a_directory_of_another_user_or_open_to_others_is_not_used(parent: Path, tmp_path: Path) -> None:
    parent.mkdir(mode=0o700)
    parent.chmod(0o777)
    assert private_temporary_directory() is None
    with ScratchDirectory("test") as scratch:
        assert scratch.path.parent == tmp_path
        assert scratch.path.stat().st_mode & 0o777 == 0o700
    assert list(tmp_path.iterdir()) == [parent]
    if os.getuid() == 0:
        parent.chmod(0o700)
        os.chown(parent, 12345, 12345)
        assert private_temporary_directory() is None
    parent.rmdir()
    parent.symlink_to(tmp_path)
    assert private_temporary_directory() is None
