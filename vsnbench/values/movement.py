"""Movements with parameters: what a model can answer instead of a discrete action.

Poses are in the robot's frame at the observation (REP-103: x forward, y left, headings counter-clockwise); metres,
radians, seconds. Limits keep one movement within what a depth image of a room can show.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from itertools import pairwise
from typing import Any, Final, get_args

from vsnbench.errors import DecisionError
from vsnbench.settings.number_errors import other_unit
from vsnbench.values.action import Action, ActionKind
from vsnbench.values.pose import Pose

MAX_DISTANCE_M: Final = 5.0
"""Maximum distance of a move, a sidestep or a waypoint, and between points of a trajectory."""
MAX_PATH_M: Final = 10.0
"""Maximum length of a trajectory."""
MAX_POINTS: Final = 100
"""Maximum number of points of a trajectory."""
MAX_DURATION_S: Final = 2.0
"""Maximum duration of a velocity."""
MAX_PARTS: Final = 50
"""Maximum number of parts of a chunk."""
_MAX_SPEED: Final = 10.0
"""Above what any base can do, m/s or rad/s; the robot's own limits are checked when the robot is known."""
_MIN_DURATION_S: Final = 0.05
_MAX_PIXEL: Final = 4096.0


@dataclass(frozen=True, slots=True)
class Move:
    """Turn on the spot, then drive straight."""

    distance_m: float = 0.0
    """Forward; negative drives backwards."""
    turn_rad: float = 0.0
    """Counter-clockwise; from -2 pi to 2 pi."""
    holds_heading: bool = False
    """Whether headings are relative to the target of the last such move, not to the measured heading, so that errors of
    turns do not add up. Only the actions of the paper do: see `ProtocolParameters.movement_of`.
    """


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Drive to a point."""

    x_m: float
    y_m: float
    heading_rad: float | None = None
    """Heading at the end, relative to the heading at the observation; None for any."""


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Drive along a polyline from the robot through `points` to the last of them."""

    points: tuple[tuple[float, float], ...]
    """(x, y) each; the robot's own position is not listed."""

    @property
    def length_m(self) -> float:
        """Length of the polyline from the robot."""
        return sum(math.dist(a, b) for a, b in pairwise(((0.0, 0.0), *self.points)))


@dataclass(frozen=True, slots=True)
class Velocity:
    """Drive with a constant velocity, then stop."""

    linear_m_s: float = 0.0
    angular_rad_s: float = 0.0
    duration_s: float = 1.0
    """At most `MAX_DURATION_S`."""
    lateral_m_s: float = 0.0
    """To the left, on a base that can: see `Base.max_lateral_m_s`."""

    @property
    def speed_m_s(self) -> float:
        """Speed over the floor, not negative."""
        return math.hypot(self.linear_m_s, self.lateral_m_s) if self.lateral_m_s else abs(self.linear_m_s)


@dataclass(frozen=True, slots=True)
class Sidestep:
    """Move to the side without turning, on a base that can: see `Base.max_lateral_m_s`."""

    left_m: float
    """To the left; negative is to the right."""


@dataclass(frozen=True, slots=True)
class Pixel:
    """Drive to the point of the floor plan that a pixel of the camera image shows."""

    u: float
    """Column from the left, pixels; 0 is the centre of the first."""
    v: float
    """Row from the top, pixels."""


Drive = Move | Waypoint | Trajectory | Velocity | Sidestep
"""A movement that a robot executes."""
Movement = Drive | Pixel


@dataclass(frozen=True, slots=True)
class Chunk:
    """Several actions in order; each is guarded, recorded and counted on its own."""

    parts: tuple[Action | Movement, ...]


KIND_OF: Final[Mapping[type, ActionKind]] = {
    Move: ActionKind.MOVE,
    Waypoint: ActionKind.WAYPOINT,
    Trajectory: ActionKind.TRAJECTORY,
    Velocity: ActionKind.VELOCITY,
    Pixel: ActionKind.PIXEL,
    Sidestep: ActionKind.SIDESTEP,
    Chunk: ActionKind.CHUNK,
}
_CLASS_OF: Final[Mapping[str, type[Movement]]] = {KIND_OF[made].value: made for made in get_args(Movement)}
DRIVE_KINDS: Final = frozenset({ActionKind.MOVE, ActionKind.WAYPOINT, ActionKind.TRAJECTORY, ActionKind.VELOCITY})
"""Kinds that every base executes as one movement; some bases also execute SIDESTEP, see `RobotProfile.drive_kinds`."""
ADAPTER_KINDS: Final = DRIVE_KINDS | {ActionKind.SIDESTEP}


def action_of(movement: Movement) -> Action:
    """Return the action that counts and records a movement."""
    return Action(KIND_OF[type(movement)].name)


def holds_heading(movement: Movement) -> bool:
    """Return whether a movement is an action of the paper, with the sizes of a protocol."""
    return isinstance(movement, Move) and movement.holds_heading


def end_of(movement: Drive) -> Pose | None:
    """Return the pose at the end in the robot's frame; None for a velocity."""
    match movement:
        case Move(distance_m, turn_rad):
            return Pose(distance_m * math.cos(turn_rad), distance_m * math.sin(turn_rad), turn_rad)
        case Waypoint(x_m, y_m, heading_rad):
            return Pose(x_m, y_m, heading_rad or 0.0)
        case Trajectory(points):
            return Pose(*points[-1])
        case Sidestep(left_m):
            return Pose(0.0, left_m)
        case Velocity():
            return None


def reach_m(movement: Drive) -> float:
    """Return the largest distance from the robot's position on the way."""
    match movement:
        case Move(way_m) | Sidestep(way_m):
            return abs(way_m)
        case Waypoint(x_m, y_m):
            return math.hypot(x_m, y_m)
        case Trajectory(points):
            return max(math.hypot(*point) for point in points)
        case Velocity():
            return movement.speed_m_s * movement.duration_s


def ahead(movement: Drive) -> float:
    """Return a positive number if the robot drives forwards, where its camera looks; negative backwards, else 0.

    A point behind the robot is reached forwards, after a turn.
    """
    match movement:
        case Move(distance_m):
            return distance_m
        case Velocity(linear_m_s):
            return linear_m_s
        case Sidestep():
            return 0.0
    return 1.0


def fixes_heading(movement: Drive) -> bool:
    """Return whether a movement prescribes the heading at its end, that of `end_of`."""
    return not isinstance(movement, Trajectory | Velocity) and not (
        isinstance(movement, Waypoint) and movement.heading_rad is None
    )


def goes_sideways(movement: Drive) -> bool:
    """Return whether only a base with `max_lateral_m_s` executes a movement."""
    return isinstance(movement, Sidestep) or (isinstance(movement, Velocity) and movement.lateral_m_s != 0.0)


def is_watched(movement: Drive) -> bool:
    """Return whether a camera that looks ahead shows the way: not if the robot goes straight to the side."""
    return not goes_sideways(movement) or ahead(movement) > 0


def movement_text(movement: Movement) -> str:
    """Return a short description, such as `to (1.20, -0.30) m`."""
    match movement:
        case Move(distance_m, turn_rad, True):
            return _preset_text(distance_m, turn_rad)
        case Move(distance_m, turn_rad):
            return f"turn {math.degrees(turn_rad):.0f}°, drive {distance_m:.2f} m"
        case Waypoint(x_m, y_m, heading_rad):
            facing = "" if heading_rad is None else f", {math.degrees(heading_rad):.0f}°"
            return f"to ({x_m:.2f}, {y_m:.2f}) m{facing}"
        case Trajectory(points):
            return f"along {len(points)} points, {movement.length_m:.2f} m"
        case Velocity(linear_m_s, angular_rad_s, duration_s, lateral_m_s):
            side = "left" if lateral_m_s >= 0 else "right"
            aside = f", {abs(lateral_m_s):.2f} m/s to the {side}" if lateral_m_s else ""
            return f"{linear_m_s:.2f} m/s{aside}, {math.degrees(angular_rad_s):.0f}°/s for {duration_s:.1f} s"
        case Sidestep(left_m):
            return f"{abs(left_m):.2f} m to the {'left' if left_m >= 0 else 'right'}"
        case Pixel(u, v):
            return f"to pixel ({u:.0f}, {v:.0f})"
        case _:
            raise TypeError(f"not a movement: {movement!r}")


def _preset_text(distance_m: float, turn_rad: float) -> str:
    """Return an action of the paper in words, such as `turn left by 30°`."""
    if turn_rad:
        return f"turn {'left' if turn_rad > 0 else 'right'} by {abs(math.degrees(turn_rad)):g}°"
    if distance_m:
        return f"move {'forward' if distance_m > 0 else 'backward'} by {abs(distance_m):g} m"
    return "stop"


STOP: Final = Move(holds_heading=True)
"""The movement of the action STOP."""
_OMITTED: Final[Mapping[str, object]] = {"heading_rad": None, "holds_heading": False, "lateral_m_s": 0.0}
"""Defaults that are left out of the JSON of a movement."""


def movement_to_json(movement: Movement) -> dict[str, Any]:
    """Return a movement as JSON values with its `kind`, for the record and the wire."""
    content = {name: value for name, value in asdict(movement).items() if _OMITTED.get(name, ...) != value}
    if isinstance(movement, Trajectory):
        content["points"] = [list(point) for point in movement.points]
    return {"kind": KIND_OF[type(movement)].value, **content}


def movement_from_json(content: Mapping[str, Any]) -> Movement:
    """Return the movement of `movement_to_json`; unknown keys are ignored.

    Raises:
        ValueError: the content is not a movement, or a number of it is not finite.
    """
    try:
        made = _CLASS_OF[content["kind"]]
        if made is Trajectory:
            return Trajectory(tuple((_finite(x), _finite(y)) for x, y in content["points"]))
        if made is Move and content.get("holds_heading") is True:
            return Move(_finite(content["distance_m"]), _finite(content["turn_rad"]), holds_heading=True)
        names = [item.name for item in fields(made) if content.get(item.name) is not None]
        numbers = {name: _finite(content[name]) for name in names if name != "holds_heading"}
        return made(**numbers)  # type: ignore[arg-type]  # the names are the class's
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"not a movement: {error}") from error


def _finite(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{number} is not a finite number")
    return number


def checked_movement(given: object) -> Movement:
    """Return a validated copy of a movement, which does not hold headings: only the robot's own actions do.

    Raises:
        DecisionError: it is not a movement, or a number is not finite or beyond its limit.
    """
    match given:
        case Move():
            distance_m = _bounded(given.distance_m, "move.distance_m", MAX_DISTANCE_M)
            return Move(distance_m, _bounded(given.turn_rad, "move.turn_rad", math.tau))
        case Waypoint():
            x_m, y_m = _point((given.x_m, given.y_m), "waypoint")
            if (away_m := math.hypot(x_m, y_m)) > MAX_DISTANCE_M:
                far = f"a waypoint must be at most {MAX_DISTANCE_M:g} m away, got {away_m:.4g} m"
                raise DecisionError(far, advice=other_unit("_m", away_m, MAX_DISTANCE_M))
            if given.heading_rad is None:
                return Waypoint(x_m, y_m)
            return Waypoint(x_m, y_m, _bounded(given.heading_rad, "waypoint.heading_rad", math.tau))
        case Trajectory():
            return _trajectory(given)
        case Velocity():
            duration_s = _finite_in(given.duration_s, "velocity.duration_s")
            if not _MIN_DURATION_S <= duration_s <= MAX_DURATION_S:
                limits = f"{_MIN_DURATION_S:g} to {MAX_DURATION_S:g} s"
                raise DecisionError(f"velocity.duration_s must be {limits}, got {duration_s:.6g}")
            linear_m_s = _bounded(given.linear_m_s, "velocity.linear_m_s", _MAX_SPEED)
            angular_rad_s = _bounded(given.angular_rad_s, "velocity.angular_rad_s", _MAX_SPEED)
            lateral_m_s = _bounded(given.lateral_m_s, "velocity.lateral_m_s", _MAX_SPEED)
            return Velocity(linear_m_s, angular_rad_s, duration_s, lateral_m_s)
        case Sidestep():
            return Sidestep(_bounded(given.left_m, "sidestep.left_m", MAX_DISTANCE_M))
        case Pixel():
            return Pixel(_bounded(given.u, "pixel.u", _MAX_PIXEL), _bounded(given.v, "pixel.v", _MAX_PIXEL))
    example = "use Waypoint(1.0, 0.0), for example"
    raise DecisionError(f"expected a movement, got {type(given).__name__}", advice=example)


def _trajectory(given: Trajectory) -> Trajectory:
    if not isinstance(given.points, tuple | list):
        raise DecisionError(f"trajectory.points must be a list of (x, y), got {type(given.points).__name__}")
    if not 2 <= len(given.points) <= MAX_POINTS:
        raise DecisionError(f"a trajectory must have 2 to {MAX_POINTS} points, got {len(given.points)}")
    checked = Trajectory(tuple(_point(point, f"trajectory.points[{k}]") for k, point in enumerate(given.points)))
    if checked.length_m > MAX_PATH_M:
        long = f"a trajectory must be at most {MAX_PATH_M:g} m long, got {checked.length_m:.4g} m"
        raise DecisionError(long, advice=other_unit("_m", checked.length_m, MAX_PATH_M))
    return checked


def _point(value: Any, what: str) -> tuple[float, float]:
    try:
        x_m, y_m = value
    except (TypeError, ValueError):
        raise DecisionError(f"{what} must be a point (x, y)") from None
    return _finite_in(x_m, f"{what}.x_m"), _finite_in(y_m, f"{what}.y_m")


def _bounded(value: Any, what: str, most: float) -> float:
    number = _finite_in(value, what)
    if abs(number) > most:
        limits = f"{what} must be between -{most:.4g} and {most:.4g}, got {number:.6g}"
        raise DecisionError(limits, advice=other_unit(what, abs(number), most))
    return number


def _finite_in(value: Any, what: str) -> float:
    try:
        if not isinstance(value, str | bytes | bytearray) and math.isfinite(number := float(value)):
            return number
    except (TypeError, ValueError, OverflowError):
        pass
    raise DecisionError(f"{what} must be a finite number, got {str(value)[:40]}")
