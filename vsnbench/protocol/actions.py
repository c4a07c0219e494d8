"""The discrete actions of the protocol (paper, Section 3.1.3)."""

from enum import StrEnum


class Action(StrEnum):
    """What a policy can ask of a robot; MOVE_BACKWARD only where the model has it."""

    STOP = "STOP"
    MOVE_FORWARD = "MOVE_FORWARD"
    TURN_LEFT = "TURN_LEFT"
    TURN_RIGHT = "TURN_RIGHT"
    MOVE_BACKWARD = "MOVE_BACKWARD"

    @property
    def translates(self) -> bool:
        """Whether the robot is asked to change its position."""
        return self in (Action.MOVE_FORWARD, Action.MOVE_BACKWARD)

    @property
    def turns(self) -> bool:
        """Whether the robot is asked to change its heading."""
        return self in (Action.TURN_LEFT, Action.TURN_RIGHT)
