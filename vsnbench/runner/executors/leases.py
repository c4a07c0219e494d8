"""Renews the leases of claims, so that no other process takes their trials."""

import logging
import threading
from collections.abc import Collection, Iterator
from contextlib import contextmanager

from vsnbench.errors import RecordError
from vsnbench.results.writing.episodes import Claim
from vsnbench.results.writing.journal import Journal
from vsnbench.results.writing.lifecycle import LEASE

logger = logging.getLogger(__name__)


@contextmanager
def leases_renewed(journal: Journal, claims: Collection[Claim]) -> Iterator[None]:
    """Renew the leases of claims from a thread while the context is entered; claims may come and go meanwhile."""
    over = threading.Event()

    def renew() -> None:
        while not over.wait(LEASE.total_seconds() / 3):
            for claim in list(claims):
                try:
                    journal.renew(claim.id)
                except RecordError as error:
                    logger.warning("episode %d: %s", claim.id, error)

    threading.Thread(target=renew, name="leases", daemon=True).start()
    try:
        yield
    finally:
        over.set()
