"""A worker ends on Ctrl-C while C code is running, and when its parent is killed."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from vsnbench.runtime.child_process import end_with_parent

COUNT_FOR_MINUTES = """
import sqlite3
query = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 1e9) SELECT count(*) FROM n"
sqlite3.connect(":memory:").execute(query).fetchone()
"""


def pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, multiprocessing.get_context("fork"), end_with_parent)


def kill(worker: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(worker, signal.SIGKILL)


def test_ctrl_c_ends_a_worker_while_its_database_counts() -> None:
    with pool() as executor:
        worker = executor.submit(os.getpid).result(timeout=10)
        counting = executor.submit(exec, COUNT_FOR_MINUTES)
        while not counting.running():
            time.sleep(0.01)
        time.sleep(0.3)
        os.kill(worker, signal.SIGINT)
        try:
            with pytest.raises(BrokenProcessPool):
                counting.result(timeout=10)
        finally:
            kill(worker)


def runs(worker: int) -> bool:
    """Return whether a process still runs. An ended orphan may not be reaped yet."""
    try:
        return psutil.Process(worker).status() not in (psutil.STATUS_ZOMBIE, psutil.STATUS_DEAD)
    except psutil.NoSuchProcess:
        return False


PARENT = f"""
import multiprocessing, os, time
from concurrent.futures import ProcessPoolExecutor
from vsnbench.runtime.child_process import end_with_parent
executor = ProcessPoolExecutor(1, multiprocessing.get_context("fork"), end_with_parent)
print(executor.submit(os.getpid).result(), flush=True)
executor.submit(exec, {COUNT_FOR_MINUTES!r})
time.sleep(60)
"""


def test_a_worker_ends_when_its_parent_is_killed() -> None:
    root = Path(__file__).resolve().parents[2]
    parent = subprocess.Popen([sys.executable, "-c", PARENT], cwd=root, stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    worker = int(parent.stdout.readline())
    try:
        time.sleep(0.3)
        parent.kill()
        parent.wait()
        deadline = time.monotonic() + 10
        while runs(worker) and time.monotonic() < deadline:
            time.sleep(0.05)
        assert not runs(worker)
    finally:
        parent.stdout.close()
        kill(worker)
