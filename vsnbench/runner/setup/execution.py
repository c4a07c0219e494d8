"""Checks that a model and a robot fit a protocol in which the robot drives on."""

from collections.abc import Iterable

from vsnbench.errors import UsageError
from vsnbench.models.names import is_stack, stack_file
from vsnbench.models.stack.file import load_stack
from vsnbench.protocol.disturbances import Disturbances
from vsnbench.protocol.execution import KINDS_WHILE_DRIVING, STACK
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.contract import Robot
from vsnbench.sites.site import Site
from vsnbench.sites.targets import kind_of
from vsnbench.values.goal import GoalKind
from vsnbench.values.model.card import ModelCard
from vsnbench.values.observation import Sensor


def rules_for(model: str, parameters: ProtocolParameters) -> ProtocolParameters:
    """Return the parameters of a protocol for a model: those of a stack if it is one, which drives the robot itself.

    Raises:
        ModelError: the file of the stack cannot be read or is invalid.
        UsageError: the protocol states a latency, which a stack does not have (`stack-latency`).
    """
    if not is_stack(model):
        return parameters
    execution = parameters.execution
    if execution is not None and execution.latency_s is not None:
        raise UsageError(
            f"--continuous {execution.latency_s:g}: {model} drives the robot itself, at its own pace",
            advice="leave --continuous out",
            code="stack-latency",
        )
    return parameters.driven_by_stack(guarded=load_stack(stack_file(model)).depth_guard)


def check_execution(parameters: ProtocolParameters, disturbances: Disturbances, robot: Robot, card: ModelCard) -> None:
    """Check that a robot can drive on while a model thinks, and that the model's answers can replace a running path.

    Raises:
        UsageError: the robot takes no velocity commands (`no-velocity-commands`), the model only answers with actions
            from rest to rest (`unsupported-action-kind`), there are two latencies (`two-latencies`), or a stack cannot
            drive it; see `_check_stack`.
    """
    by_stack = parameters.execution is not None and parameters.execution.is_by_stack
    if STACK in card.settings and not by_stack:
        raise UsageError(
            f"stack {card.name} drives the robot itself, which only `vsnbench run` watches",
            advice=f"run it as a campaign of its own: vsnbench run --model stack:FILE.yaml --robot {_name(robot)}",
            code="stack-not-watched",
        )
    if parameters.execution is None:
        return
    name = _name(robot)
    if by_stack:
        _check_stack(parameters, disturbances, robot, card)
        return
    if not robot.drives_on:
        raise UsageError(
            f"--continuous: robot {name} takes no velocity commands and no paths, so it cannot drive on while a model "
            "thinks",
            advice="use vsnbench robots serve on a robot over ROS, --robot simulated, or leave --continuous out",
            code="no-velocity-commands",
        )
    if not card.action_kinds & KINDS_WHILE_DRIVING:
        raise UsageError(
            f"--continuous: model {card.name} answers with {', '.join(sorted(card.action_kinds))} only, from rest to "
            "rest: each action begins and ends with the robot at rest",
            advice=f"only models that answer with {', '.join(sorted(KINDS_WHILE_DRIVING))} can drive on",
            code="unsupported-action-kind",
        )
    if disturbances["latency"] is not None:
        raise UsageError(
            "--disturb latency is for a robot that rests while the model thinks",
            advice="give the latency with --continuous",
            code="two-latencies",
        )


def check_sequences(site: Site, goals: Iterable[str], parameters: ProtocolParameters) -> None:
    """Check that a robot rests where a goal of a sequence ends and the next is given.

    Raises:
        UsageError: it drives on while a model thinks, or a stack drives it (`sequence-while-driving`).
    """
    name = next((goal for goal in goals if kind_of(site, goal) is GoalKind.SEQUENCE), None)
    if name is not None and parameters.execution is not None:
        raise UsageError(
            f"goal {name} is a sequence, whose goals are given to a robot at rest, and this robot drives on",
            advice="leave --continuous out, or name the goals of the sequence as goals of their own",
            code="sequence-while-driving",
        )


def needs_person(card: ModelCard) -> bool:
    """Return whether a person has to start a stack, or to say that it has arrived; False for a model."""
    ways = card.settings.get(STACK, {})
    return "operator" in {*ways.get("announce", {}), *ways.get("arrived", {})}


def check_stack_without_person(card: ModelCard) -> None:
    """Check that no person has to start a stack, or to say that it has arrived.

    Raises:
        UsageError: one has (`needs-operator`).
    """
    if needs_person(card):
        raise UsageError(
            f"stack {card.name} needs an operator to start it or to say that it has arrived, and none is present",
            advice="add --console, for a page in the operator's browser",
            code="needs-operator",
        )


def _check_stack(parameters: ProtocolParameters, disturbances: Disturbances, robot: Robot, card: ModelCard) -> None:
    """Check that a stack can drive a robot itself.

    Raises:
        UsageError: the model is not a stack (`not-a-stack`), the robot accepts no velocity commands from others
            (`no-velocity-commands`), a disturbance changes what only a model would see (`stack-disturbed`), or the
            depth guard is on and the robot has no depth camera (`guard-without-depth`).
    """
    if STACK not in card.settings:
        raise UsageError(
            f"the protocol's execution is of a stack that drives itself, and {card.name} is a model",
            advice="name a stack with --model stack:FILE.yaml, or leave `driver: stack` out of the protocol",
            code="not-a-stack",
        )
    if not robot.can_be_watched:
        raise UsageError(
            f"robot {_name(robot)} takes no velocity commands on a topic, so stack {card.name} cannot drive it",
            advice="use a robot over ROS, or a simulated one: vsnbench robots simulate turtlebot4",
            code="no-velocity-commands",
        )
    if disturbances:
        raise UsageError(
            f"--disturb changes what vsnbench shows to a model, and stack {card.name} reads the robot's topics itself",
            advice="leave --disturb out",
            code="stack-disturbed",
        )
    if parameters.depth_guard.enabled and Sensor.DEPTH not in robot.sensors:
        raise UsageError(
            f"stack {card.name} asks for the depth guard, and robot {_name(robot)} has no depth camera",
            advice="leave `depth_guard` out of the stack's file",
            code="guard-without-depth",
        )


def _name(robot: Robot) -> str:
    return robot.identity.profile.name
