"""Ways to a STOP with an odometry that drifts: poses, depth images, and what the odometry makes of them."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from benchmarks.support.placement_trials import DEPTH_SCALE, NoisyEye, draw_trial
from vsnbench.models.baselines.oracle import Oracle
from vsnbench.protocol.judge import GoalDistance, distance_to_goal
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.runner.episode.stop_measurement import StopMeasurement
from vsnbench.sites.site import Site, StartingPosition
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.movement import Action, Move
from vsnbench.values.observation import observation_of
from vsnbench.values.placement import PoseCovariance
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import RobotProfile

WAY_SCALE, TURN_SCALE, HEADING_RAD = 0.05, 0.02, 0.10
"""Largest errors of the odometry: of its distances and turns, relative; and of its heading at the end of a way."""
_STOPS_M = (0.5, 1.5)
"""Distances to the goal at which the robot stops."""
_START_STD_M, _START_STD_RAD = 0.007, math.radians(0.2)
"""Errors of a measured start."""
_LEAST_STEPS = 4
_RENDERED = 14
"""Number of the last poses whose depth images are drawn."""


@dataclass(frozen=True, slots=True)
class Way:
    """True poses of a way, at each of which the robot looks."""

    site: Site
    goal: str
    start: StartingPosition
    poses: tuple[Pose, ...]


@dataclass(frozen=True, slots=True)
class DrivenWay:
    """A way that a robot with drifting odometry has driven."""

    site: Site
    goal: str
    start: int
    way_m: float
    true_pose: Pose
    true_distance: GoalDistance


def way_to_goal(sites: Sequence[Site], profile: RobotProfile, seed: int, number: int) -> Way:
    """Return the oracle's way to a random goal from a random start, cut where its distance to the goal is random."""
    rng = np.random.default_rng([seed, number, 1])
    site = sites[number % len(sites)]
    while True:
        goals = sorted({thing.category for thing in site.objects if thing.category in _GOALS})
        goal, start = str(rng.choice(goals)), site.starts[int(rng.integers(len(site.starts)))]
        poses = _oracle_way(site, goal, start, profile)
        stop_m = rng.uniform(*_STOPS_M)
        near = [_distance(site, goal, pose).distance_m < stop_m for pose in poses]
        if any(near) and near.index(True) >= _LEAST_STEPS:
            return Way(site, goal, start, tuple(poses[: near.index(True) + 1]))


def way_to_wall(apartment: Site, number: int) -> Way:
    """Return a short way straight towards a bare wall of the apartment, with nothing else in view."""
    x_m, y_m = 7.6 - 0.02 * (number % 10), 5.9 + 0.05 * (number // 10 % 4 - 2)
    poses = tuple(Pose(x_m - 0.25 * step, y_m, math.pi) for step in range(3))
    return Way(apartment, "chair", apartment.starts[0], poses)


_GOALS = ("chair", "sofa", "bed", "table", "plant", "monitor", "toilet", "refrigerator")


def _oracle_way(site: Site, goal: str, start: StartingPosition, profile: RobotProfile) -> list[Pose]:
    """Return the poses at which the oracle looks, with exact movements."""
    parameters, here, poses = ProtocolParameters(), start.pose, []
    oracle = Oracle(0.45)
    oracle.survey(site, start.pose, profile.base, parameters)
    oracle.reset(goal, 0)
    for _ in range(parameters.max_actions):
        poses.append(here)
        action = oracle.act(observation_of(0.0, profile.camera, pose=here.relative_to(start.pose))).action
        if action is Action.STOP:
            break
        movement = parameters.movement_of(action)
        assert isinstance(movement, Move)
        here = here.compose(Pose(movement.distance_m, 0.0, movement.turn_rad))
    return poses


def drive(
    way: Way, profile: RobotProfile, parameters: ProtocolParameters, rng: Generator
) -> tuple[DrivenWay, StopMeasurement]:
    """Drive a way with an odometry that drifts; return the truth, and what measures the pose at its end."""
    camera = profile.camera.without_roll
    room = draw_trial(way.site, way.start, rng, 0.01, 0.1, moved=1).room
    eye = NoisyEye(room, camera, 1 + DEPTH_SCALE * float(rng.choice([-1, 1])), rng)
    odometry = drifted(way.poses, rng)
    dx, dy, turn = rng.normal(0.0, (_START_STD_M, _START_STD_M, _START_STD_RAD))
    true = way.poses[0]
    start = Fix(Pose(true.x_m + dx, true.y_m + dy, true.heading_rad + turn), PoseSource.MEASURED)
    known = PoseCovariance(_START_STD_M**2, 0.0, 0.0, _START_STD_M**2, 0.0, _START_STD_RAD**2)
    meter = StopMeasurement(way.site, way.goal, parameters, start, known)
    for number, (pose, measured) in enumerate(zip(way.poses, odometry, strict=True)):
        depth_m = eye.look(pose).depth_m if number >= len(way.poses) - _RENDERED else None
        meter.look(observation_of(float(number), camera, pose=measured, depth_m=depth_m))
    way_m = sum(pose.distance_to(later) for pose, later in itertools.pairwise(way.poses))
    end = way.poses[-1]
    return DrivenWay(way.site, way.goal, way.start.number, way_m, end, _distance(way.site, way.goal, end)), meter


def drifted(poses: Sequence[Pose], rng: Generator) -> list[Pose]:
    """Return what an odometry with random errors measures along true poses, from zero at the first one."""
    steps = [later.relative_to(earlier) for earlier, later in itertools.pairwise(poses)]
    way, turn = rng.uniform(-WAY_SCALE, WAY_SCALE), rng.uniform(-TURN_SCALE, TURN_SCALE)
    lengths_m = np.array([math.hypot(*step.position) for step in steps])
    curve = lengths_m / max(lengths_m.sum(), 1e-9)
    walk = rng.normal(0.0, np.sqrt(curve))
    walk = walk - curve * walk.sum()  # a bridge: the curve alone reaches the error at the end
    off_rad = rng.uniform(-HEADING_RAD, HEADING_RAD) * curve + 0.3 * HEADING_RAD * walk
    here, measured = Pose(0.0, 0.0), [Pose(0.0, 0.0)]
    for step, off in zip(steps, off_rad.tolist(), strict=True):
        turned = math.remainder(step.heading_rad, math.tau) * (1 + turn) + off
        here = here.compose(Pose(step.x_m * (1 + way), step.y_m * (1 + way), turned))
        measured.append(here)
    return measured


def _distance(site: Site, goal: str, pose: Pose) -> GoalDistance:
    return distance_to_goal(site, goal, Fix(pose, PoseSource.SIMULATED), ProtocolParameters())
