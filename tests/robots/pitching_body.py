"""Approaches of a walking robot to obstacles, whose body pitches and rolls: with its attitude known, and without."""

import math
from dataclasses import dataclass, field

import numpy as np

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.depth_guard import look_ahead
from vsnbench.runner.episode.path_guard import PathGuard
from vsnbench.sites.site import Site, StartingPosition
from vsnbench.values.camera import Camera
from vsnbench.values.movement import Action, Waypoint
from vsnbench.values.observation import Sensor
from vsnbench.values.robot_profile import BaseDynamics, RobotProfile

LANE_M, LONG_M = 2.5, 5.0
HEIGHTS_M = {"wall": 2.0, "table": 0.7, "step": 0.12, "threshold": 0.07, "kerb": 0.05}
"""Obstacles across the way, by their height; the lane of `free` has none."""
LANES = (*HEIGHTS_M, "leg", "free")
_NEAR_M = 2.9
"""Where the obstacles begin."""
GAIT = BaseDynamics(
    dead_time_s=0.1, motor_time_constant_s=0.15, sway_m=0.008, sway_hz=2.5, pitch_deg=1.5, roll_deg=1.5, lean_deg=1.5
)
"""Roll and pitch as large as the standard deviations of the Go2 of tests/ros/ros2/go2; a rough gait has more."""
ROUGH = GAIT.model_copy(update={"pitch_deg": 5.0, "roll_deg": 4.0, "lean_deg": 3.0})


def lanes() -> Site:
    """Return a hall whose lanes lead to one obstacle each."""
    width_m = LANE_M * len(LANES)
    corners = [(0.0, 0.0), (LONG_M, 0.0), (LONG_M, width_m), (0.0, width_m)]
    objects = []
    for number, name in enumerate(LANES):
        if name == "free":
            continue
        depth_m, across_m, high_m = (0.05, 0.05, 0.7) if name == "leg" else (0.4, 1.6, HEIGHTS_M[name])
        position = (_NEAR_M + depth_m / 2, LANE_M * (number + 0.5))
        size = (depth_m, across_m, high_m)
        objects.append({"id": name, "category": "cabinet", "model": "box", "position": position, "size_m": size})
    return Site.model_validate(
        {
            "name": "lanes",
            "rooms": [{"name": "hall", "polygon": corners}],
            "walls": [{"start": corners[side], "end": corners[(side + 1) % 4]} for side in range(4)],
            "objects": objects,
            "starts": [{"number": 1, "position": (1.0, 1.0), "heading_deg": 0}],
        }
    )


def walker(dynamics: BaseDynamics, *, knows_attitude: bool) -> RobotProfile:
    """Return a robot of the size of a Go2 whose camera looks down; its odometry has the attitude, or it is not used."""
    base = load_profile("turtlebot4")
    assert base.interface is not None
    attitude = {"attitude": {"topic": "odom"}} if knows_attitude else {}
    camera = Camera(
        width=160,
        height=120,
        horizontal_fov_deg=69,
        mount_height_m=0.4,
        mount_forward_m=0.25,
        tilt_deg=-20,
        depth_min_m=0.2,
        depth_max_m=6.0,
    )
    size = {"radius_m": 0.35, "height_m": 0.45, "mass_kg": 15.0, "has_bumper": False}
    return base.model_copy(
        update={
            "name": "walker",
            "base": base.base.model_copy(update={**size, "max_linear_m_s": 1.0, "odometry_rate_hz": 50}),
            "camera": camera,
            "interface": type(base.interface).model_validate(base.interface.model_dump() | attitude),
            "dynamics": dynamics,
        }
    )


@dataclass
class Approaches:
    """Counts of approaches."""

    touched: list[str] = field(default_factory=list)
    """The obstacles that were touched."""
    refused_free: int = 0
    """Number of refusals with nothing in the lane within a metre ahead of the front."""
    walked: int = 0
    """Number of approaches."""
    left_m: list[float] = field(default_factory=list)
    """Way that was left ahead of the front at a refusal."""


def approach(
    robot: SimulatedRobot, lane: str, rng: np.random.Generator, counts: Approaches, *, drives_through: bool
) -> None:
    """Walk from a random pose straight ahead until the guard refuses, the robot touches something, or 3 m are covered.

    Args:
        robot: robot of `walker` in `lanes`.
        lane: one of LANES.
        rng: for the pose.
        counts: receives the result.
        drives_through: whether the robot walks through by waypoints, watched by the path guard, or by discrete moves.
    """
    parameters = ProtocolParameters()
    y_m = LANE_M * (LANES.index(lane) + 0.5) + (0.0 if lane == "leg" else rng.uniform(-0.2, 0.2))
    heading_deg = rng.uniform(-3, 3) if lane == "leg" else rng.uniform(-12, 12)
    start = StartingPosition(number=1, position=(rng.uniform(0.7, 1.3), y_m), heading_deg=heading_deg)
    robot.begin(start, int(rng.integers(1 << 30)))
    counts.walked += 1
    driven_m = 0.0
    while driven_m < 2.4:
        if drives_through:
            result = robot.drive(Waypoint(1.2, 0.0), PathGuard(robot.profile, parameters))
            refused = bool(result.blocked)
        else:
            observation = robot.observe()
            refused = look_ahead(observation, robot.profile.base, parameters.depth_guard).blocked
            result = None if refused else robot.drive(parameters.movement_of(Action.MOVE_FORWARD))
        if result is not None and result.collision is not None:
            counts.touched.append(lane)
            return
        if refused:
            here = robot.locate().pose
            end_m = LONG_M if lane == "free" else _NEAR_M
            left_m = (end_m - here.x_m) / math.cos(here.heading_rad) - robot.profile.base.radius_m
            counts.left_m.append(left_m)
            counts.refused_free += left_m > 1.0
            return
        driven_m += 1.2 if drives_through else 0.25


def approaches(dynamics: BaseDynamics, number: int, *, knows_attitude: bool, seed: int = 0) -> Approaches:
    """Return the counts of a number of approaches, to each obstacle in turn, by turns in both ways of driving."""
    profile = walker(dynamics, knows_attitude=knows_attitude)
    robot = SimulatedRobot(lanes(), profile, read=frozenset({Sensor.DEPTH, Sensor.ODOMETRY}))
    counts, rng = Approaches(), np.random.default_rng(seed)
    for count in range(number):
        drives_through = count // len(LANES) % 2 == 1
        approach(robot, LANES[count % len(LANES)], rng, counts, drives_through=drives_through)
    return counts
