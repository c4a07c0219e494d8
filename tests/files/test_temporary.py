"""Temporary directories are removed by their owner, or after a kill by the next process."""

import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from vsnbench.files.temporary import ScratchDirectory

KILLED = """
import os, signal
from vsnbench.files.temporary import ScratchDirectory
scratch = ScratchDirectory("test")
(scratch.path / "socket").touch()
print(scratch.path, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_directories_of_killed_owners_are_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    with ScratchDirectory("test") as held:
        killed = subprocess.run([sys.executable, "-c", KILLED], stdout=subprocess.PIPE, text=True, check=False)
        left = Path(killed.stdout.strip())
        others = tmp_path / "vsnbench-other-1"
        others.mkdir()
        assert set(tmp_path.iterdir()) == {left, held.path, others}
        with ScratchDirectory("test") as scratch:
            assert set(tmp_path.iterdir()) == {held.path, others, scratch.path}
    assert list(tmp_path.iterdir()) == [others]
