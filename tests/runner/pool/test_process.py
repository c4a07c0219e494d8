"""Processes that are started before it is known what is to be run: taken by whoever wants workers, or ended."""

import psutil
import pytest

from tests.processes import has_ended, wait_until
from vsnbench.runner.pool.process import MOST_RECRUITS, granted_cores, likely_workers, new_worker, recruits


def test_recruits_are_taken_first_and_what_nobody_took_is_ended_with_the_block() -> None:
    before = set(psutil.Process().children())
    with recruits(2):
        started = set(psutil.Process().children()) - before
        assert len(started) == 2
        taken = new_worker()
        (left,) = (process for process in started if process.pid != taken.pid)
    try:
        wait_until(lambda: has_ended(left), f"{left} ends with the block")
        assert not has_ended(psutil.Process(taken.pid)), "it is somebody's"
    finally:
        taken.bury()
        taken.socket.close()


@pytest.mark.parametrize(
    ("asked", "all_starts", "wanted"),
    [("auto", True, granted_cores()), ("auto", False, 1), ("1", True, 1), ("4000", False, 4000), ("many", True, 1)],
)
def test_only_a_run_that_will_plainly_want_workers_recruits_some(asked: str, all_starts: bool, wanted: int) -> None:
    expected = 0 if wanted == 1 else min(wanted, granted_cores(), MOST_RECRUITS)
    assert likely_workers(asked, all_starts=all_starts) == expected
