"""Policies are found by name, by entry point and by path; what cannot be used is refused in one line."""

import sys
import types
from importlib.metadata import EntryPoint

import pytest

from vsnbench import plugins
from vsnbench.errors import ModelError, UsageError
from vsnbench.models import registry
from vsnbench.models.contract import ModelCard, Policy, SurveyedPolicy
from vsnbench.protocol.actions import Action
from vsnbench.protocol.decision import Decision


class Statue:
    """A whole policy, as a third party would write it."""

    def __init__(self, patience: int = 1) -> None:
        if patience < 0:
            raise RuntimeError("a statue is patient")
        self.card = ModelCard(name="statue", settings={"patience": patience})

    def reset(self, goal: str, seed: int) -> None:
        pass

    def act(self, observation: object) -> Decision:
        return Decision(Action.STOP)


class Mute:
    """No policy: it cannot act."""

    card = ModelCard(name="mute")


@pytest.fixture
def plug_in_module(monkeypatch: pytest.MonkeyPatch) -> str:
    module = types.ModuleType("statues")
    module.Statue, module.Mute, module.NUMBER = Statue, Mute, 3
    monkeypatch.setitem(sys.modules, "statues", module)
    return "statues"


@pytest.mark.parametrize("name", ["random", "forward", "oracle"])
def test_the_built_in_baselines_are_policies(name: str) -> None:
    assert name in registry.known_models()
    policy = registry.create_policy(name)
    assert isinstance(policy, Policy)
    assert policy.card.name == name
    assert policy.card.goals is None


def test_only_the_oracle_is_handed_the_site() -> None:
    surveyed = [
        name for name in ("random", "forward", "oracle") if isinstance(registry.create_policy(name), SurveyedPolicy)
    ]
    assert surveyed == ["oracle"]


def test_an_unknown_model_names_the_known_ones() -> None:
    with pytest.raises(UsageError, match=r"no model 'psychic'.*random.*oracle.*package\.module:Class"):
        registry.create_policy("psychic")
    with pytest.raises(UsageError, match=r"no model 'orakel': did you mean oracle\? The known ones are random, "):
        registry.create_policy("orakel")


def test_a_policy_can_be_named_by_its_path(plug_in_module: str) -> None:
    policy = registry.create_policy(f"{plug_in_module}:Statue", patience=5)
    assert policy.card.settings["patience"] == 5


def test_a_plug_in_is_known_by_its_entry_point(plug_in_module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint("statue", f"{plug_in_module}:Statue", registry.ENTRY_POINT_GROUP)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [point])
    assert "statue" in registry.known_models()
    assert registry.create_policy("statue").card.name == "statue"


def test_a_plug_in_cannot_take_a_built_in_name(plug_in_module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint("random", f"{plug_in_module}:Statue", registry.ENTRY_POINT_GROUP)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [point])
    assert registry.create_policy("random").card.name == "random"
    assert registry.known_models().count("random") == 1


def test_an_option_the_model_lacks_is_a_usage_error_that_names_the_options(plug_in_module: str) -> None:
    with pytest.raises(UsageError, match=r"temperature.*it takes no options, and in Python patience"):
        registry.create_policy(f"{plug_in_module}:Statue", temperature=1.0)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("no_such_package.module:Class", "cannot import no_such_package.module:Class"),
        ("statues:Missing", "cannot import statues:Missing"),
        ("statues:NUMBER", "neither a class nor a function"),
        ("statues:Mute", "is no policy"),
    ],
)
def test_a_broken_plug_in_is_a_model_error(plug_in_module: str, name: str, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        registry.create_policy(name)


def test_a_model_that_is_nowhere_is_told_where_it_was_looked_for(plug_in_module: str) -> None:
    with pytest.raises(
        ModelError, match=r"is neither installed nor in .*: go to the directory that has walker/policy.py in it"
    ):
        registry.create_policy("walker.policy:Walker")
    for file in ("walker/policy.py:Walker", "../walker/policy.py:Walker", "policy.py:Walker"):
        with pytest.raises(ModelError, match=r"name the module, not its file: walker/policy.py is walker.policy"):
            registry.create_policy(file)
    with pytest.raises(ModelError, match=r"has no attribute 'Missing'$"):
        registry.create_policy(f"{plug_in_module}:Missing")


def test_a_plug_in_that_raises_when_made_is_a_model_error(plug_in_module: str) -> None:
    with pytest.raises(ModelError, match="RuntimeError: a statue is patient"):
        registry.create_policy("statues:Statue", patience=-1)


class OddlyCarded:
    card = ModelCard("odd", sensors={"rgb"})  # type: ignore[arg-type]

    def reset(self, goal: str, seed: int) -> None: ...

    def act(self, observation: object) -> None: ...


def test_a_card_of_the_wrong_types_is_refused_in_a_line() -> None:
    with pytest.raises(ModelError, match="sensors must be a frozenset of Sensor"):
        registry.create_policy(f"{__name__}:OddlyCarded")
