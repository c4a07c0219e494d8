"""The process that a report works beside: it ends with Ctrl-C, whatever it is about."""

import os
import signal
import sqlite3
import time
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress

import pytest

from vsnbench.report.drawings import _beside


def count_for_minutes() -> None:
    query = (
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 1000000000) SELECT count(*) FROM n"
    )
    sqlite3.connect(":memory:").execute(query).fetchone()


def test_ctrl_c_ends_the_process_beside_while_its_database_counts() -> None:
    with _beside(can_fork=True) as beside:
        worker = beside.submit(os.getpid).result(timeout=10)
        counting = beside.submit(count_for_minutes)
        while not counting.running():
            time.sleep(0.01)
        time.sleep(0.3)
        os.kill(worker, signal.SIGINT)
        try:
            with pytest.raises(BrokenProcessPool):
                counting.result(timeout=10)
        finally:
            with suppress(ProcessLookupError):
                os.kill(worker, signal.SIGKILL)
