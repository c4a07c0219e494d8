"""The goals VLV knows, and what the value network and COCO detectors call them."""

from types import MappingProxyType
from typing import Final

VALUE_CLASSES: Final = ("bed", "chair", "couch", "dining table", "toilet")
"""In the order of the value network's outputs."""

CLASS_OF_GOAL: Final = MappingProxyType(
    {"chair": "chair", "sofa": "couch", "table": "dining table", "bed": "bed", "toilet": "toilet"}
)
"""The paper's goals (Table 4) in COCO's words."""
GOAL_OF_CLASS: Final = MappingProxyType({name: goal for goal, name in CLASS_OF_GOAL.items()})
