"""The card with which a model's server introduces itself, checked: docs/wire.md says what is on it."""

from collections.abc import Mapping
from typing import Any

from vsnbench.errors import ModelError
from vsnbench.harmless_text import harmless
from vsnbench.models.contract import ModelCard
from vsnbench.models.remote.vsnbench_policy import SENSORS
from vsnbench.protocol.categories import GOAL_CATEGORIES
from vsnbench.protocol.observation import Sensor

_MOST_WORDS = 1000
_MOST_ENTRIES = 50
_LONGEST_NAME = 100
_LONGEST_TEXT = 300


def card_of(greeting: Mapping[str, Any], lost: Mapping[str, str]) -> ModelCard:
    """Return the card of a server's first message.

    Args:
        greeting: the message.
        lost: what the way there takes from the sensors, which is part of the settings.

    Raises:
        ModelError: there is no card, or it is none; the message begins in mid-sentence, after who it is about.
    """
    card = greeting.get("card")
    if not isinstance(card, dict):
        raise ModelError("it has no card")
    name, goals, sensors = card.get("name"), card.get("goals"), card.get("sensors", [])
    if not isinstance(name, str) or not name.strip() or len(name) > _LONGEST_NAME:
        raise ModelError("its card has no name")
    if goals is not None and not _are_words(goals):
        raise ModelError("its card's goals are no list of words")
    if goals is not None and not set(goals) & set(GOAL_CATEGORIES):
        raise ModelError(f"it knows none of the goals {', '.join(GOAL_CATEGORIES)}")
    if not _are_words(sensors) or not set(sensors) <= set(SENSORS):
        raise ModelError(f"its card's sensors are not of {', '.join(SENSORS)}")
    if not isinstance(card.get("settings", {}), dict):
        raise ModelError("its card's settings are no map")
    return ModelCard(
        name=name,
        goals=None if goals is None else frozenset(goals),
        sensors=frozenset(Sensor(sensor) for sensor in sensors),
        weights_sha256=str(card.get("weights_sha256") or "")[:64],
        weights_label=str(card.get("weights_label") or "")[:200],
        settings={**card.get("settings", {}), **lost},
        code=_texts(card.get("code"), "code"),
        files=_texts(card.get("files"), "files"),
        runs_on=_texts(card.get("runs_on"), "runs_on"),
        stand_in=card.get("stand_in") is True,
    )


def difference(card: ModelCard, other: ModelCard) -> str:
    """Return in words what makes two cards those of different models; empty when they are one model's."""
    before, after = _identity_on(card), _identity_on(other)
    different = [name for name in before if before[name] != after[name]]
    return ", ".join(f"{name} {str(before[name])[:40]!r} → {str(after[name])[:40]!r}" for name in different)


def _identity_on(card: ModelCard) -> dict[str, Any]:
    """Return what is compared of a card: where it runs, and a commit that changes nothing of the source, are not."""
    said = {name: getattr(card, name) for name in ModelCard.__dataclass_fields__ if name != "runs_on"}
    return said | {"code": {name: value for name, value in card.code.items() if name != "commit"}}


def _are_words(value: object) -> bool:
    return isinstance(value, list) and len(value) <= _MOST_WORDS and all(isinstance(word, str) for word in value)


def _texts(value: object, what: str) -> dict[str, str]:
    """Return a map of names to short texts; numbers are taken for their digits."""
    if value is None:
        return {}
    if not isinstance(value, dict) or len(value) > _MOST_ENTRIES:
        raise ModelError(f"its card's {what} is no map of at most {_MOST_ENTRIES} texts")
    found = {}
    for name, item in value.items():
        if not isinstance(item, str | int | float | None) or len(name) > _LONGEST_NAME:
            raise ModelError(f"its card's {what} is no map of texts")
        found[harmless(name)] = harmless(str(item)[:_LONGEST_TEXT])
    return found
