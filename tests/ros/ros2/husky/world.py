"""The room of a site file as boxes in PyBullet."""

import math
from pathlib import Path
from typing import Any

import pybullet
from ruamel.yaml import YAML

_WALL, _FLOOR, _CEILING = (0.86, 0.84, 0.80), (0.55, 0.50, 0.45), (0.95, 0.95, 0.95)
_COLORS = {"chair": (0.15, 0.30, 0.70), "cabinet": (0.60, 0.40, 0.20)}
_FLOOR_M = 0.2
"""Thickness of the floor."""


def build(site: Path, client: int) -> dict[str, int]:
    """Build the floor, the walls, the ceiling and the objects; return their bodies by name."""
    room: dict[str, Any] = YAML(typ="safe").load(site.read_text(encoding="utf-8"))
    height_m = room["ceiling_height_m"]
    corners = [corner for part in room["rooms"] for corner in part["polygon"]]
    low, high = ([side(corner[axis] for corner in corners) for axis in (0, 1)] for side in (min, max))
    middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    size = [b - a + 0.4 for a, b in zip(low, high, strict=True)]
    bodies = {
        "floor": _box(client, (*middle, -_FLOOR_M / 2), (*size, _FLOOR_M), 0.0, _FLOOR),
        "ceiling": _box(client, (*middle, height_m + 0.05), (*size, 0.1), 0.0, _CEILING),
    }
    for number, wall in enumerate(room["walls"], 1):
        (x0, y0), (x1, y1) = wall["start"], wall["end"]
        long_m, thick_m = math.dist(wall["start"], wall["end"]), wall.get("thickness_m", 0.10)
        centre, yaw_rad = ((x0 + x1) / 2, (y0 + y1) / 2, height_m / 2), math.atan2(y1 - y0, x1 - x0)
        bodies[f"wall {number}"] = _box(client, centre, (long_m + thick_m, thick_m, height_m), yaw_rad, _WALL)
    for thing in room["objects"]:
        yaw_rad, tall_m = math.radians(thing.get("heading_deg", 0)), thing["size_m"][2]
        centre = (*thing["position"], tall_m / 2)
        bodies[thing["id"]] = _box(client, centre, thing["size_m"], yaw_rad, _COLORS[thing["category"]])
    return bodies


def _box(client: int, centre: Any, size: Any, yaw_rad: float, color: tuple[float, float, float]) -> int:
    half = [length_m / 2 for length_m in size]
    solid = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client)
    seen = pybullet.createVisualShape(
        pybullet.GEOM_BOX, halfExtents=half, rgbaColor=(*color, 1.0), physicsClientId=client
    )
    turned = pybullet.getQuaternionFromEuler((0.0, 0.0, yaw_rad))
    return int(pybullet.createMultiBody(0, solid, seen, centre, turned, physicsClientId=client))
