"""Calls a policy, which is code of unknown origin.

A policy receives the sensors on its card only, and its decisions are checked completely. Every exception, and every
attempt to end the process, becomes a `PolicyFailedError` of one line. Whether a stop was requested is read from
`StopRequests`, not from the type of an exception, because a policy can raise any type.
"""

import logging
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from vsnbench.errors import DecisionError, ModelError, ModelLostError, VsnbenchError
from vsnbench.models import duck_typed, loaded
from vsnbench.models.contract import Policy
from vsnbench.models.goal_fit import goal_for
from vsnbench.models.process_exit import take_refused_exit
from vsnbench.models.task import Task
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.runtime import time_limits
from vsnbench.runtime.floating_point import floating_point_restored
from vsnbench.runtime.time_limits import TimeLimitError, call_in_thread
from vsnbench.sites.site import Site
from vsnbench.text.sanitize import error_line, sanitize
from vsnbench.values.action import TILTS, Action
from vsnbench.values.decision import Decision
from vsnbench.values.decision_check import checked_decision
from vsnbench.values.movement import Movement, Velocity
from vsnbench.values.observation import Budget, Observation, shown_to_policy
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base

logger = logging.getLogger(__name__)

_LONGEST_TRACEBACK = 20_000
TRACEBACK_TIMEOUT_S = 2.0
_CALLERS = (__file__, duck_typed.__file__, loaded.__file__, time_limits.__file__)


class PolicyFailedError(Exception):
    """The policy raised an exception or did not return a decision; the message is one line."""


class PolicyCalls:
    """Calls one policy through one episode.

    Requests to stop interrupt it. They are not failures of the policy, even if it catches them.
    """

    def __init__(self, policy: Policy, stop: StopRequests) -> None:
        self._policy = policy
        self._stop = stop
        self._name = policy.card.name
        self._sensors = frozenset(policy.card.sensors)
        self._action_kinds = frozenset(policy.card.action_kinds)
        self._action_map = dict(policy.card.action_map)
        self._base: Base | None = None

    def begin(self, site: Site, start: Pose, task: Task, parameters: ProtocolParameters, base: Base) -> None:
        """Begin an episode; only a policy that asks for the survey is handed the site and the true start.

        Raises:
            PolicyFailedError: the policy raised an exception.
            ModelLostError: the policy's server cannot be reached.
        """
        self._base = base
        with self._failures("reset"):
            if self._policy.needs_survey:
                self._policy.survey(site, start, base, parameters)
            self._policy.begin(replace(task, goal=goal_for(self._policy.card, site, task.goal)))

    def act(self, observation: Observation, budget: Budget | None = None) -> Decision:
        """Return the policy's decision; it receives a copy of the observation, and the remaining budget.

        Raises:
            PolicyFailedError: the policy raised an exception or did not return a decision.
            SensorLostError: the observation lacks a sensor of the card.
            ModelLostError: the policy's server did not answer in time.
        """
        visible = shown_to_policy(observation, self._sensors, budget)
        with self._failures("act"):
            decision = checked_decision(self._policy.act(visible))
            self._check_kinds(decision)
            for part in decision.parts:
                self.without_tilt(part)
            return decision if decision.parts else self.without_tilt(decision)

    def without_tilt(self, decided: Decision | Action | Movement) -> Decision:
        """Return a decision, or a part of a chunk, with LOOK_UP and LOOK_DOWN replaced as the card states.

        Raises:
            DecisionError: the card replaces it by no other action.
        """
        decision = decided if isinstance(decided, Decision) else Decision(decided)
        if decision.action not in TILTS:
            return decision
        if decision.action not in self._action_map:
            raise DecisionError(
                f"answered with {decision.action}, and no robot tilts its camera",
                advice=f"map it on the card, for example action_map={{Action.{decision.action}: Action.NOOP}}",
            )
        return replace(decision, action=self._action_map[decision.action])

    def _check_kinds(self, decision: Decision) -> None:
        """Check that the card states the kinds of a decision, and that the base reaches its velocities.

        Raises:
            DecisionError: it does not.
        """
        if unstated := decision.kinds - self._action_kinds:
            stated = ", ".join(sorted(self._action_kinds))
            raise DecisionError(
                f"answered with {', '.join(sorted(unstated))}, but its card states {stated}",
                advice="add the kind to the card's action_kinds",
            )
        for movement in (decision.movement, *decision.parts):
            if isinstance(movement, Velocity) and self._base is not None:
                _check_velocity(movement, self._base)

    @contextmanager
    def _failures(self, where: str) -> Iterator[None]:
        """Convert every exception of the policy.

        Raises:
            Stopped: a request to stop is pending; it takes precedence over the policy's exception.
        """
        failure: VsnbenchError | PolicyFailedError | None = None
        try:
            with floating_point_restored():
                yield
        except BaseException as error:
            self._stop.act_now()
            failure = self._failure(where, error)
        self._stop.act_now()
        if refused_exit := take_refused_exit():
            failure = PolicyFailedError(f"{where}: {refused_exit}")
        if failure is not None:
            raise failure from None

    def _failure(self, where: str, error: BaseException) -> VsnbenchError | PolicyFailedError:
        """Log the traceback for the policy's author, and return the error to record."""
        if isinstance(error, ModelLostError):
            return ModelLostError(error_line(error, named=False))
        if isinstance(error, DecisionError):
            line = error_line(error, named=False)
            return PolicyFailedError(f"{where}: not a decision that can be carried out and recorded: {line}")
        if type(error) is ModelError:  # states the failure; frames of this package would add nothing
            notes = "".join(f"\n{note}" for note in getattr(error, "__notes__", ()))
            logger.error("model %s failed in %s: %s%s", self._name, where, error_line(error, named=False), notes)
        else:
            logger.error("model %s failed in %s:\n%s", self._name, where, _traceback(error))
        return PolicyFailedError(f"{where}: {error_line(error, named=type(error) is not ModelError)}")


def _check_velocity(velocity: Velocity, base: Base) -> None:
    limits = (
        (velocity.linear_m_s, base.max_linear_m_s, "m/s"),
        (velocity.angular_rad_s, base.max_angular_rad_s, "rad/s"),
    )
    for asked, limit, unit in limits:
        if abs(asked) > limit * (1 + 1e-6):
            raise DecisionError(f"a velocity of {asked:.4g} {unit} exceeds this base's maximum of {limit:g} {unit}")


def _traceback(error: BaseException) -> str:
    """Return a limited traceback that starts in the policy's code. Formatting may run code that fails or hangs."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None and trace.tb_frame.f_code.co_filename in _CALLERS:
        trace = trace.tb_next
    try:
        text = call_in_thread(
            lambda: "".join(traceback.format_exception(type(error), error, trace)), TRACEBACK_TIMEOUT_S
        )
    except TimeLimitError:
        return "(no traceback: the exception's text takes too long)"
    except BaseException as second:
        return f"(no traceback: {type(second).__name__} while it was formatted)"
    text = text if len(text) <= _LONGEST_TRACEBACK else f"…{text[-_LONGEST_TRACEBACK:]}"
    return "\n".join(sanitize(line) for line in text.split("\n"))
