"""Checks that a model and a robot fit a protocol in which the robot drives on while the model thinks."""

from vsnbench.errors import UsageError
from vsnbench.protocol.disturbances import Disturbances
from vsnbench.protocol.execution import KINDS_WHILE_DRIVING
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.contract import Robot
from vsnbench.values.model.card import ModelCard


def check_execution(parameters: ProtocolParameters, disturbances: Disturbances, robot: Robot, card: ModelCard) -> None:
    """Check that a robot can drive on while a model thinks, and that the model's answers can replace a running path.

    Raises:
        UsageError: the robot takes no velocity commands (`no-velocity-commands`), the model only answers with actions
            from rest to rest (`unsupported-action-kind`), or there are two latencies (`two-latencies`).
    """
    if parameters.execution is None:
        return
    name = robot.identity.profile.name
    if not robot.drives_on:
        raise UsageError(
            f"--continuous: robot {name} takes no velocity commands and no paths, so it cannot drive on while a model "
            "thinks",
            advice="use vsnbench robots serve on a robot over ROS, --robot simulated, or leave --continuous out",
            code="no-velocity-commands",
        )
    if not card.action_kinds & KINDS_WHILE_DRIVING:
        raise UsageError(
            f"--continuous: model {card.name} answers with {', '.join(sorted(card.action_kinds))}, which goes from "
            "rest to rest: each action begins and ends with the robot at rest",
            advice=f"only models that answer with {', '.join(sorted(KINDS_WHILE_DRIVING))} can drive on",
            code="unsupported-action-kind",
        )
    if disturbances["latency"] is not None:
        raise UsageError(
            "--disturb latency is for a robot that rests while the model thinks",
            advice="give the latency with --continuous",
            code="two-latencies",
        )
