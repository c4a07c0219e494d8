"""The goals of VLV, with their names in the value network and in COCO."""

from types import MappingProxyType
from typing import Final

VALUE_CLASSES: Final = ("bed", "chair", "couch", "dining table", "toilet")
"""In the order of the value network's outputs."""

CLASS_OF_GOAL: Final = MappingProxyType(
    {"chair": "chair", "sofa": "couch", "table": "dining table", "bed": "bed", "toilet": "toilet"}
)
"""The paper's goals (Table 4) and their COCO classes."""
GOAL_OF_CLASS: Final = MappingProxyType({name: goal for goal, name in CLASS_OF_GOAL.items()})
