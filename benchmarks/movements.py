"""Measures the accuracy of movements and of late answers, and collisions under the path guard.

`accuracy` measures position and heading errors (mm, degrees) of moves, waypoints and trajectories in an empty hall.
`late` drives along a curve by answers that take effect 1 s after their image, and measures the distance from the curve.
`guard` drives towards obstacles in the apartment and counts contacts by speed; with `--continuous` the robot drives on
and gets a new path every 0.3 s. Over ROS, `vsnbench robots simulate` and
`serve` run as separate processes in their own network, in real time, and movements are shorter than in simulation.

    python benchmarks/movements.py accuracy --movements 200
    python benchmarks/movements.py guard --movements 170
    python benchmarks/movements.py guard --movements 170 --continuous
    python benchmarks/movements.py accuracy ros1 --movements 50
    .venv-ros2/bin/python benchmarks/movements.py late ros2 --movements 3
    .venv-ros2/bin/python benchmarks/movements.py guard ros2 --speed 0.3 --movements 50
"""

import argparse
import json
import math
import os
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from vsnbench.protocol.execution import Execution
from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.contract import Robot
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.local_map import LocalMap
from vsnbench.runner.episode.path_guard import PathGuard
from vsnbench.sites.site import Site, StartingPosition, load_site
from vsnbench.values.movement import Drive, Move, Trajectory, Velocity, Waypoint
from vsnbench.values.pose import Pose, wrap_angle
from vsnbench.values.robot_profile import RobotProfile

HALL = Site.model_validate(
    {
        "name": "hall",
        "rooms": [{"name": "hall", "polygon": [[-25, -25], [25, -25], [25, 25], [-25, 25]]}],
        "walls": [{"start": [-25, -25], "end": [25, -25]}],
        "starts": [{"number": 1, "position": [0, 0], "heading_deg": 17}],
    }
)
ROBOTS = {"simulation": "turtlebot2", "ros1": "turtlebot2", "ros2": "turtlebot4"}
SPEEDS_M_S = (0.2, 0.3, 0.5)
_LATE_S, _LATE_ANSWERS = 1.0, 9
_WAVE_M, _AMPLITUDE_M = 2.4, 0.3
"""Of `late`: time from image to effect, answers, and the curve that is meant."""
_ANSWER_S, _CHANGES_ITS_MIND, _LONGEST_APPROACH_S = 0.3, 0.1, 15.0
"""Of `guard --continuous`: time between two answers, probability that one goes elsewhere, and longest approach."""
_LIVE_CAMERA = 160, 120
"""Size of the images over ROS of a robot that drives on: two cores cannot draw and send larger ones at full rate."""
REACH = {"simulation": 1.0, "ros1": 0.25, "ros2": 0.25}
"""Length of movements in `accuracy`, relative to simulation; shorter over ROS, which runs in real time."""
KINDS = ("move", "waypoint", "trajectory")
CLEARANCE_M = 0.25
"""Minimum distance of a start's centre from obstacles in `guard`: 7 cm from the shell of a Turtlebot 2."""


@contextmanager
def opened(where: str, site: Site, profile: RobotProfile, *, continuous: bool = False) -> Iterator[Robot]:
    """Yield a simulated robot, in this process or over ROS in other processes."""
    parameters = ProtocolParameters().executed(Execution()) if continuous else ProtocolParameters()
    if where == "simulation":
        yield SimulatedRobot(site, profile)
        return
    with TemporaryDirectory() as name:
        directory = Path(name)
        files = {"profile": directory / "profile.yaml", "site": directory / "site.yaml"}
        files["profile"].write_text(json.dumps(profile.model_dump(mode="json", exclude_none=True)))
        files["site"].write_text(json.dumps(site.model_dump(mode="json", exclude_none=True)))
        with network_of(where, directory, files) as environment:
            os.environ.update(environment)
            from vsnbench.robots.ros.robot import RosRobot

            robot = RosRobot(load_profile(str(files["profile"])), parameters)
            try:
                yield robot
            finally:
                robot.close()


@contextmanager
def network_of(where: str, directory: Path, files: dict[str, Path]) -> Iterator[dict[str, str]]:
    """Start the processes of a robot, and yield the environment of its network."""
    words = ["-m", "vsnbench.cli.main", "robots"]
    simulate = [*words, "simulate", str(files["profile"]), "--site", str(files["site"])]
    serve = [*words, "serve", str(files["profile"])]
    if where == "ros1":
        from tests.ros.ros1.network import live_network

        with live_network(directory) as network:
            network.start(*simulate)
            network.start(*serve)
            network.wait_for_service("/discrete_move")
            yield network.environment
        return
    from tests.processes import wait_until
    from tests.ros.ros2.graph import live_graph

    with live_graph(directory) as graph:
        graph.start(*simulate)
        node = graph.start(*serve)
        wait_until(lambda: "executing movements" in node.output, "discrete_move is up")
        yield graph.environment


def curve(chance: random.Random, points: int, step_m: float, bend_rad: float) -> Trajectory:
    """Return a trajectory with random bends."""
    heading_rad, x_m, y_m, found = 0.0, 0.0, 0.0, []
    for _ in range(points):
        heading_rad += chance.uniform(-bend_rad, bend_rad)
        x_m, y_m = x_m + step_m * math.cos(heading_rad), y_m + step_m * math.sin(heading_rad)
        found.append((x_m, y_m))
    return Trajectory(tuple(found))


def free_movement(kind: str, chance: random.Random, reach: float) -> tuple[Drive, Pose, float | None]:
    """Return a movement, its end pose, and its end heading, or None if the movement does not set one."""
    if kind == "move":
        distance_m, turn_rad = reach * chance.uniform(-1, 2), reach * chance.uniform(-6, 6)
        end = Pose(distance_m * math.cos(turn_rad), distance_m * math.sin(turn_rad))
        return Move(distance_m, turn_rad), end, turn_rad
    if kind == "waypoint":
        bearing_rad, distance_m = math.sqrt(reach) * chance.uniform(-math.pi, math.pi), reach * chance.uniform(0, 3)
        heading_rad = chance.choice([None, reach * chance.uniform(-3, 3)])
        x_m, y_m = distance_m * math.cos(bearing_rad), distance_m * math.sin(bearing_rad)
        return Waypoint(x_m, y_m, heading_rad), Pose(x_m, y_m), heading_rad
    path = curve(chance, chance.randint(2, max(2, round(10 * reach))), 0.25, 0.6)
    return path, Pose(*path.points[-1]), None


def accuracy(where: str, movements: int, kinds: tuple[str, ...]) -> None:
    """Print the largest errors of completed movements, by kind."""
    chance = random.Random(1)
    with opened(where, HALL, load_profile(ROBOTS[where])) as robot:
        for kind in kinds:
            worst_m = worst_rad = 0.0
            failures, dishonest, began_s = list[str](), 0, time.monotonic()
            for number in range(movements):
                robot.begin(HALL.starts[0], number)
                movement, end, heading_rad = free_movement(kind, chance, REACH[where])
                start = robot.locate().pose
                result = robot.drive(movement, lambda _view: "")
                if not result.completed:
                    failures.append(result.failure or result.blocked)
                    continue
                pose = robot.locate().pose.relative_to(start)
                error_m = end.distance_to(pose)
                error_rad = 0.0 if heading_rad is None else abs(wrap_angle(heading_rad - pose.heading_rad))
                worst_m, worst_rad = max(worst_m, error_m), max(worst_rad, error_rad)
                dishonest += error_m > 0.02 or error_rad > math.radians(1)
            errors = f"{worst_m * 1000:.1f} mm, {math.degrees(worst_rad):.3f}°"
            took = f"{time.monotonic() - began_s:.0f} s"
            print(
                f"{kind}: {movements} movements in {took}, {len(failures)} False, {dishonest} completed outside 2 cm "
                f"and 1°, largest error {errors} {failures}",
                flush=True,
            )


def guard(where: str, movements: int, speeds_m_s: tuple[float, ...], *, continuous: bool = False) -> None:
    """Print the end reasons of movements from random poses of the apartment, by speed."""
    site, parameters = load_site("apartment"), ProtocolParameters()
    profile = driving_on(where) if continuous else load_profile(ROBOTS[where])
    space = free_space(site, profile.base.radius_m)
    free = np.argwhere(space.clearance_m >= CLEARANCE_M)
    for speed_m_s in speeds_m_s:
        chance, began_s = random.Random(f"7 {speed_m_s}"), time.monotonic()
        speeds = profile.speeds.model_copy(update={"linear_m_s": speed_m_s})
        base = profile.base.model_copy(update={"max_linear_m_s": max(speed_m_s, profile.base.max_linear_m_s)})
        fast = profile.model_copy(update={"speeds": speeds, "base": base})
        ends = Counter[str]()
        with opened(where, site, fast, continuous=continuous) as robot:
            for number in range(movements):
                row, column = free[chance.randrange(len(free))]
                position = (float(space.x_m[row, column]), float(space.y_m[row, column]))
                heading_deg = chance.uniform(0, 360)
                robot.begin(StartingPosition(number=1, position=position, heading_deg=heading_deg), number)
                check = PathGuard(fast, parameters, LocalMap(fast, parameters.depth_guard) if continuous else None)
                if continuous:
                    ends[drive_on(robot, speed_m_s, chance, check)] += 1
                    continue
                for movement in long_movements(speed_m_s, chance):
                    result = robot.drive(movement, check)
                    if not result.completed:
                        break
                end = "touched" if result.collision else "blocked" if result.blocked else result.failure or "done"
                if result.collision:
                    print(f"touched {result.collision.touched}: {number} {position} {heading_deg:.1f} {movement}")
                ends[end] += 1
        took = f"{time.monotonic() - began_s:.0f} s"
        print(f"{speed_m_s} m/s: {movements} movements in {took}, {ends['touched']} touched; {dict(ends)}", flush=True)


def driving_on(where: str) -> RobotProfile:
    """Return the profile of a robot that drives on."""
    profile = load_profile(ROBOTS[where])
    if where == "simulation":
        return profile
    return profile.model_copy(update={"camera": profile.camera.resized(*_LIVE_CAMERA)})


def drive_on(robot: Robot, speed_m_s: float, chance: random.Random, check: PathGuard) -> str:
    """Replace the path every 0.3 s by another one from the robot's pose 0.3 s before; return how it ended."""
    first = robot.observe()
    now_s, captured = robot.now_s() or first.stamp_s, first.pose
    end_s, movements = now_s + _LONGEST_APPROACH_S, long_movements(speed_m_s, chance)
    while now_s < end_s:
        robot.follow(movements[0], captured)
        captured, now_s = robot.observe().pose, now_s + _ANSWER_S
        result = robot.advance(now_s, check)
        if chance.random() < _CHANGES_ITS_MIND:
            movements = long_movements(speed_m_s, chance)
        if result.blocked or result.collision or result.failure:
            rest = robot.come_to_rest()
            collision = result.collision or rest.collision
            if collision or not result.blocked:
                what = f"touched {collision.touched}" if collision else result.failure
                print(f"{what}: {robot.locate().pose} {movements[0]}", flush=True)
            return "touched" if collision else "blocked" if result.blocked else result.failure
    robot.come_to_rest()
    return "done"


def late(where: str, drives: int) -> None:
    """Print how far late answers lead a robot from the curve that they mean, by its true poses."""

    def wave(x_m: float) -> tuple[float, float]:
        return x_m, _AMPLITUDE_M * (1 - math.cos(math.tau * x_m / _WAVE_M))

    with opened(where, HALL, driving_on(where), continuous=True) as robot:
        for number in range(drives):
            robot.begin(HALL.starts[0], number)
            start, off_m, ages_s, ended = robot.locate().pose, list[float](), list[float](), ""
            for _ in range(_LATE_ANSWERS):
                seen = robot.observe()
                here = seen.pose
                points = (Pose(*wave(here.x_m + 0.05 * k)).relative_to(here).position for k in range(1, 31))
                answer = Trajectory(tuple(points))
                for part in range(1, 6):
                    result = robot.advance(seen.stamp_s + _LATE_S * part / 5, lambda _view: "")
                    ended = ended or result.failure or result.blocked
                    at = robot.locate().pose.relative_to(start).position
                    off_m.append(min(math.dist(at, wave(at[0] + 0.005 * k)) for k in range(-80, 81)))
                ages_s.append((robot.now_s() or seen.stamp_s + _LATE_S) - seen.stamp_s)
                robot.follow(answer, seen.pose)
            driven_m = robot.locate().pose.distance_to(start)
            robot.come_to_rest()
            print(
                f"{where}: answers {min(ages_s):.2f} to {max(ages_s):.2f} s old, {driven_m:.2f} m from the start; "
                f"at most {max(off_m) * 1000:.0f} mm from the curve, mean {np.mean(off_m) * 1000:.0f} mm"
                f"{f'; ended: {ended}' if ended else ''}",
                flush=True,
            )


def long_movements(speed_m_s: float, chance: random.Random) -> list[Drive]:
    """Return movements of about 3 m ahead: a waypoint, a trajectory, or velocities."""
    kind = chance.choice(["waypoint", "trajectory", "velocity"])
    if kind == "waypoint":
        bearing_rad = chance.uniform(-0.8, 0.8)
        return [Waypoint(3 * math.cos(bearing_rad), 3 * math.sin(bearing_rad))]
    if kind == "trajectory":
        return [curve(chance, 10, 0.3, 0.25)]
    return [Velocity(speed_m_s, chance.uniform(-0.5, 0.5), 2.0) for _ in range(6)]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["accuracy", "late", "guard"])
    parser.add_argument("where", choices=ROBOTS, nargs="?", default="simulation")
    parser.add_argument("--movements", type=int, default=200)
    parser.add_argument("--speed", type=float, choices=SPEEDS_M_S, help="speed in m/s for `guard`; required over ROS")
    parser.add_argument("--continuous", action="store_true", help="drive on with a new path every 0.3 s, for `guard`")
    parser.add_argument("--kind", choices=KINDS, help="kind of movement for `accuracy`; default: all")
    given = parser.parse_args()
    if given.what == "accuracy":
        accuracy(given.where, given.movements, (given.kind,) if given.kind else KINDS)
    elif given.what == "late":
        late(given.where, given.movements)
    elif given.where != "simulation" and given.speed is None:
        parser.error("guard over ROS needs --speed")
    else:
        speeds = (given.speed,) if given.speed else SPEEDS_M_S
        guard(given.where, given.movements, speeds, continuous=given.continuous)
