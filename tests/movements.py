"""The actions of the paper as movements, with the sizes of the default protocol."""

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.values.movement import Action, Drive

movement_of = ProtocolParameters().movement_of
FORWARD, BACKWARD = movement_of(Action.MOVE_FORWARD), movement_of(Action.MOVE_BACKWARD)
LEFT, RIGHT = movement_of(Action.TURN_LEFT), movement_of(Action.TURN_RIGHT)
ACTION_OF: dict[Drive, Action] = {
    movement_of(action): action
    for action in (Action.STOP, Action.MOVE_FORWARD, Action.MOVE_BACKWARD, Action.TURN_LEFT, Action.TURN_RIGHT)
}
