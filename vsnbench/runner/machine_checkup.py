"""The check-up of this machine before a session: room on the disk, a record that can be written."""

from collections.abc import Iterator

from vsnbench.database.journal import Journal
from vsnbench.errors import VsnbenchError
from vsnbench.record.results import ResultsDirectory
from vsnbench.robots.check_result import CheckResult, Health

_EPISODE_BYTES = 40 * 2**20
_FULL_CAMPAIGN = 90


def check_machine(results: ResultsDirectory) -> Iterator[CheckResult]:
    """Look at the results directory and the database."""
    try:
        results.prepare()
    except VsnbenchError as error:
        yield CheckResult(
            "results", Health.FAILED, error.statement, error.advice or "choose another directory with --results"
        )
        return
    episodes = results.free_bytes() // _EPISODE_BYTES
    seen = f"{results.path}: {results.free_bytes() / 2**30:.1f} GiB free, room for some {episodes} episodes"
    if episodes < _FULL_CAMPAIGN:
        yield CheckResult("disk", Health.WARNING, seen, f"a campaign of {_FULL_CAMPAIGN} episodes may not fit")
    else:
        yield CheckResult("disk", Health.OK, seen)
    try:
        with Journal.open(results.database_url):
            pass
    except VsnbenchError as error:
        yield CheckResult("database", Health.FAILED, error.statement, error.advice or "see docs/results.md")
    else:
        yield CheckResult("database", Health.OK, f"{results.shown_database} can be written")
