"""Actions as they are counted and recorded: the discrete ones of the paper (Section 3.1.3), and movements."""

from enum import StrEnum


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
    """Action of a policy; only some models have MOVE_BACKWARD."""

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
    """This and the five before it have parameters: see `vsnbench.values.movement`."""
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


def can_replace(tilt: object, replacement: object) -> bool:
    """Return whether a card may replace one action by another: a tilt by what a robot does, except STOP."""
    if not isinstance(tilt, Action) or not isinstance(replacement, Action):
        return False
    return tilt in TILTS and (replacement is Action.NOOP or replacement.moves)
