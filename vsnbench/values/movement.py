"""What a model can answer: the discrete actions of the paper (Section 3.1.3), and movements with parameters.

A kind of movement is a class here, with its names in `ActionKind` and `Action`. The class declares its parameters and
its behaviour. Its check, JSON, schema and documentation are derived from it. `control/legs.py` plans how it is driven.

Poses are in the robot's frame at the observation (REP-103: x forward, y left, headings counter-clockwise); metres,
radians, seconds. Limits keep one movement within what a depth image of a room can show.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Annotated, ClassVar, Final, get_args

from vsnbench.values.movement_base import MovementBase, Parameter, Points, require_length
from vsnbench.values.pose import Pose

MAX_DISTANCE_M: Final = 5.0
"""Maximum distance of a move, a sidestep or a waypoint, and between points of a trajectory."""
MAX_PATH_M: Final = 10.0
"""Maximum length of a trajectory."""
MAX_PARTS: Final = 50
"""Maximum number of parts of a chunk."""
_MAX_SPEED: Final = 10.0
"""Above what any base can do, m/s or rad/s; the robot's own limits are checked when the robot is known."""
_MAX_PIXEL: Final = 4096.0


class ActionKind(StrEnum):
    """Kind of a model's answer."""

    DISCRETE = "discrete"
    MOVE = "move"
    CHUNK = "chunk"
    WAYPOINT = "waypoint"
    TRAJECTORY = "trajectory"
    VELOCITY = "velocity"
    PIXEL = "pixel"
    SIDESTEP = "sidestep"


class Action(StrEnum):
    """Action of a policy, as it is counted and recorded; only some models have MOVE_BACKWARD."""

    STOP = "STOP"
    MOVE_FORWARD = "MOVE_FORWARD"
    TURN_LEFT = "TURN_LEFT"
    TURN_RIGHT = "TURN_RIGHT"
    MOVE_BACKWARD = "MOVE_BACKWARD"
    NOOP = "NOOP"
    """An action that this robot cannot do, such as LOOK_UP: counted and recorded, but not sent to the robot."""
    MOVE = "MOVE"
    WAYPOINT = "WAYPOINT"
    TRAJECTORY = "TRAJECTORY"
    VELOCITY = "VELOCITY"
    PIXEL = "PIXEL"
    SIDESTEP = "SIDESTEP"
    """This and the five before it have parameters: they are the kinds of movements."""
    LOOK_UP = "LOOK_UP"
    LOOK_DOWN = "LOOK_DOWN"
    """No robot executes this and the one before it: the model's card states what replaces them. Never recorded as
    the action, only as the model's own name for it."""

    @property
    def has_parameters(self) -> bool:
        """Whether a movement gives its parameters."""
        return self in _WITH_PARAMETERS

    @property
    def moves(self) -> bool:
        """Whether the robot should move or turn."""
        return self.translates or self.turns

    @property
    def translates(self) -> bool:
        """Whether the robot should change its position."""
        return self in (Action.MOVE_FORWARD, Action.MOVE_BACKWARD)

    @property
    def turns(self) -> bool:
        """Whether the robot should change its heading."""
        return self in (Action.TURN_LEFT, Action.TURN_RIGHT)


_WITH_PARAMETERS = frozenset(action for action in Action if action.name in ActionKind.__members__)
TILTS = frozenset({Action.LOOK_UP, Action.LOOK_DOWN})
"""Actions of a camera that tilts."""
DISCRETE_ACTIONS = tuple(action for action in Action if action not in _WITH_PARAMETERS)
"""Actions without parameters."""


@dataclass(frozen=True, slots=True)
class Move(MovementBase):
    """Turn on the spot, then drive straight."""

    kind: ClassVar = ActionKind.MOVE
    fixes_heading = True

    distance_m: Annotated[float, Parameter("forward; negative drives backwards", MAX_DISTANCE_M)] = 0.0
    turn_rad: Annotated[float, Parameter("counter-clockwise, before it drives", math.tau)] = 0.0
    holds_heading: Annotated[
        bool, Parameter("headings are relative to the target of the last such move", absent="if not", is_internal=True)
    ] = False
    """Instead of the measured heading, so that errors of turns do not add up. Only the actions of the paper do so: see
    `ProtocolParameters.movement_of`.
    """

    @property
    def end(self) -> Pose:
        """The pose at the end."""
        return Pose(self.distance_m * math.cos(self.turn_rad), self.distance_m * math.sin(self.turn_rad), self.turn_rad)

    @property
    def ahead(self) -> float:
        """The distance, negative backwards."""
        return self.distance_m

    @property
    def text(self) -> str:
        """The movement in words: an action of the paper is `turn left by 30°`, for example."""
        if not self.holds_heading:
            return f"turn {math.degrees(self.turn_rad):.0f}°, drive {self.distance_m:.2f} m"
        if self.turn_rad:
            return f"turn {'left' if self.turn_rad > 0 else 'right'} by {abs(math.degrees(self.turn_rad)):g}°"
        if self.distance_m:
            return f"move {'forward' if self.distance_m > 0 else 'backward'} by {abs(self.distance_m):g} m"
        return "stop"


@dataclass(frozen=True, slots=True)
class Waypoint(MovementBase):
    """Drive to a point."""

    kind: ClassVar = ActionKind.WAYPOINT
    limit = f"at most {MAX_DISTANCE_M:g} m away"
    replaces_path = True

    x_m: Annotated[float, Parameter("forward")]
    y_m: Annotated[float, Parameter("left")]
    heading_rad: Annotated[float | None, Parameter("heading at the end", math.tau, absent="for any")] = None

    def check(self) -> None:
        """Check the distance."""
        require_length(self.reach_m, MAX_DISTANCE_M, f"a waypoint must be {self.limit}")

    @property
    def end(self) -> Pose:
        """The point, and the heading if there is one."""
        return Pose(self.x_m, self.y_m, self.heading_rad or 0.0)

    @property
    def fixes_heading(self) -> bool:
        """Whether there is a heading."""
        return self.heading_rad is not None

    @property
    def text(self) -> str:
        """The movement in words, such as `to (1.20, -0.30) m`."""
        facing = "" if self.heading_rad is None else f", {math.degrees(self.heading_rad):.0f}°"
        return f"to ({self.x_m:.2f}, {self.y_m:.2f}) m{facing}"


@dataclass(frozen=True, slots=True)
class Trajectory(MovementBase):
    """Drive along a polyline from the robot through `points` to the last of them, without a stop."""

    kind: ClassVar = ActionKind.TRAJECTORY
    limit = f"at most {MAX_PATH_M:g} m long"
    replaces_path = True
    is_straight = False

    points: Annotated[Points, Parameter("(x forward, y left) each, without the robot's own position", 100, least=2)]

    def check(self) -> None:
        """Check the length."""
        require_length(self.length_m, MAX_PATH_M, f"a trajectory must be {self.limit}")

    @property
    def length_m(self) -> float:
        """Length of the polyline from the robot."""
        return sum(math.dist(a, b) for a, b in pairwise(((0.0, 0.0), *self.points)))

    @property
    def end(self) -> Pose:
        """The last point."""
        return Pose(*self.points[-1])

    @property
    def reach_m(self) -> float:
        """The largest distance of a point."""
        return max(math.hypot(*point) for point in self.points)

    @property
    def text(self) -> str:
        """The movement in words."""
        return f"along {len(self.points)} points, {self.length_m:.2f} m"


@dataclass(frozen=True, slots=True)
class Velocity(MovementBase):
    """Drive with a constant velocity within the speeds of the base, then stop."""

    kind: ClassVar = ActionKind.VELOCITY
    replaces_path = True

    linear_m_s: Annotated[float, Parameter("forward", _MAX_SPEED)] = 0.0
    angular_rad_s: Annotated[float, Parameter("counter-clockwise", _MAX_SPEED)] = 0.0
    duration_s: Annotated[float, Parameter("duration, ramps included", 2.0, least=0.05)] = 1.0
    lateral_m_s: Annotated[
        float, Parameter("to the left, on a base with `max_lateral_m_s`", _MAX_SPEED, absent="for 0")
    ] = 0.0

    @property
    def speed_m_s(self) -> float:
        """Speed over the floor, not negative."""
        return math.hypot(self.linear_m_s, self.lateral_m_s) if self.lateral_m_s else abs(self.linear_m_s)

    @property
    def reach_m(self) -> float:
        """The length of the way without ramps."""
        return self.speed_m_s * self.duration_s

    @property
    def ahead(self) -> float:
        """The part that is forwards."""
        return self.linear_m_s

    @property
    def goes_sideways(self) -> bool:
        """Whether there is a part to the side."""
        return self.lateral_m_s != 0.0

    @property
    def text(self) -> str:
        """The movement in words."""
        side = "left" if self.lateral_m_s >= 0 else "right"
        aside = f", {abs(self.lateral_m_s):.2f} m/s to the {side}" if self.lateral_m_s else ""
        return (
            f"{self.linear_m_s:.2f} m/s{aside}, {math.degrees(self.angular_rad_s):.0f}°/s for {self.duration_s:.1f} s"
        )


@dataclass(frozen=True, slots=True)
class Sidestep(MovementBase):
    """Move to the side without turning, on a base with `max_lateral_m_s`."""

    kind: ClassVar = ActionKind.SIDESTEP
    ahead = 0.0
    fixes_heading = True
    goes_sideways = True

    left_m: Annotated[float, Parameter("to the left; negative to the right", MAX_DISTANCE_M)]

    @property
    def end(self) -> Pose:
        """The point beside the robot."""
        return Pose(0.0, self.left_m)

    @property
    def text(self) -> str:
        """The movement in words."""
        return f"{abs(self.left_m):.2f} m to the {'left' if self.left_m >= 0 else 'right'}"


@dataclass(frozen=True, slots=True)
class Pixel(MovementBase):
    """Drive to the point of the floor plan that a pixel of the camera image shows, by its depth; at most 5 m."""

    kind: ClassVar = ActionKind.PIXEL
    replaces_path = True

    u: Annotated[float, Parameter("column in pixels from the left; 0 is the centre of the first", _MAX_PIXEL)]
    v: Annotated[float, Parameter("row in pixels from the top", _MAX_PIXEL)]

    @property
    def text(self) -> str:
        """The movement in words."""
        return f"to pixel ({self.u:.0f}, {self.v:.0f})"


Drive = Move | Waypoint | Trajectory | Velocity | Sidestep
"""A movement that a robot executes."""
Movement = Drive | Pixel


@dataclass(frozen=True, slots=True)
class Chunk:
    """Several actions in order; each is guarded, recorded and counted on its own."""

    parts: tuple[Action | Movement, ...]


ADAPTER_KINDS: Final[frozenset[ActionKind]] = frozenset(made.kind for made in get_args(Drive))
"""Kinds that a robot executes as one movement."""
DRIVE_KINDS: Final = ADAPTER_KINDS - {ActionKind.SIDESTEP}
"""Those that every base executes; see `RobotProfile.drive_kinds`."""
STOP: Final = Move(holds_heading=True)
"""The movement of the action STOP."""


def action_of(movement: Movement) -> Action:
    """Return the action that counts and records a movement."""
    return Action(movement.kind.name)
