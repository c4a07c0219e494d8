from collections.abc import Iterator

import pytest

from vsnbench.errors import ModelError
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.runner.executors.in_process import DrivingModel
from vsnbench.runner.setup.model_cache import ModelCache
from vsnbench.values.decision import Decision
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation

SIZES = {"wren": 30, "heron": 40, "magpie": 50}


class Bird(Policy):
    """Uses memory from its creation until it is closed."""

    def __init__(self, name: str, cage: "Cage") -> None:
        self.card = ModelCard(name)
        self._cage = cage
        cage.taken += SIZES[name]
        cage.hatched.append(name)

    def reset(self, goal: str, seed: int) -> None: ...

    def act(self, observation: Observation) -> Decision:
        return Decision(Action.STOP)

    def close(self) -> None:
        self._cage.taken -= SIZES[self.card.name]


class Cage:
    """Available memory, and the models that were loaded."""

    def __init__(self) -> None:
        self.taken = 1000
        self.most = 0
        self.hatched: list[str] = []

    def load(self, name: str) -> DrivingModel:
        if name not in SIZES:
            raise ModelError(f"there is no {name}")
        bird = Bird(name, self)
        self.most = max(self.most, self.taken - 1000)
        return DrivingModel(bird, name)

    def shelf(self, limit: int) -> ModelCache:
        return ModelCache(self.load, limit, lambda: self.taken)


@pytest.fixture
def cage() -> Iterator[Cage]:
    cage = Cage()
    yield cage
    assert cage.taken == 1000, "all loaded models are closed at the end"


def test_models_are_loaded_once_while_memory_allows(cage: Cage) -> None:
    with cage.shelf(120) as shelf:
        policies = [shelf.take(name) for name in ("wren", "heron", "magpie", "wren", "heron", "magpie")]
    assert cage.hatched == ["wren", "heron", "magpie"]
    assert policies[:3] == policies[3:]


def test_the_least_recently_used_models_are_closed_first(cage: Cage) -> None:
    with cage.shelf(90) as shelf:
        for name in ("wren", "heron", "wren"):
            shelf.take(name)
        assert shelf.loaded == ("heron", "wren")
        shelf.take("magpie")
        assert shelf.loaded == ("wren", "magpie")
        assert cage.taken == 1000 + 80


def test_memory_for_a_known_model_is_freed_before_loading(cage: Cage) -> None:
    with cage.shelf(90) as shelf:
        for name in ("wren", "heron", "magpie"):
            shelf.take(name)
        cage.most = 0
        shelf.take("wren")
        shelf.take("heron")
        assert shelf.loaded == ("wren", "heron")
    assert cage.most <= 90


def test_a_model_larger_than_the_limit_is_kept_alone(cage: Cage) -> None:
    with cage.shelf(10) as shelf:
        for name in ("wren", "heron", "heron"):
            shelf.take(name)
        assert shelf.loaded == ("heron",)
    assert cage.hatched == ["wren", "heron"]


def test_a_dropped_or_failed_model_is_loaded_again(cage: Cage) -> None:
    with cage.shelf(90) as shelf:
        first = shelf.take("wren")
        shelf.drop("wren")
        shelf.drop("wren")
        with pytest.raises(ModelError, match="there is no owl"):
            shelf.take("owl")
        assert shelf.loaded == ()
        assert shelf.take("wren") is not first
