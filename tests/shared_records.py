"""Records that tests of several files read, made once for all workers of a run, or once in a worker and copied."""

import atexit
import fcntl
import shutil
import tempfile
from collections.abc import Callable, Hashable
from functools import cache
from pathlib import Path

import pytest

SMALL = ("--goal", "chair", "--starts", "1-2", "--robot", "simulated:turtlebot2@64x48", "--workers", "1", "--quiet")
"""Trials of a tenth of a second each."""


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], None]) -> Path:
    """Return a path that one worker has made and all read; the others wait for it."""
    base = factory.getbasetemp()
    folder = (base.parent if base.name.startswith("popen-") else base) / "shared"
    folder.mkdir(exist_ok=True)
    path, done = folder / name, folder / f"{name}.done"
    with (folder / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            make(path)
            done.touch()
    return path


def small_record(factory: pytest.TempPathFactory) -> Path:
    """Return a results directory with two episodes of the oracle and two of the random model; not to be changed."""
    from tests.cli.test_record_verbs import vsnbench

    def run(results: Path) -> None:
        done = vsnbench(results, "run", "--model", "oracle,random", *SMALL)
        assert done.returncode == 0, done.stderr

    return made_once(factory, "results", run)


def write_copy(directory: Path, make: Callable[..., object], *settings: Hashable) -> None:
    """Write into a directory what `make` writes there with some settings; in a process it is made once and copied."""
    shutil.copytree(_made(make, *settings), directory, dirs_exist_ok=True)


@cache
def _made(make: Callable[..., object], *settings: Hashable) -> Path:
    directory = Path(tempfile.mkdtemp(prefix="vsnbench-record-"))
    atexit.register(shutil.rmtree, directory, ignore_errors=True)
    make(directory, *settings)
    return directory
