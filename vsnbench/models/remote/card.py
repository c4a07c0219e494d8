"""Validates the card that a model's server sends (docs/wire.md)."""

from collections.abc import Mapping
from contextlib import suppress
from enum import StrEnum
from typing import Any, TypeVar

from pydantic import ValidationError

from vsnbench.errors import ModelError
from vsnbench.models.contract import ModelCard
from vsnbench.models.remote.vsnbench_policy import SENSORS
from vsnbench.models.trained_camera import TrainedCamera
from vsnbench.text.sanitize import sanitize
from vsnbench.values.action import Action, can_replace
from vsnbench.values.goal import GoalKind
from vsnbench.values.movement import ActionKind
from vsnbench.values.observation import Sensor

Kind = TypeVar("Kind", bound=StrEnum)

_MAX_STRINGS = 1000
_MAX_ENTRIES = 50
_MAX_NAME = 100
_MAX_TEXT = 300
_LARGEST_STEP = 360.0
_SINCE_VERSION_2 = ("goal_kinds", "action_kinds", "action_map", "forward_m", "turn_deg", "camera")
_NOT_IDENTITY = ("runs_on", "forward_m", "turn_deg", "camera")


def card_of(greeting: Mapping[str, Any], lost: Mapping[str, str]) -> ModelCard:
    """Return the card of a server's first message. Lossy encodings of sensors become part of the settings.

    Raises:
        ModelError: the card is missing or invalid; the caller puts the model's address in front of the message.
    """
    card = greeting.get("card")
    if not isinstance(card, dict):
        raise ModelError("it has no card")
    if greeting.get("wire") == 1:
        card = {name: value for name, value in card.items() if name not in _SINCE_VERSION_2}
    name, goals, sensors = card.get("name"), card.get("goals"), card.get("sensors", [])
    if not isinstance(name, str) or not name.strip() or len(name) > _MAX_NAME:
        raise ModelError("its card has no name")
    if goals is not None and not _are_strings(goals):
        raise ModelError("its card's goals are not a list of strings")
    if not _are_strings(sensors) or not set(sensors) <= set(SENSORS):
        raise ModelError(f"its card's sensors are not among {', '.join(SENSORS)}")
    if not isinstance(card.get("settings", {}), dict):
        raise ModelError("its card's settings are not a mapping")
    return ModelCard(
        name=name,
        action_kinds=_kinds(card, "action_kinds", ActionKind),
        goal_kinds=_kinds(card, "goal_kinds", GoalKind),
        goals=None if goals is None else frozenset(goals),
        sensors=frozenset(Sensor(sensor) for sensor in sensors),
        weights_sha256=str(card.get("weights_sha256") or "")[:64],
        weights_label=str(card.get("weights_label") or "")[:200],
        settings={**card.get("settings", {}), **lost},
        code=_texts(card.get("code"), "code"),
        files=_texts(card.get("files"), "files"),
        runs_on=_texts(card.get("runs_on"), "runs_on"),
        stand_in=card.get("stand_in") is True,
        action_map=_action_map(card.get("action_map")),
        forward_m=_step_size(card, "forward_m"),
        turn_deg=_step_size(card, "turn_deg"),
        camera=_camera(card.get("camera")),
    )


def difference(card: ModelCard, other: ModelCard) -> str:
    """Return how the identities of two cards differ, or an empty string."""
    before, after = _identity_on(card), _identity_on(other)
    different = [name for name in before if before[name] != after[name]]
    return ", ".join(f"{name} {str(before[name])[:40]!r} → {str(after[name])[:40]!r}" for name in different)


def _identity_on(card: ModelCard) -> dict[str, Any]:
    """Return the fields of a card that identify the model: not the platform, and not the commit."""
    identity = {name: getattr(card, name) for name in ModelCard.__dataclass_fields__ if name not in _NOT_IDENTITY}
    return identity | {"code": {name: value for name, value in card.code.items() if name != "commit"}}


def _kinds(card: Mapping[str, Any], name: str, kinds: type[Kind]) -> frozenset[Kind]:
    """Return the kinds that a card states; a card without them has the first."""
    given = card.get(name)
    if given is None:
        return frozenset({next(iter(kinds))})
    if not _are_strings(given) or not given or not set(given) <= set(kinds):
        raise ModelError(f"its card's {name} are not among {', '.join(kinds)}")
    return frozenset(kinds(kind) for kind in given)


def _action_map(given: object) -> dict[Action, Action]:
    """Return the actions that replace LOOK_UP and LOOK_DOWN."""
    if given is None:
        return {}
    if isinstance(given, dict):
        with suppress(ValueError):
            found = {Action(action): Action(replacement) for action, replacement in given.items()}
            if all(can_replace(*pair) for pair in found.items()):
                return found
    raise ModelError("its card's action_map does not map LOOK_UP and LOOK_DOWN to other actions")


def _step_size(card: Mapping[str, Any], name: str) -> float | None:
    """Return a step size that the model assumes; None if the card has none."""
    value = card.get(name)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value <= _LARGEST_STEP:
        raise ModelError(f"its card's {name} is not a number above 0")
    return float(value)


def _camera(given: object) -> TrainedCamera | None:
    """Return the camera that the model was trained with; None if the card has none."""
    if given is None:
        return None
    try:
        return TrainedCamera.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(["camera", *(str(part) for part in first["loc"][:1])])
        raise ModelError(f"its card's {where} is invalid: {sanitize(first['msg'])[:_MAX_TEXT]}") from error


def _are_strings(value: object) -> bool:
    return isinstance(value, list) and len(value) <= _MAX_STRINGS and all(isinstance(item, str) for item in value)


def _texts(value: object, what: str) -> dict[str, str]:
    """Return a mapping of names to short strings; numbers are converted."""
    if value is None:
        return {}
    if not isinstance(value, dict) or len(value) > _MAX_ENTRIES:
        raise ModelError(f"its card's {what} is not a mapping of at most {_MAX_ENTRIES} strings")
    found = {}
    for name, item in value.items():
        if not isinstance(item, str | int | float | None) or len(name) > _MAX_NAME:
            raise ModelError(f"its card's {what} is not a mapping of strings")
        found[sanitize(name)] = sanitize(str(item)[:_MAX_TEXT])
    return found
