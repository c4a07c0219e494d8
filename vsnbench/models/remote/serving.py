"""Serves a policy of this process, for `vsnbench models serve` and for isolated models."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import MISSING, fields
from types import MappingProxyType
from typing import Any

from pydantic import ValidationError

from vsnbench.errors import DecisionError, ModelError, UsageError
from vsnbench.models.contract import BatchPolicy, Policy
from vsnbench.models.identity import code_of, files_handed_over
from vsnbench.models.process_exit import ProcessExitError, take_refused_exit
from vsnbench.models.remote import vsnbench_policy as wire
from vsnbench.models.remote.card import card_to_wire
from vsnbench.models.remote.reset_message import PROTOCOL_FIELDS
from vsnbench.models.task import RobotFacts, Task
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.settings.validation import first_error
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.decision_check import checked_decision
from vsnbench.values.encoding.codec import decision_to_message
from vsnbench.values.goal import Goal, GoalKind
from vsnbench.values.model.card import copy_of
from vsnbench.values.observation import ARRAYS, Budget, Observation, observation_of
from vsnbench.values.pose import Pose


class ServedPolicy:
    """A policy in the form that `vsnbench_policy.serve` expects."""

    def __init__(self, policy: Policy, name: str = "", options: Mapping[str, Any] = MappingProxyType({})) -> None:
        """Wrap a policy. Name and options are those of `create_policy`; files among them are part of its identity.

        Raises:
            UsageError: the policy needs the site or a sensor that is not sent, such as the simulator's labels.
        """
        card = policy.card
        if policy.needs_survey:
            raise UsageError(
                f"model {card.name} needs the site, which is not transferred",
                advice="run it without a server",
                code="cannot-be-served",
            )
        if kept := [sensor for sensor in sorted(card.sensors) if not sensor.is_sent]:
            raise UsageError(
                f"model {card.name} needs {', '.join(kept)}, which a server does not receive",
                advice="name the weights of a real detector",
                code="cannot-be-served",
            )
        self._policy = policy
        self._shown = copy_of(card).shown
        self.card = card_to_wire(card) | {
            "code": code_of(policy),
            "files": files_handed_over(name, policy, options),
        }

    def reset(self, goal: wire.Goal, seed: int) -> None:
        """Start an episode of a client that sends no task."""
        received = _goal(goal)
        with _exits_as_errors():
            self._policy.reset(received, seed)

    def begin(self, task: wire.Task) -> None:
        """Start an episode."""
        received = _task(task)
        with _exits_as_errors():
            self._policy.begin(received)

    def next_goal(self, goal: wire.Goal) -> None:
        """Pass the next goal of a sequence on."""
        received = _goal(goal)
        with _exits_as_errors():
            self._policy.next_goal(received)

    def act(self, given: wire.Observation) -> dict[str, Any]:
        """Return the decision as a message."""
        with _exits_as_errors():
            decision = checked_decision(self._policy.act(self._shown(_observation(given))))
        return decision_to_message(decision)


class ServedBatchPolicy(ServedPolicy):
    """A policy that all sessions share, in the form that `vsnbench_policy.serve` expects."""

    _policy: BatchPolicy

    def new_state(self, goal: wire.Goal, seed: int) -> Any:
        """Return the state of a new episode."""
        received = _goal(goal)
        with _exits_as_errors():
            return self._policy.new_state(received, seed)

    def act_batch(self, given: Sequence[wire.Observation], states: Sequence[Any]) -> "list[dict[str, Any] | Exception]":
        """Return the decisions as messages, and an error in place of an invalid one."""
        seen = [self._shown(_observation(observation)) for observation in given]
        decisions: Sequence[Any] = ()
        with _exits_as_errors():
            decisions = self._policy.act_batch(seen, states)
        return [_answer(decision) for decision in decisions]


def served(policy: Policy, name: str, options: Mapping[str, Any], sessions: int) -> ServedPolicy:
    """Return a policy as `vsnbench_policy.serve` expects it for a number of sessions; otherwise as `ServedPolicy`."""
    shared = sessions > 1 and isinstance(policy, BatchPolicy)
    return (ServedBatchPolicy if shared else ServedPolicy)(policy, name, options)


@contextmanager
def _exits_as_errors() -> Iterator[None]:
    """Convert an attempt to end this process to an error."""
    with suppress(ProcessExitError):
        yield
    if refused_exit := take_refused_exit():
        raise ModelError(refused_exit)


def _answer(decision: object) -> dict[str, Any] | Exception:
    try:
        return decision_to_message(checked_decision(decision))
    except DecisionError as error:
        return error


def _goal(goal: wire.Goal) -> Goal:
    return Goal(
        goal.id or str(goal),
        GoalKind(goal.kind),
        text=goal.text,
        category=goal.category,
        image=goal.image,
        images=goal.images,
        point=goal.point,
    )


def _task(given: wire.Task) -> Task:
    """Return the task of a message; unknown facts of a later client are ignored."""
    robot = {**vars(given.robot), "camera": _camera(given.robot.camera)}  # type: ignore[attr-defined]
    try:
        protocol = ProtocolParameters(**{name: getattr(given.protocol, name, None) for name in PROTOCOL_FIELDS})
        stated = [item for item in fields(RobotFacts) if item.default is MISSING or item.name in robot]
        facts = RobotFacts(**{item.name: robot[item.name] for item in stated})
    except ValidationError as error:
        field, problem = first_error(error, ProtocolParameters)
        raise wire.WireError(f"`task.protocol.{field}`: {problem.statement[:300]}") from error
    except KeyError as error:
        raise wire.WireError(f"`task.robot` needs {error}") from error
    return Task(_goal(given.goal), given.seed, protocol, facts)


def _camera(given: wire.Camera) -> Camera:
    try:
        return Camera.model_validate(vars(given))
    except ValueError as error:
        raise wire.WireError(f"`camera`: {' '.join(str(error).split())[:300]}") from error


def _observation(given: wire.Observation) -> Observation:
    camera = _camera(given.camera)
    budget = None if given.budget is None else Budget(**given.budget)
    measured = {name: values for name, _ in ARRAYS if (values := getattr(given, name, None)) is not None}
    if given.pose is not None:
        measured["pose"] = Pose(given.pose.x_m, given.pose.y_m, given.pose.heading_rad)
    try:
        return observation_of(
            given.stamp_s,
            camera,
            budget=budget,
            beyond_range=given.beyond_range,
            cameras={CameraRole(role): _observation(view) for role, view in given.cameras.items()},
            history=tuple(map(_observation, given.history)),
            **measured,
        )
    except ValueError as error:
        raise wire.WireError(str(error)) from error
