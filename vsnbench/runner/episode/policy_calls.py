"""Calls a policy, which is code of unknown origin.

A policy receives the sensors on its card only, and its decisions are checked completely. Every exception, and every
attempt to end the process, becomes a `PolicyFailedError` of one line. Whether a stop was requested is read from
`StopRequests`, not from the type of an exception, because a policy can raise any type.
"""

import logging
import math
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from vsnbench.errors import DecisionError, ModelError, ModelLostError, VsnbenchError
from vsnbench.models import loaded
from vsnbench.models.contract import Policy
from vsnbench.models.contract_check import line_and_place
from vsnbench.models.fit.decision import fitting_decision, without_tilt
from vsnbench.models.fit.goal import goal_for
from vsnbench.models.process_exit import take_refused_exit
from vsnbench.models.task import RobotFacts, Task
from vsnbench.protocol.execution import StopSource
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.runtime import time_limits
from vsnbench.runtime.floating_point import floating_point_restored
from vsnbench.runtime.time_limits import TimeLimitError, call_in_thread
from vsnbench.sites.site import Site
from vsnbench.text.sanitize import error_line, memory_problem, sanitize
from vsnbench.values.decision import Decision
from vsnbench.values.goal import GoalKind
from vsnbench.values.model.card import Anchor
from vsnbench.values.movement import Action, Movement
from vsnbench.values.observation import Budget, Observation, newest_of, with_changes
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base

logger = logging.getLogger(__name__)

_LONGEST_TRACEBACK = 20_000
TRACEBACK_TIMEOUT_S = 2.0
_CALLERS = (__file__, loaded.__file__, time_limits.__file__)


class PolicyFailedError(Exception):
    """The policy raised an exception or did not return a decision; the message is one line."""


class PolicyCalls:
    """Calls one policy through one episode.

    Requests to stop interrupt it. They are not failures of the policy, even if it catches them.
    """

    def __init__(self, policy: Policy, stop: StopRequests, says_arrived: Callable[[], bool] = lambda: False) -> None:
        """Call a policy.

        Args:
            policy: the policy.
            stop: requests to stop.
            says_arrived: whether the operator says that the robot has arrived, for a policy that asks for it.
        """
        self._policy = policy
        self._stop = stop
        self._name = policy.card.name
        self._card = replace(policy.card, action_map=dict(policy.card.action_map))
        self._robot: RobotFacts | None = None
        self._start = Pose(0.0, 0.0)
        self._says_arrived = says_arrived
        self._history: tuple[Observation, ...] = ()
        self._answered_s = -math.inf
        """Time of the newest image that the policy has been asked about."""

    @property
    def announcement(self) -> str:
        """What the operator is told now that the episode has begun; empty for nothing."""
        return sanitize(self._policy.announcement)

    @property
    def anchor(self) -> Anchor:
        """Which pose of the robot the model's answers refer to while it drives on."""
        return self._card.anchor

    def begin(self, site: Site, start: Pose, task: Task, parameters: ProtocolParameters, base: Base) -> None:
        """Begin an episode; only a policy that asks for the survey is handed the site and the true start.

        Raises:
            PolicyFailedError: the policy raised an exception.
            ModelLostError: the policy's server cannot be reached.
        """
        self._robot, self._start = task.robot, start
        self._history, self._answered_s = (), -math.inf
        with self._failures("reset"):
            if self._policy.needs_survey:
                self._policy.survey(site, start, base, parameters)
            self._policy.begin(self._told(site, task))

    def next_goal(self, site: Site, task: Task, parameters: ProtocolParameters, base: Base) -> None:
        """Give the next goal of a sequence; a policy without memory of the earlier ones begins again where it is.

        Raises:
            PolicyFailedError: the policy raised an exception.
            ModelLostError: the policy's server cannot be reached.
        """
        if not self.keeps_memory:
            self.begin(site, self._start, task, parameters, base)
            return
        with self._failures("next_goal"):
            self._policy.next_goal(self._told(site, task).goal)

    @property
    def keeps_memory(self) -> bool:
        """Whether the policy keeps its memory from one goal of a sequence to the next."""
        return GoalKind.SEQUENCE in self._card.goal_kinds

    def _told(self, site: Site, task: Task) -> Task:
        """Return a task with the goal as the policy receives it."""
        return replace(task, goal=goal_for(self._card, site, task.goal, self._start))

    def act(self, observation: Observation, budget: Budget | None = None) -> Decision:
        """Return the policy's decision; it receives a copy of the observation, and the remaining budget.

        Raises:
            PolicyFailedError: the policy raised an exception or did not return a decision.
            SensorLostError: the observation lacks a sensor of the card.
            ModelLostError: the policy's server did not answer in time.
        """
        if self._policy.asks_operator and self._says_arrived():
            return Decision(Action.STOP, StopSource.OPERATOR)
        visible = self._card.shown(observation, budget)
        if earlier := [seen for seen in self._history if seen.stamp_s < observation.stamp_s]:
            visible = with_changes(visible, history=newest_of(earlier, visible, self._card.history))
        self._history, self._answered_s = (), observation.stamp_s
        with self._failures("act"):
            return fitting_decision(self._policy.act(visible), self._card, self._robot)

    @property
    def takes_history(self) -> bool:
        """Whether the policy receives observations between its decisions."""
        return self._card.history > 0

    def pass_by(self, observation: Observation) -> None:
        """Keep a copy of an observation that the policy is not asked about, for the history of the next one.

        Raises:
            SensorLostError: the observation lacks a sensor of the card.
        """
        if self.takes_history and observation.stamp_s > self._answered_s:
            seen = self._card.shown(observation)
            self._history = (*newest_of(self._history, seen, self._card.history - 1), seen)

    def end(self) -> None:
        """Tell the policy that the episode has ended; its errors are logged, and never keep a robot from stopping."""
        try:
            self._policy.end_episode()
        except Exception as error:
            logger.warning("model %s failed in end_episode: %s", self._name, error_line(error))

    def without_tilt(self, part: Action | Movement) -> Decision:
        """Return a part of a chunk as a decision, with LOOK_UP and LOOK_DOWN replaced as the card states."""
        return without_tilt(part, self._card)

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
        """Log a line, for the policy's author also the traceback at level info, and return the error to record."""
        if isinstance(error, ModelLostError):
            return ModelLostError(error_line(error, named=False))
        if isinstance(error, DecisionError):
            line = error_line(error, named=False)
            return PolicyFailedError(f"{where}: not a decision that can be carried out and recorded: {line}")
        if type(error) is ModelError:  # states the failure; frames of this package would add nothing
            line, more = error_line(error, named=False), "\n".join(getattr(error, "__notes__", ()))
        elif memory_problem(error):  # the machine's or the job's, and not of the model's code
            line, more = error_line(error), ""
        else:
            line, more = line_and_place(error), _traceback(error) if logger.isEnabledFor(logging.INFO) else ""
        logger.error("model %s failed in %s: %s", self._name, where, line)
        if more:
            logger.info("model %s in %s:\n%s", self._name, where, more)
        return PolicyFailedError(f"{where}: {error_line(error, named=type(error) is not ModelError)}")


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
