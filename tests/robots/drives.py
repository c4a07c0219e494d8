"""Movements of the tests of robots over ROS, and faults during them."""

import json
from itertools import pairwise
from typing import Any

import pytest

from vsnbench.values.movement import Move, Sidestep, Trajectory, Velocity, Waypoint

FREE: dict[str, tuple[dict[str, Any], tuple[float, float]]] = {
    "waypoint": (Waypoint(0.5, 0.3, 0.0).to_json(), (0.5, 0.3)),
    "move": (Move(0.4, 0.6).to_json(), (0.33013, 0.22586)),
    "sidestep": (Sidestep(-0.3).to_json(), (0.0, -0.3)),
    "trajectory": (Trajectory(((0.2, 0.0), (0.4, 0.1), (0.6, 0.2))).to_json(), (0.6, 0.2)),
}
"""Movements that the wall ahead leaves free, and where they end."""
IN_FLIGHT = {
    "waypoint": Waypoint(1.0, 0.0).to_json(),
    "velocity": Velocity(0.25, 0.2, 2.0).to_json(),
}
"""Movements during which a fault happens."""
FAULTS = {
    "silent": ("no odometry", True),
    "nan": ("odometry is not finite", True),
    "jump": ("odometry jumped", True),
    "bumper": ("bumper", False),
    "cliff": ("cliff", False),
    "stuck": ("does not follow", False),
}
"""Faults of the base: part of the reason, and whether a sensor is lost."""
DRIVING_ON = ("--starts", "1", "--max-steps", "5", "--continuous", "0.3")
"""Options of a run that ends at its time limit of 10 s."""


def check_answers(steps: list[tuple[float, str, float]]) -> None:
    """Check the steps of a run that drove on: stamp, movement as JSON, duration."""
    assert len(steps) > 5
    answers = [json.loads(movement)["answer"] for _, movement, _ in steps]
    for (stamp_s, _, _), answer in zip(steps, answers, strict=True):
        assert answer["age_s"] >= 0.3 - 1e-6, "never before the declared latency"
        assert answer["answered_s"] >= stamp_s
    for before, after in pairwise(steps):
        assert after[0] > before[0], "each answer has an image of its own"
    lasted_s = answers[-1]["until_s"] - steps[0][0]
    assert sum(step[2] for step in steps) == pytest.approx(lasted_s, abs=0.01)
    assert lasted_s == pytest.approx(10.0, abs=3.0)


_IN_SHORT = {("silent", "waypoint"), ("stuck", "velocity"), ("bumper", "waypoint")}
FAULTS_IN_FLIGHT = [
    pytest.param(movement, fault, marks=[] if (fault, movement) in _IN_SHORT else pytest.mark.long)
    for movement in IN_FLIGHT
    for fault in FAULTS
]
"""One fault of each kind; the others are long tests, and tests/sensing/test_mover_faults.py has the rules of all."""
