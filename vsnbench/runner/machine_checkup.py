"""The check-up of this machine before a session: room on the disk, a record that can be written."""

from collections.abc import Iterator

from vsnbench.database.journal import Journal
from vsnbench.errors import VsnbenchError
from vsnbench.record.results import ResultsDirectory
from vsnbench.robots.finding import Finding, Health

_EPISODE_BYTES = 40 * 2**20
_FULL_CAMPAIGN = 90


def check_machine(results: ResultsDirectory) -> Iterator[Finding]:
    """Look at the results directory and the database."""
    try:
        results.prepare()
    except VsnbenchError as error:
        yield Finding("results", Health.FAILED, str(error), "choose another directory with --results")
        return
    episodes = results.free_bytes() // _EPISODE_BYTES
    seen = f"{results.path}: {results.free_bytes() / 2**30:.1f} GiB free, room for some {episodes} episodes"
    if episodes < _FULL_CAMPAIGN:
        yield Finding("disk", Health.WARNING, seen, f"a campaign of {_FULL_CAMPAIGN} episodes may not fit")
    else:
        yield Finding("disk", Health.OK, seen)
    try:
        with Journal.open(results.database_url):
            pass
    except VsnbenchError as error:
        yield Finding("database", Health.FAILED, str(error), "see docs/results.md")
    else:
        yield Finding("database", Health.OK, f"{results.shown_database} can be written")
