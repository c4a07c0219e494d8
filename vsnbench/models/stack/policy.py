"""A stack as a model: it is told the goal, drives the robot itself, and is asked only whether it has arrived."""

import logging
import math
from pathlib import Path

from vsnbench.errors import ModelError
from vsnbench.models.contract import Policy
from vsnbench.models.stack.file import GOAL_WORD, card_of, load_stack
from vsnbench.models.stack.topics import ArrivalTopic
from vsnbench.models.stack.trial import StackTrial
from vsnbench.models.task import Task
from vsnbench.protocol.execution import StopSource
from vsnbench.sensing.exchange import Exchange
from vsnbench.values.decision import Decision
from vsnbench.values.goal import Goal
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose, wrap_angle

logger = logging.getLogger(__name__)

_MOVED_M, _MOVED_RAD = 0.05, math.radians(5)
"""A robot that has moved this far since the start of the episode has begun to drive."""
_REST_M, _REST_RAD = 0.01, math.radians(1)
"""A robot at rest stays within this of one pose."""


DRIVES = "drives"
"""The model's own name for what it does at each look until STOP."""


class StackPolicy(Policy):
    """Watches a stack: each answer is NOOP while it drives, and STOP once it has arrived."""

    def __init__(self, file: Path) -> None:
        """Read the stack's file.

        Raises:
            ModelError: the file is invalid.
        """
        self._stack = load_stack(file)
        self.card = card_of(self._stack, file)
        self.asks_operator = self._stack.arrived.operator is True
        self._file = file
        self._watched = False
        self._goal: Goal | str = ""
        self._exchange: Exchange | None = None
        self._heard: ArrivalTopic | None = None
        self._trial: StackTrial | None = None
        self._moved = False
        self._start: Pose | None = None
        self._rest_since: tuple[float, Pose] | None = None

    def join(self, exchange: Exchange | None) -> None:
        """Take the network of the robot that the stack drives; called before the first trial.

        Args:
            exchange: None for a robot without one.

        Raises:
            ModelError: the file names a type of message that is not installed, or content that does not fit it.
        """
        self._exchange = exchange
        if exchange is None:
            return
        for message in self._stack.messages:
            for category in message.by_goal or ("",):
                exchange.check(message.type, message.content_for("", category))
        if (topic := self._stack.arrived.topic) is not None:
            exchange.check(topic.type, {})
            self._heard = ArrivalTopic(exchange, topic)

    def reset(self, goal: str, seed: int) -> None:
        """Forget the last episode, once its stack has been told to abort. The goal is announced with the first look."""
        del seed
        self._finish()
        self._goal, self._watched = goal, False
        self.announcement = (self._stack.announce.operator or "").replace(GOAL_WORD, goal)
        self._moved, self._start, self._rest_since = False, None, None

    def begin(self, task: Task) -> None:
        """Start an episode in which the robot is watched.

        Raises:
            ModelError: the protocol is for models, so nothing would stop the robot that the stack drives.
        """
        self.reset(task.goal, task.seed)
        execution = task.protocol.execution
        self._watched = execution is not None and execution.is_by_stack
        if not self._watched:
            raise ModelError(
                f"stack {self._stack.name} drives a robot, so it is announced a goal in `vsnbench run` only",
                advice=f"for its file: vsnbench models show stack:{self._file}",
                code="stack-not-watched",
            )

    def act(self, observation: Observation) -> Decision:
        """Return NOOP while the stack drives, and STOP with its source once it has arrived."""
        if not self._watched:
            raise ModelError(f"stack {self._stack.name} was not begun", code="stack-not-watched")
        if self._trial is None:
            self._trial = StackTrial(
                self._stack, _sent(self._goal), self._file.resolve().parent, self._exchange, self._heard
            )
        if self._trial.has_arrived:
            return Decision(Action.STOP, StopSource.DECLARED)
        if self._stack.arrived.rest_s is not None and self._rests(observation, self._stack.arrived.rest_s):
            return Decision(Action.STOP, StopSource.AT_REST)
        return Decision(Action.NOOP, DRIVES)

    def end_episode(self) -> None:
        """Tell the stack to abort; a thread does it."""
        if self._trial is not None:
            self._trial.end()

    def close(self) -> None:
        """End the last trial."""
        self._finish()

    def _finish(self) -> None:
        trial, self._trial = self._trial, None
        if trial is not None and (problem := trial.finish()):
            logger.warning("stack %s was not aborted: %s", self._stack.name, problem)

    def _rests(self, observation: Observation, rest_s: float) -> bool:
        """Return whether the robot has been at rest for a time, after it has moved."""
        here, now_s = observation.pose, observation.stamp_s
        if self._start is None:
            self._start = here
        self._moved = self._moved or _apart(here, self._start, _MOVED_M, _MOVED_RAD)
        if self._rest_since is None or _apart(here, self._rest_since[1], _REST_M, _REST_RAD):
            self._rest_since = now_s, here
        return self._moved and now_s - self._rest_since[0] >= rest_s


def _apart(one: Pose, other: Pose, distance_m: float, angle_rad: float) -> bool:
    turned_rad = abs(wrap_angle(one.heading_rad - other.heading_rad))
    return one.distance_to(other) > distance_m or turned_rad > angle_rad


def _sent(goal: Goal | str) -> dict[str, str]:
    """Return what a stack is told of a goal."""
    if not isinstance(goal, Goal):
        return {"goal": goal}
    return {"goal": str(goal), "id": goal.id, "kind": goal.kind.value, "category": goal.category, "text": goal.text}
