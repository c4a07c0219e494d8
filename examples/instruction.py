"""An instruction follower by keywords: "turn left, go to the blue sofa, then stop at a red chair".

It reads turns and colours, in their order, and ignores all other words. It explores like examples/frontier.py until it
sees enough of a colour, drives there, and continues with the next keyword. It needs no labels of the simulator.

vsnbench run --model examples.instruction:KeywordFollower --site examples/goals.yaml --goal left-to-a-chair
"""

import re
from typing import Any

import numpy as np
from scipy import ndimage

from examples.frontier import Frontier
from vsnbench import Action, Decision, GoalKind, ModelCard, Observation, Sensor

TURNS_RAD = {"left": np.pi / 2, "right": -np.pi / 2, "around": np.pi}
HUES_DEG = {"red": (350, 12), "yellow": (40, 65), "green": (75, 165), "blue": (200, 235), "purple": (250, 300)}
"""First and last hue of each colour on the colour wheel."""
KEYWORDS = re.compile(rf"turn ({'|'.join(TURNS_RAD)})|\b({'|'.join(HUES_DEG)})\b")
SATURATION = 0.45
"""Paler pixels have no colour."""
AREA_M2 = 0.02
"""Smaller spots of a colour are ignored."""


class KeywordFollower(Frontier):
    """Follows the keywords of an instruction one after another, by waypoints."""

    card = ModelCard(
        "keyword-follower",
        sensors=frozenset({Sensor.RGB, Sensor.DEPTH, Sensor.ODOMETRY}),
        action_kinds=Frontier.card.action_kinds,
        goal_kinds=frozenset({GoalKind.INSTRUCTION}),
    )

    def reset(self, goal: str, seed: int) -> None:
        """Read the instruction."""
        super().reset(goal, seed)
        self.steps = [turn or colour for turn, colour in KEYWORDS.findall(goal.lower())]

    def act(self, observation: Observation) -> Decision:
        """Turn as told, or explore until the robot is at something of the next colour."""
        if self.steps and self.steps[0] in TURNS_RAD:
            return self.turn(TURNS_RAD[self.steps.pop(0)])
        if not self.steps:
            return Decision(Action.STOP)
        decision = super().act(observation)
        if decision.action is not Action.STOP or len(self.steps) == 1:
            return decision
        self.steps.pop(0)
        self.stop[:] = False  # places to stop belong to the last colour
        return self.turn(np.pi / 2)  # and look for the next one

    def goal_pixels(self, observation: Observation) -> Any:
        """Return which pixels are part of a large spot of the next colour."""
        first_deg, last_deg = HUES_DEG[self.steps[0]]
        hue_deg, saturation = hue_and_saturation(observation.rgb)
        spots = ((hue_deg - first_deg) % 360 < (last_deg - first_deg) % 360) & (saturation > SATURATION)
        return large_spots(spots, observation)


def hue_and_saturation(rgb: Any) -> tuple[Any, Any]:
    """Return the hue in degrees and the saturation from 0 to 1 of each pixel; black has no saturation."""
    red, green, blue = np.moveaxis(rgb.astype(float), 2, 0)
    high, low = rgb.max(axis=2).astype(float), rgb.min(axis=2).astype(float)
    hue_deg = np.degrees(np.arctan2(np.sqrt(3) * (green - blue), 2 * red - green - blue)) % 360
    return hue_deg, np.where(high > 30, (high - low) / np.maximum(high, 1), 0)


def large_spots(pixels: Any, observation: Observation) -> Any:
    """Return which of some pixels belong to connected spots with a surface of at least AREA_M2."""
    depth_m = observation.depth_m
    if depth_m is None:
        raise ValueError("the card asks for depth")
    numbers, count = ndimage.label(pixels & np.isfinite(depth_m))
    pixel_m2 = (np.nan_to_num(depth_m) / observation.camera.focal_px) ** 2
    areas_m2 = ndimage.sum_labels(pixel_m2, numbers, np.arange(count + 1))
    areas_m2[0] = 0.0
    return areas_m2[numbers] > AREA_M2
