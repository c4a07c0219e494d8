"""A card means the same for its class, its server's stand-alone file and the record."""

import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from vsnbench.errors import ModelError
from vsnbench.models.contract import Policy
from vsnbench.models.remote import vsnbench_policy as wire
from vsnbench.models.remote.card import card_of, card_to_wire
from vsnbench.models.remote.serving import ServedPolicy
from vsnbench.results.writing.campaigns import card_of_row, model_row, model_sha256
from vsnbench.settings.validation import first_error
from vsnbench.values.goal import GoalKind
from vsnbench.values.model.card import Anchor, ModelCard
from vsnbench.values.model.trained_camera import TrainedCamera
from vsnbench.values.movement import MAX_PARTS, TILTS, Action, ActionKind
from vsnbench.values.observation import MAX_HISTORY, Sensor

FULL = ModelCard(
    "full",
    goals=frozenset({"chair", "bed"}),
    sensors=frozenset({Sensor.RGB, Sensor.ODOMETRY}),
    action_kinds=frozenset({ActionKind.DISCRETE, ActionKind.WAYPOINT}),
    weights_sha256="ab12",
    weights_label="of a test",
    settings={"pace": [1, 2.5], "nested": {"a": None}},
    runs_on={"device": "abacus", "memory_gib": 1.5, "compiled": True},
    code={"class": "a:B", "commit": "123"},
    files={"weights": "cd34"},
    forward_m=0.2,
    turn_deg=15.0,
    action_map={Action.LOOK_UP: Action.NOOP, Action.LOOK_DOWN: Action.MOVE_FORWARD},
    stand_in=True,
    camera=TrainedCamera(mount_height_m=(0.5, 0.7), width=640, height=480),
    goal_kinds=frozenset({GoalKind.CATEGORY, GoalKind.IMAGE}),
    deterministic=False,
    anchor=Anchor.ARRIVAL,
    history=12,
)


class Full(Policy):
    """A model whose card states everything."""

    card = FULL

    def reset(self, goal: str, seed: int) -> None:
        """Do nothing."""

    def act(self, observation: object) -> object:
        """Only the card of this model is read."""
        raise AssertionError("no episode runs here")


def sent(policy: Policy, **changes: object) -> ModelCard:
    """Return the card that a client receives from a server."""
    card = wire.unpack(wire.pack({"type": "card", "card": wire.checked_card(ServedPolicy(policy))}))["card"]
    return card_of({"wire": 2, "card": {**card, **changes}}, {})


def nested(levels: int) -> dict[str, object]:
    """Return a mapping in a mapping, and so on."""
    content: dict[str, object] = {}
    for _ in range(levels):
        content = {"a": content}
    return content


def test_every_field_arrives_unchanged_through_the_stand_alone_file() -> None:
    arrived = sent(Full())
    for item in fields(ModelCard):
        if item.name not in ("runs_on", "code", "files"):
            assert getattr(arrived, item.name) == getattr(FULL, item.name), item.name
    assert arrived.runs_on["device"] == "abacus"
    assert arrived.code["class"].endswith("Full")


def test_the_page_of_the_wire_lists_every_field_and_what_is_not_the_identity() -> None:
    page = (Path(__file__).resolve().parents[3] / "docs" / "wire.md").read_text(encoding="utf-8")
    table = page.split("### The card")[1].split("\n#")[0]
    keys = {key for cell in re.findall(r"^\| (`[^|]*) \|", table, re.MULTILINE) for key in re.findall(r"`(\w+)`", cell)}
    assert keys == set(card_to_wire(FULL))
    (exceptions,) = re.findall(r"except (.*)\.\n- \*\*Sessions", page)
    assert set(re.findall(r"\w+", exceptions)) == {item.name for item in fields(ModelCard) if not item.compare}


def test_the_stand_alone_file_knows_the_same_names() -> None:
    assert set(wire.GOAL_KINDS) == set(GoalKind)
    assert {np.dtype(sensor.array.dtype).name for sensor in Sensor if sensor.array} <= set(wire.ARRAY_TYPES)
    assert set(wire.TILTS) == TILTS
    assert wire.MAX_HISTORY == MAX_HISTORY == MAX_PARTS
    assert set(wire.ACTIONS) == {a for a in Action if not a.has_parameters} - TILTS


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"name": " "}, "its card's name: must not be empty"),
        ({"name": 3}, "its card's name: expected text, got 3"),
        ({"name": "n" * 101}, "its card's name is longer than 100 characters"),
        ({"goals": [1]}, "its card's goals.0: expected text, got 1"),
        ({"goals": "chair"}, "its card's goals: expected a list"),
        ({"goals": ["a"] * 1001}, "its card has more than 1000 goals"),
        ({"sensors": ["instances"]}, "its card's sensors are not among rgb, depth, odometry"),
        ({"action_kinds": ["fly"]}, "its card's action_kinds.0: 'fly' is not allowed; write 'discrete', "),
        ({"action_kinds": ["waypont"]}, "its card's action_kinds.0: 'waypont' is not allowed; did you mean waypoint?"),
        ({"goal_kinds": []}, "its card's goal_kinds: "),
        ({"settings": [1]}, "its card's settings: expected a mapping, got a list"),
        ({"settings": {"a": b"1"}}, "its card has values that are not JSON"),
        ({"settings": nested(300)}, "its card has values that are not JSON"),
        ({"runs_on": {b"device": "cpu"}}, "its card's runs_on is not a mapping of strings"),
        ({"runs_on": [1]}, "its card's runs_on is not a mapping of at most 50 strings"),
        ({"forward_m": "0.25"}, "its card's forward_m: expected a number, got '0.25'"),
        ({"turn_deg": -30}, "its card's turn_deg: must be above 0°, got -30°"),
        ({"action_map": {"LOOK_UP": "STOP"}}, "its card's action_map: must map LOOK_UP and LOOK_DOWN to other actions"),
        ({"history": 51}, "its card's history: must be at most 50, got 51"),
        ({"camera": {"width": 640}}, "its card's camera: width and height must be stated together"),
        ({"camera": {"\x1b[31m": 1}}, r"its card's camera.\x1b[31m: unknown field"),
        ({"camera": {"tilt_deg": 80}}, "its card's camera.tilt_deg: must be below 60, got 80"),
    ],
)
def test_an_invalid_card_is_refused_with_its_field(changes: dict[str, object], words: str) -> None:
    with pytest.raises(ModelError) as refused:
        sent(Full(), **changes)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("goals", {"chair"}, "expected a frozenset, got {'chair'}: write frozenset({'chair'})"),
        ("sensors", frozenset({"rgb"}), "expected a Sensor, got 'rgb': write frozenset({Sensor.RGB})"),
        ("action_kinds", frozenset(), "expected at least 1 entry, got 0"),
        (
            "settings",
            {"a": bytearray(b"b")},
            "settings['a'] must be JSON (strings, numbers, lists, mappings), not bytearray",
        ),
        (
            "settings",
            {"a": [range(3)]},
            "an item of settings['a'] must be JSON (strings, numbers, lists, mappings), not range",
        ),
    ],
)
def test_a_class_with_an_invalid_card_is_told_the_field_and_the_fix(field: str, value: object, words: str) -> None:
    with pytest.raises(ValidationError) as refused:
        ModelCard("odd", **{field: value})
    place, problem = first_error(refused.value, ModelCard)
    assert place.split(".")[0] == field
    assert f"{problem.statement}: {problem.advice}".startswith(words)


def test_an_unknown_field_of_a_newer_server_is_ignored_and_none_is_as_absent() -> None:
    assert sent(Full(), mood="good", camera=None).camera is None


def test_the_recorded_card_has_the_identity_of_the_model() -> None:
    card = FULL.recorded({"weights": "ef56"}, FULL.code)
    row = type("Row", (), model_row(card))
    assert model_sha256(card_of_row(row)) == model_sha256(card)
    assert card.settings["action_kinds"] == ["discrete", "waypoint"]
    assert card.settings["action_map"] == {"LOOK_DOWN": "MOVE_FORWARD", "LOOK_UP": "NOOP"}
    assert model_sha256(FULL.recorded({}, {**FULL.code, "commit": "456"})) == model_sha256(FULL.recorded({}, FULL.code))
