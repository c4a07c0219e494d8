"""The built-in model `frontier` drives to unseen areas and to the goal."""

from pathlib import Path

import pytest

from tests.models.vlv.looks import look
from vsnbench.errors import ModelError, UsageError
from vsnbench.models.baselines.frontier import Frontier
from vsnbench.models.registry import create_policy
from vsnbench.models.vlv.policy import VLV
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.values.action import Action

PERFECT = VLVSettings(simulated_recall=1.0, simulated_precision=1.0)


@pytest.fixture(autouse=True)
def no_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VSNBENCH_WEIGHTS", str(tmp_path))


def frontier(goal: str = "sofa") -> Frontier:
    policy = Frontier(model_config=PERFECT)
    policy.reset(goal, seed=1)
    return policy


def test_it_is_a_model_of_its_own_with_vlv_s_detector() -> None:
    policy, vlv = create_policy("frontier"), VLV()
    assert policy.card.name == "frontier"
    assert policy.card.weights_label in vlv.card.weights_label
    assert "value" not in policy.card.weights_label
    assert (policy.card.goals, policy.card.sensors) == (vlv.card.goals, vlv.card.sensors)


def test_a_value_network_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "vlv_model.torch").write_bytes(b"not read")
    assert frontier().card.weights_sha256 == ""


def test_it_looks_around_once_and_then_drives_to_the_edge_of_the_known_area() -> None:
    policy = frontier()
    assert [policy.act(look()).action for _ in range(12)] == [Action.TURN_LEFT] * 12
    decision = policy.act(look())
    assert decision.diagnostics is not None
    assert decision.diagnostics.note == "travel: to the nearest frontier"
    assert decision.diagnostics.sub_goal is not None


def test_it_stops_at_a_goal_that_it_sees_nearby() -> None:
    policy = frontier()
    near = look(("sofa", (50, 110, 30, 130), 0.7))
    assert [policy.act(near).action is Action.STOP for _ in range(2)] == [False, True]


def test_an_unknown_goal_and_an_early_act_are_refused_by_name() -> None:
    with pytest.raises(UsageError, match="frontier does not know the goal 'plant'"):
        frontier("plant")
    with pytest.raises(ModelError, match="frontier: act was called before reset"):
        Frontier().act(look())
