"""Movements for a robot that takes velocities and measures its pose: turns on the spot and straight lines.

The control is simple: proportional, with a least speed. It reaches about 1 cm and 0.5° on a base that follows at once;
state the tolerances that yours reaches in its profile.
"""

import importlib
import math
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator

PERIOD_S = 0.02
GAIN = 2.0


STOPPED = {"completed": False, "refusal": "stopped", "failure": "the client is gone, or asked to stop"}


class Base(ABC):
    """What an adapter needs of a robot. Poses are (x, y, heading): metres, radians, REP-103."""

    card: dict
    gone_s = 0.6
    """Time without a message of the client after which the robot stops."""
    linear_m_s, angular_rad_s = 0.3, 0.5
    """Cruising speeds."""
    least_m_s, least_rad_s = 0.02, 0.05
    """Slowest commands that move the base."""
    near_m, near_rad = 0.004, math.radians(0.2)
    """Distances from the end at which the base is stopped: what it rolls on at the least speed, or half a tolerance."""
    settle_s = 0.1
    """Time between two poses whose equality says that the base is at rest."""

    @property
    def now_s(self) -> float:
        """Time on the robot's clock, seconds. Default: this machine's."""
        return time.monotonic()

    @property
    @abstractmethod
    def pose(self) -> tuple[float, float, float] | None:
        """Newest odometry; None before the first."""

    @abstractmethod
    def send(self, forward_m_s: float, turn_rad_s: float) -> str:
        """Command a velocity, wait PERIOD_S; return a word of docs/motion-adapter.md if the robot cannot drive on."""

    @abstractmethod
    def stop(self) -> None:
        """Stand still."""

    @property
    def missing(self) -> str:
        """What keeps the robot from moving, or an empty string."""
        return "" if self.pose else "no odometry received yet"

    def state(self, *, with_depth: bool = False) -> dict:
        """Return the keys of a `state` message."""
        return {"pose": list(self.pose), "stamp_s": self.now_s}

    def colours(self) -> dict:
        """Return a new image as an `rgb` map."""
        raise NotImplementedError

    def place(self, pose: list[float], seed: int) -> str:
        """Put a simulated robot at a pose; return why it cannot be there, or an empty string."""
        return "this robot is not simulated"

    def execute(self, movement: dict, deadline_s: float) -> Iterator[None]:
        """Execute a movement, a period in each step, and stop the robot at any end; return the keys of `done`."""
        if self.missing:
            return {"completed": False, "refusal": "sensor", "failure": self.missing}
        give_up_s = self.now_s + deadline_s
        try:
            for forward_m_s, turn_rad_s in _velocities(self, movement):
                if self.now_s > give_up_s:
                    return {"completed": False, "refusal": "deadline", "failure": f"not done after {deadline_s:.1f} s"}
                if word := self.send(forward_m_s, turn_rad_s):
                    return {"completed": False, "refusal": word, "failure": f"the base reports: {word}"}
                yield
        except _RefusedError as error:
            return {"completed": False, "refusal": "unsupported", "failure": str(error)}
        finally:
            self.stop()
        return {"completed": True}


class _RefusedError(Exception):
    """The robot cannot drive on; the word says why."""


class Movement:
    """The movement that a robot executes, one at a time.

    Attributes:
        request: the message `drive`.
        ended: the keys of `done`; None while it runs.
    """

    def __init__(self, robot) -> None:
        self._robot, self._steps, self.request, self.ended = robot, None, {}, STOPPED

    @property
    def runs(self) -> bool:
        """Whether it has begun and not ended."""
        return self.ended is None

    def begin(self, request: dict) -> None:
        """Begin a movement instead of the running one; the robot moves in `go_on`."""
        self.stop()
        self._steps = self._robot.execute(request["movement"], request["deadline_s"])
        self.request, self.ended = request, None

    def go_on(self, duration_s: float) -> None:
        """Continue for a time on the robot's clock, at least one step."""
        until_s = self._robot.now_s + duration_s
        try:
            while True:
                next(self._steps)
                if self._robot.now_s >= until_s:
                    return
        except StopIteration as end:
            self.ended = end.value

    def stop(self) -> None:
        """End it, and stop the robot; nothing if it has ended."""
        if self.runs:
            self._steps.close()
            self.ended = STOPPED


def robot_of_command_line(*arguments: object) -> object:
    """Return the robot that `module:Class ARGUMENT...` on the command line names, made with further arguments first."""
    module, _, name = sys.argv[1].partition(":")
    return getattr(importlib.import_module(module), name)(*arguments, *sys.argv[2:])


def _velocities(base: Base, movement: dict) -> Iterator[tuple[float, float]]:
    """Yield velocities until the movement is done, each for a period."""
    start = base.pose
    match movement["kind"]:
        case "move":
            turn_rad = movement.get("turn_rad", 0.0)
            yield from _turned(base, turn_rad)
            heading = start[2] + turn_rad
            way_m = movement.get("distance_m", 0.0)
            yield from _straight(base, (math.cos(heading) * way_m, math.sin(heading) * way_m), way_m < 0)
        case "waypoint":
            yield from _to(base, _point(start, movement["x_m"], movement["y_m"]))
            if movement.get("heading_rad") is not None:
                heading = start[2] + movement["heading_rad"]
                yield from _turned(base, math.remainder(heading - base.pose[2], math.tau))
        case "trajectory":
            for point in [_point(start, *point) for point in movement["points"]]:
                yield from _to(base, point)
        case "velocity" if movement.get("lateral_m_s"):
            raise _RefusedError("this robot does not move sideways")
        case "velocity":
            until_s = base.now_s + movement.get("duration_s", 1.0)
            while base.now_s < until_s:
                yield movement.get("linear_m_s", 0.0), movement.get("angular_rad_s", 0.0)
        case kind:
            raise _RefusedError(f"this robot has no {kind}")


def _point(start: tuple[float, float, float], x_m: float, y_m: float) -> tuple[float, float]:
    """Return a point of the robot's frame at the start in the frame of the odometry."""
    x, y, heading = start
    return (
        x + math.cos(heading) * x_m - math.sin(heading) * y_m,
        y + math.sin(heading) * x_m + math.cos(heading) * y_m,
    )


def _to(base: Base, point: tuple[float, float]) -> Iterator[tuple[float, float]]:
    x, y, heading = base.pose
    way = point[0] - x, point[1] - y
    if math.hypot(*way) > base.near_m:
        yield from _turned(base, math.remainder(math.atan2(way[1], way[0]) - heading, math.tau))
        x, y, _ = base.pose
        yield from _straight(base, (point[0] - x, point[1] - y))


def _turned(base: Base, left: float) -> Iterator[tuple[float, float]]:
    """Turn on the spot by an angle; more than half a turn keeps its side."""
    last = base.pose[2]
    while abs(left) > base.near_rad:
        yield 0.0, _limited(GAIN * left, base.least_rad_s, base.angular_rad_s)
        turned = math.remainder(base.pose[2] - last, math.tau)
        last, left = base.pose[2], left - turned
    yield from _at_rest(base)


def _straight(base: Base, way: tuple[float, float], backwards: bool = False) -> Iterator[tuple[float, float]]:
    """Drive along a vector of the odometry's frame, and hold its direction."""
    length_m = math.hypot(*way)
    if length_m == 0:
        return
    sign, (x0, y0, _) = -1.0 if backwards else 1.0, base.pose
    along = way[0] / length_m, way[1] / length_m
    heading = math.atan2(sign * way[1], sign * way[0])
    while True:
        x, y, now = base.pose
        left_m = length_m - (x - x0) * along[0] - (y - y0) * along[1]
        if left_m < base.near_m:
            break
        aside_m = -(x - x0) * along[1] + (y - y0) * along[0]
        turn = GAIN * math.remainder(heading - now, math.tau) - sign * GAIN * aside_m
        yield sign * _limited(GAIN * left_m, base.least_m_s, base.linear_m_s), max(-0.3, min(0.3, turn))
    yield from _at_rest(base)


def _at_rest(base: Base) -> Iterator[tuple[float, float]]:
    """Stand until the pose repeats: a base with a lag rolls on."""
    give_up_s = base.now_s + 2.0
    while base.now_s < give_up_s:
        (x, y, heading), until_s = base.pose, base.now_s + base.settle_s
        while base.now_s < until_s:
            yield 0.0, 0.0
        now = base.pose
        if math.dist(now[:2], (x, y)) < 0.001 and abs(math.remainder(now[2] - heading, math.tau)) < 0.002:
            return


def _limited(speed: float, least: float, most: float) -> float:
    return math.copysign(max(least, min(abs(speed), most)), speed)
