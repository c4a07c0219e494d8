"""Differences of a model from the last one of the same name, reported for new campaigns."""

from collections.abc import Mapping
from typing import Any

from sqlalchemy import Connection, select

from vsnbench.results.reading.read_model import CODE
from vsnbench.results.schema.tables import CampaignRow, ModelRow
from vsnbench.results.writing.campaigns import card_of_row
from vsnbench.text.sanitize import sanitize
from vsnbench.values.model.card import ModelCard

_SHOWN_CHARACTERS = 41
"""Length of a displayed hash."""
_HASH_CHARACTERS = 12
_HASHES = frozenset({"weights", "sha256"})


def differences(old: ModelCard, new: ModelCard) -> tuple[str, ...]:
    """Return the differences between two models of the same name."""
    found = _changed("", {"weights": old.weights_sha256}, {"weights": new.weights_sha256})
    found += _changed("file --", old.files, new.files, hashes=True)
    found += _changed("code ", old.code, new.code)
    found += _changed("setting ", old.settings, new.settings)
    if old.surveyed != new.surveyed:
        found.append("access to the site file")
    return tuple(found)


def last_of_its_name(connection: Connection, name: str, campaign_id: int) -> tuple[int, ModelCard] | None:
    """Return the newest earlier campaign of a model of this name, and its model; None if there is none."""
    row = connection.execute(
        select(ModelRow.__table__, CampaignRow.id.label("campaign_id"))
        .join(CampaignRow, CampaignRow.model_id == ModelRow.id)
        .where(ModelRow.name == name, CampaignRow.id < campaign_id, CODE.is_(None))  # blinded arms are left out
        .order_by(CampaignRow.id.desc())
        .limit(1)
    ).first()
    return None if row is None else (row.campaign_id, card_of_row(row))


def _changed(kind: str, old: Mapping[str, Any], new: Mapping[str, Any], *, hashes: bool = False) -> list[str]:
    words = []
    old, new = _flat(old), _flat(new)
    for name in sorted(old.keys() | new.keys()):
        was, now = old.get(name), new.get(name)
        if was != now:
            shown = f"{kind}{name.replace('_', '-') if hashes else name}"
            most = _HASH_CHARACTERS if hashes or name.rpartition(".")[2] in _HASHES else _SHOWN_CHARACTERS
            words.append(f"{shown} ({_short(was, most)} → {_short(now, most)})")
    return words


def _flat(values: Mapping[str, Any], within: str = "") -> dict[str, Any]:
    """Return all single values by their paths."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value, f"{within}{name}.") if isinstance(value, Mapping) else {f"{within}{name}": value}
    return flat


def _short(value: Any, most: int) -> str:
    return "none" if value is None or value == "" else sanitize(str(value)[:most])
