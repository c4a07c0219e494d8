"""A card's replacement of LOOK_UP and LOOK_DOWN is validated, and is part of the model's identity."""

from dataclasses import replace
from typing import Any

import pytest
from pydantic import ValidationError

from tests.runner.episode.test_step import Scripted
from tests.runner.stand_ins import PLAN, StandInRobot
from vsnbench.errors import ModelError
from vsnbench.models.loaded import LoadedPolicy
from vsnbench.models.remote.card import card_of
from vsnbench.models.remote.vsnbench_policy import checked_card
from vsnbench.runner.setup.trial_setup import TrialSetupSpec, prepare_setup
from vsnbench.values.movement import Action, ActionKind

DISCRETE = frozenset({ActionKind.DISCRETE})
MAP = {Action.LOOK_UP: Action.NOOP, Action.LOOK_DOWN: Action.MOVE_FORWARD}


def settings_of(action_map: dict[Action, Action]) -> Any:
    policy = Scripted(kinds=DISCRETE)
    policy.card = replace(policy.card, action_map=action_map)
    setup = prepare_setup(TrialSetupSpec(PLAN.site, "scripted", ("chair",)), LoadedPolicy(policy), StandInRobot())
    return setup.description.card.settings


def test_the_map_is_part_of_the_identity_and_a_card_without_one_keeps_its_own() -> None:
    assert settings_of({}) == {}
    assert settings_of(MAP) == {"action_map": {"LOOK_UP": "NOOP", "LOOK_DOWN": "MOVE_FORWARD"}}


@pytest.mark.parametrize(
    "action_map",
    [
        {Action.LOOK_UP: Action.STOP},
        {Action.STOP: Action.NOOP},
        {"LOOK_UP": "NOOP"},
        {Action.LOOK_UP: Action.WAYPOINT},
        7,
    ],
)
def test_a_map_of_other_actions_is_refused(action_map: Any) -> None:
    card = Scripted(kinds=DISCRETE).card
    assert replace(card, action_map=MAP).action_map == MAP
    with pytest.raises(ValidationError, match="action_map"):
        replace(card, action_map=action_map)


def test_the_map_of_a_served_model_arrives_and_a_wrong_one_is_refused_on_both_sides() -> None:
    class Served:
        card: dict[str, Any]

    served = Served()
    served.card = {"name": "tilting", "action_map": {"LOOK_UP": "NOOP", "LOOK_DOWN": "MOVE_FORWARD"}}
    card = card_of({"wire": 2, "card": checked_card(served)}, {})
    assert card.action_map == MAP
    assert "action_map" in card.difference(replace(card, action_map={}))
    for wrong in ({"LOOK_UP": "STOP"}, {"STOP": "NOOP"}, {"LOOK_UP": "FLY"}):
        served.card = {"name": "tilting", "action_map": wrong}
        with pytest.raises(ValueError, match="action_map"):
            checked_card(served)
    for other in (*({"LOOK_UP": name} for name in ("STOP", "FLY", "LOOK_DOWN")), {"STOP": "NOOP"}, ["LOOK_UP"], 1):
        with pytest.raises(ModelError):
            card_of({"wire": 2, "card": {"name": "tilting", "action_map": other}}, {})
