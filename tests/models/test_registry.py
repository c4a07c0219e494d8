"""Policies are created by name, entry point and path; others are refused in one line."""

import sys
import types
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from vsnbench import plugins
from vsnbench.errors import ModelError, UsageError
from vsnbench.models import names, registry
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.values.decision import Decision
from vsnbench.values.goal import GoalKind
from vsnbench.values.movement import Action


class Statue(Policy):
    """A complete third-party policy."""

    def __init__(self, patience: int = 1) -> None:
        if patience < 0:
            raise RuntimeError("a statue is patient")
        self.card = ModelCard(name="statue", settings={"patience": patience})

    def reset(self, goal: str, seed: int) -> None:
        pass

    def act(self, observation: object) -> Decision:
        return Decision(Action.STOP)


class Mute:
    """Cannot act."""

    card = ModelCard(name="mute")


class Cardless(Statue):
    def __init__(self) -> None:
        pass


class Surveyor(Statue):
    """Implements `survey` without `needs_survey`."""

    def survey(self, *given: object) -> None: ...


class Forgetful(Statue):
    """Says that it keeps its memory in a sequence, without `next_goal`."""

    card = ModelCard("forgetful", goal_kinds=frozenset({GoalKind.CATEGORY, GoalKind.SEQUENCE}))

    def __init__(self) -> None: ...


class OddlyCarded(Statue):
    def __init__(self) -> None:
        self.card = ModelCard("odd", sensors={"rgb"})  # type: ignore[arg-type]


class Duck:
    """Has the members of a policy, but not its base class."""

    card = ModelCard("duck")

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode."""

    def act(self, observation: object) -> Decision:
        return Decision(Action.STOP)


@pytest.fixture
def plug_in_module(monkeypatch: pytest.MonkeyPatch) -> str:
    module = types.ModuleType("statues")
    for kind in (Statue, Mute, Cardless, Surveyor, Forgetful, OddlyCarded, Duck):
        setattr(module, kind.__name__, kind)
    module.NUMBER = 3
    monkeypatch.setitem(sys.modules, "statues", module)
    return "statues"


@pytest.mark.parametrize("name", ["random", "forward", "oracle"])
def test_the_built_in_baselines_are_policies(name: str) -> None:
    assert name in names.known_models()
    policy = registry.create_policy(name)
    assert isinstance(policy, Policy)
    assert policy.card.name == name
    assert policy.card.goals is None


def test_only_the_oracle_is_handed_the_site() -> None:
    surveyed = [name for name in ("random", "forward", "oracle") if registry.create_policy(name).needs_survey]
    assert surveyed == ["oracle"]


def test_an_unknown_model_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(UsageError) as raised:
        registry.create_policy("orakel")
    assert raised.value.code == "unknown-model"
    assert raised.value.advice.startswith("did you mean oracle?")


def test_a_policy_can_be_named_by_its_path(plug_in_module: str) -> None:
    policy = registry.create_policy(f"{plug_in_module}:Statue", patience=5)
    assert policy.card.settings["patience"] == 5


def test_a_plug_in_is_known_by_its_entry_point(plug_in_module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint("statue", f"{plug_in_module}:Statue", names.ENTRY_POINT_GROUP)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [point])
    assert "statue" in names.known_models()
    assert registry.create_policy("statue").card.name == "statue"


def test_a_plug_in_cannot_take_a_built_in_name(plug_in_module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint("random", f"{plug_in_module}:Statue", names.ENTRY_POINT_GROUP)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [point])
    assert registry.create_policy("random").card.name == "random"
    assert names.known_models().count("random") == 1


def test_a_class_that_a_module_does_not_have_is_answered_with_the_closest(plug_in_module: str) -> None:
    with pytest.raises(ModelError) as raised:
        registry.create_policy(f"{plug_in_module}:Statu")
    assert raised.value.statement == f"model {plug_in_module}:Statu: {plug_in_module} has no Statu"
    assert raised.value.advice == f"did you mean {plug_in_module}:Statue?"


def test_an_option_the_model_lacks_is_a_usage_error_that_names_the_options(plug_in_module: str) -> None:
    with pytest.raises(UsageError) as raised:
        registry.create_policy(f"{plug_in_module}:Statue", temperature=1.0)
    assert raised.value.code == "unknown-model-option"
    assert "patience" in raised.value.advice


@pytest.mark.parametrize(
    ("name", "options", "code"),
    [
        ("no_such_package.module:Class", {}, "import-failed"),
        ("statues:Missing", {}, "import-failed"),
        ("statues:NUMBER", {}, "not-callable"),
        ("statues:Mute", {}, "not-a-policy"),
        ("statues:Cardless", {}, "not-a-policy"),
        ("statues:Duck", {}, "not-a-policy"),
        ("statues:Surveyor", {}, "survey-not-declared"),
        ("statues:Forgetful", {}, "next-goal-missing"),
        ("statues:OddlyCarded", {}, "invalid-card"),
        ("statues:Statue", {"patience": -1}, "model-not-created"),
    ],
)
def test_a_broken_plug_in_is_a_model_error(plug_in_module: str, name: str, options: dict[str, int], code: str) -> None:
    with pytest.raises(ModelError) as raised:
        registry.create_policy(name, **options)
    assert raised.value.code == code


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("walker.policy:Walker", "directory that has walker/policy.py"),
        ("walker/policy.py:Walker", "name the module, not its file"),
        ("policy.py:Walker", "name the module, not its file"),
        ("statues:Missing", ""),
    ],
)
def test_the_error_for_a_missing_module_has_advice(plug_in_module: str, name: str, advice: str) -> None:
    with pytest.raises(ModelError) as raised:
        registry.create_policy(name)
    assert advice in raised.value.advice
    assert bool(advice) == bool(raised.value.advice)


def test_a_file_in_place_of_a_model_is_answered_with_its_class(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "roam.py").write_text("raise SystemExit\nclass Roam(vsnbench.Policy):\n    pass\n")
    for name, refused in (("lab/roam.py", UsageError), ("lab.roam", UsageError), ("lab/roam.py:Roam", ModelError)):
        with pytest.raises(refused) as error:
            registry.create_policy(name)
        assert "lab.roam:Roam" in error.value.advice
    (tmp_path / "lab" / "roam.py").write_bytes(b"\0class (")
    with pytest.raises(UsageError) as error:
        registry.create_policy("lab/roam.py")
    assert error.value.code == "unknown-model"
