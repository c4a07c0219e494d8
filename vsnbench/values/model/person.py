"""How a person in place of a model is named on the command line and in the record."""

from typing import Final

HUMAN: Final = "human"
"""Name of the model."""
DRIVER: Final = "driver"
"""Its setting: the name of the person who drives."""
