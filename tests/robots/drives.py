"""Movements of the tests of robots over ROS."""

from typing import Any

from vsnbench.values.movement import Move, Trajectory, Velocity, Waypoint, movement_to_json

FREE: dict[str, tuple[dict[str, Any], tuple[float, float]]] = {
    "waypoint": (movement_to_json(Waypoint(0.5, 0.3, 0.0)), (0.5, 0.3)),
    "move": (movement_to_json(Move(0.4, 0.6)), (0.33013, 0.22586)),
    "trajectory": (movement_to_json(Trajectory(((0.2, 0.0), (0.4, 0.1), (0.6, 0.2)))), (0.6, 0.2)),
}
"""Movements that the wall ahead leaves free, and where they end."""
IN_FLIGHT = {
    "waypoint": movement_to_json(Waypoint(1.0, 0.0)),
    "velocity": movement_to_json(Velocity(0.25, 0.2, 2.0)),
}
"""Movements during which a fault happens."""
