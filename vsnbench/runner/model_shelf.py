"""The models of a study, loaded once each and kept while memory allows; the least recently used goes first."""

from collections import OrderedDict
from collections.abc import Callable
from types import TracebackType
from typing import Self

import psutil

from vsnbench.models.contract import Policy
from vsnbench.runner.bench import close_policy

SHARE_OF_MEMORY = 0.5
"""Of the machine's memory, for the models together, when nothing else is said."""


def default_limit_bytes() -> int:
    """Return how much memory the models of a study may have together."""
    return int(SHARE_OF_MEMORY * psutil.virtual_memory().total)


class ModelShelf:
    """Policies by the name of their arm; a context manager that closes what it holds."""

    def __init__(
        self,
        load: Callable[[str], Policy],
        limit_bytes: int | None = None,
        measure: Callable[[], int] = lambda: int(psutil.Process().memory_info().rss),
    ) -> None:
        """Begin empty.

        Args:
            load: makes the policy of an arm.
            limit_bytes: how much the kept ones may take together; half of the machine's memory when None.
            measure: how much memory this process takes now.
        """
        self._load = load
        self._limit = default_limit_bytes() if limit_bytes is None else limit_bytes
        self._measure = measure
        self._kept: OrderedDict[str, Policy] = OrderedDict()
        self._sizes: dict[str, int] = {}
        """Of every model that was ever loaded here: what the process grew by."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for arm in list(self._kept):
            self.drop(arm)

    @property
    def kept(self) -> tuple[str, ...]:
        """The arms whose models are loaded, the least recently used first."""
        return tuple(self._kept)

    def take(self, arm: str) -> Policy:
        """Return the policy of an arm, loaded if need be; others may have to go for it.

        Raises:
            VsnbenchError: it cannot be loaded.
        """
        if arm in self._kept:
            self._kept.move_to_end(arm)
            return self._kept[arm]
        self._make_room(self._sizes.get(arm, 0))
        before = self._measure()
        policy = self._load(arm)
        self._sizes[arm] = max(self._sizes.get(arm, 0), self._measure() - before, 0)
        self._kept[arm] = policy
        self._make_room(0)
        return policy

    def drop(self, arm: str) -> None:
        """Let a model go: it is made anew when it is wanted again."""
        policy = self._kept.pop(arm, None)
        if policy is not None:
            close_policy(policy)

    def _make_room(self, wanted: int) -> None:
        """Let models go until the kept ones and a new one are within the limit; the newest stays."""
        while len(self._kept) > (0 if wanted else 1) and self._taken() + wanted > self._limit:
            self.drop(next(iter(self._kept)))

    def _taken(self) -> int:
        return sum(self._sizes[arm] for arm in self._kept)
