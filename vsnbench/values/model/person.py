"""How a person in place of a model is named on the command line and in the record."""

from collections.abc import Mapping
from typing import Any, Final

HUMAN: Final = "human"
"""Name of the model."""
DRIVER: Final = "driver"
"""Its setting: the name of the person who drives."""


def driver_of_model(name: str, settings: Mapping[str, Any]) -> str:
    """Return the name of the person who drove, from a recorded model; empty for a model."""
    return str(settings.get(DRIVER, "")) if name == HUMAN else ""
