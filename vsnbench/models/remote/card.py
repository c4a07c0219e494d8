"""Validates the card that a model's server sends (docs/wire.md)."""

import json
from collections.abc import Mapping
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError

from vsnbench.errors import ModelError
from vsnbench.settings.validation import first_error
from vsnbench.text.sanitize import sanitize
from vsnbench.values.model.card import ModelCard
from vsnbench.values.observation import Sensor

_MOST_NAMES: Final = 1000
_MOST_ENTRIES: Final = 50
_LONGEST_NAME: Final = 100
_CLIPPED: Final = {"weights_sha256": 64, "weights_label": 200}
_LONGEST_TEXT: Final = 300
_OF_TEXTS: Final = ("code", "files", "runs_on")
_LISTS: Final = ("goals", "action_kinds", "goal_kinds", "cameras")
_NOT_SENT: Final = ("surveyed",)
_SENSORS: Final = tuple(sensor.value for sensor in Sensor if sensor.is_sent)
_CARD: Final = TypeAdapter(ModelCard)


def card_of(greeting: Mapping[str, Any], lost: Mapping[str, str]) -> ModelCard:
    """Return the card of a server's first message. Lossy encodings of sensors become part of the settings.

    Unknown fields are ignored.

    Raises:
        ModelError: the card is missing or invalid; the caller puts the model's address in front of the message.
    """
    sent = greeting.get("card")
    if not isinstance(sent, dict):
        raise ModelError("it has no card")
    known = set(ModelCard.__dataclass_fields__) - set(_NOT_SENT)
    card = {name: value for name, value in sent.items() if name in known and value is not None}
    card |= {name: _texts(card[name], name) for name in _OF_TEXTS if name in card}
    card |= {name: card[name][:most] for name, most in _CLIPPED.items() if isinstance(card.get(name), str)}
    sensors = card.get("sensors", [])
    if not isinstance(sensors, list) or not all(sensor in _SENSORS for sensor in sensors):
        raise ModelError(f"its card's sensors are not among {', '.join(_SENSORS)}")
    for name in _LISTS:
        if not isinstance(card.get(name, []), list):
            raise ModelError(f"its card's {name}: expected a list")
    if isinstance(card.get("name"), str) and len(card["name"]) > _LONGEST_NAME:
        raise ModelError(f"its card's name is longer than {_LONGEST_NAME} characters")
    if isinstance(card.get("goals"), list) and len(card["goals"]) > _MOST_NAMES:
        raise ModelError(f"its card has more than {_MOST_NAMES} goals")
    if isinstance(settings := card.get("settings", {}), dict):
        card["settings"] = {**settings, **lost}
    try:
        return _CARD.validate_json(json.dumps(card))
    except ValidationError as error:
        field, problem = first_error(error, ModelCard)
        if not field:  # too deep, or not UTF-8
            raise ModelError("its card has values that are not JSON") from error
        where = ".".join(field.split(".")[:2])  # without the member of a union
        statement = f"its card's {sanitize(where)}: {sanitize(problem.statement)}"[:_LONGEST_TEXT]
        raise ModelError(statement, advice=sanitize(problem.advice)[:_LONGEST_TEXT]) from error
    except (TypeError, ValueError, RecursionError) as error:
        raise ModelError("its card has values that are not JSON") from error


def card_to_wire(card: ModelCard) -> dict[str, Any]:
    """Return the fields of a card that a server sends."""
    return {name: getattr(card, name) for name in ModelCard.__dataclass_fields__ if name not in _NOT_SENT}


def _texts(value: object, what: str) -> dict[str, str]:
    """Return a mapping of names to short strings; numbers are converted."""
    if not isinstance(value, dict) or len(value) > _MOST_ENTRIES:
        raise ModelError(f"its card's {what} is not a mapping of at most {_MOST_ENTRIES} strings")
    found = {}
    for name, item in value.items():
        if not isinstance(name, str) or len(name) > _LONGEST_NAME or not isinstance(item, str | int | float | None):
            raise ModelError(f"its card's {what} is not a mapping of strings")
        found[sanitize(name)] = sanitize(str(item)[:_LONGEST_TEXT])
    return found
