"""Keeps the loaded models of a study in memory; drops the least recently used where memory is short."""

from collections import OrderedDict
from collections.abc import Callable
from types import TracebackType
from typing import Self

import psutil

from vsnbench.models.contract import Policy
from vsnbench.runner.setup.trial_setup import close_policy

SHARE_OF_MEMORY = 0.5
"""Default share of the machine's memory for all models together."""


def default_limit_bytes() -> int:
    """Return the default memory for the models of a study together."""
    return int(SHARE_OF_MEMORY * psutil.virtual_memory().total)


class ModelCache:
    """Policies by the name of their arm; a context manager that closes them."""

    def __init__(
        self,
        load: Callable[[str], Policy],
        limit_bytes: int | None = None,
        measure: Callable[[], int] = lambda: int(psutil.Process().memory_info().rss),
    ) -> None:
        """Start empty.

        Args:
            load: loads the policy of an arm.
            limit_bytes: memory for the loaded models together; None for half of the machine's.
            measure: returns the memory of this process.
        """
        self._load = load
        self._limit = default_limit_bytes() if limit_bytes is None else limit_bytes
        self._measure = measure
        self._policies: OrderedDict[str, Policy] = OrderedDict()
        self._sizes: dict[str, int] = {}
        """Growth of the process by each model that was loaded, in bytes."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for arm in list(self._policies):
            self.drop(arm)

    @property
    def loaded(self) -> tuple[str, ...]:
        """Arms whose models are loaded, the least recently used first."""
        return tuple(self._policies)

    def take(self, arm: str) -> Policy:
        """Return the policy of an arm, loaded if necessary; may close others.

        Raises:
            VsnbenchError: the policy cannot be loaded.
        """
        if arm in self._policies:
            self._policies.move_to_end(arm)
            return self._policies[arm]
        self._make_room(self._sizes.get(arm, 0))
        before = self._measure()
        policy = self._load(arm)
        self._sizes[arm] = max(self._sizes.get(arm, 0), self._measure() - before, 0)
        self._policies[arm] = policy
        self._make_room(0)
        return policy

    def drop(self, arm: str) -> None:
        """Close a model. It is loaded again when it is needed."""
        policy = self._policies.pop(arm, None)
        if policy is not None:
            close_policy(policy)

    def _make_room(self, wanted: int) -> None:
        """Close models until the others and a new one fit into the limit; the newest stays."""
        while len(self._policies) > (0 if wanted else 1) and self._taken() + wanted > self._limit:
            self.drop(next(iter(self._policies)))

    def _taken(self) -> int:
        return sum(self._sizes[arm] for arm in self._policies)
