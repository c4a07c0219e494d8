"""Keeps the loaded models of a study in memory; drops the least recently used where memory is short."""

from collections import OrderedDict
from collections.abc import Callable
from typing import Self

import psutil

from vsnbench.runner.executors.in_process import DrivingModel
from vsnbench.runner.setup.trial_setup import close_policy

SHARE_OF_MEMORY = 0.5
"""Default share of the machine's memory for all models together."""


class ModelCache:
    """Models by the name of their arm; a context manager that closes them."""

    def __init__(
        self,
        load: Callable[[str], DrivingModel],
        limit_bytes: int | None = None,
        measure: Callable[[], int] = lambda: int(psutil.Process().memory_info().rss),
    ) -> None:
        """Start empty.

        Args:
            load: loads the model of an arm.
            limit_bytes: memory for the loaded models together; None for half of the machine's.
            measure: returns the memory of this process.
        """
        self._load = load
        self._limit = int(SHARE_OF_MEMORY * psutil.virtual_memory().total) if limit_bytes is None else limit_bytes
        self._measure = measure
        self._models: OrderedDict[str, DrivingModel] = OrderedDict()
        self._sizes: dict[str, int] = {}
        """Growth of the process by each model that was loaded, in bytes."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        for arm in list(self._models):
            self.drop(arm)

    @property
    def loaded(self) -> tuple[str, ...]:
        """Arms whose models are loaded, the least recently used first."""
        return tuple(self._models)

    def take(self, model: str) -> DrivingModel:
        """Return the model of an arm, loaded if necessary; may close others."""
        if model in self._models:
            self._models.move_to_end(model)
            return self._models[model]
        self._make_room(self._sizes.get(model, 0))
        before = self._measure()
        loaded = self._load(model)
        self._sizes[model] = max(self._sizes.get(model, 0), self._measure() - before, 0)
        self._models[model] = loaded
        self._make_room(0)
        return loaded

    def drop(self, model: str) -> None:
        """Close a model. It is loaded again when it is needed."""
        if dropped := self._models.pop(model, None):
            close_policy(dropped.policy)

    def _make_room(self, wanted: int) -> None:
        """Close models until the others and a new one fit into the limit; the newest stays."""
        while len(self._models) > (0 if wanted else 1) and self._taken() + wanted > self._limit:
            self.drop(next(iter(self._models)))

    def _taken(self) -> int:
        return sum(self._sizes[arm] for arm in self._models)
