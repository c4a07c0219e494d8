"""A policy whose card, sensors and time limit are fixed when it is loaded.

Model code can change its own object at any time. Whether it receives the site, and which sensors it sees, is decided
before its first episode and recorded; later changes have no effect.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from vsnbench.errors import ModelError, ModelLostError
from vsnbench.models.contract import Policy
from vsnbench.models.task import Task
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.runtime.time_limits import TimeLimitError, call_interrupted
from vsnbench.sites.site import Site
from vsnbench.text.sanitize import error_line
from vsnbench.values.decision import Decision
from vsnbench.values.model.card import copy_of
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base


class LoadedPolicy(Policy):
    """Calls a policy; `card` and `needs_survey` are copies made at loading time."""

    def __init__(self, policy: Policy, act_timeout_s: float | None = None, *, remote: bool = False) -> None:
        """Wrap a policy.

        Args:
            policy: the model's own object.
            act_timeout_s: seconds for one action, in the main thread only; no limit when None.
            remote: whether the policy is the client of a model in another process, which it may report as lost.
        """
        self.policy = policy
        self.needs_survey = policy.needs_survey
        self.card = copy_of(policy.card, surveyed=policy.needs_survey)
        self.asks_operator = policy.asks_operator
        self._act_timeout_s = act_timeout_s
        self._remote = remote

    def survey(self, site: Site, start: Pose, base: Base, parameters: ProtocolParameters) -> None:
        """Pass the site on."""
        with self._losses():
            self.policy.survey(site, start, base, parameters)

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode."""
        with self._losses():
            self.policy.reset(goal, seed)

    def begin(self, task: Task) -> None:
        """Start an episode."""
        with self._losses():
            self.policy.begin(task)
        self.announcement = self.policy.announcement

    def next_goal(self, goal: str) -> None:
        """Pass the next goal of a sequence on."""
        with self._losses():
            self.policy.next_goal(goal)

    def act(self, observation: Observation) -> Decision:
        """Return the next action.

        Raises:
            ModelLostError: the model exceeded its time limit, or its process is lost.
        """
        if self._act_timeout_s is None:
            with self._losses():
                return self.policy.act(observation)
        try:
            return call_interrupted(lambda: self._act(observation), self._act_timeout_s)
        except TimeLimitError as error:
            raise ModelLostError(f"act: no answer within {self._act_timeout_s:g} s") from error

    def end_episode(self) -> None:
        """Pass the end of the episode on."""
        self.policy.end_episode()

    def close(self) -> None:
        """Close the policy."""
        self.policy.close()

    def _act(self, observation: Observation) -> Decision:
        with self._losses():
            return self.policy.act(observation)

    @contextmanager
    def _losses(self) -> Iterator[None]:
        """Convert errors of a lost model. A policy in this process cannot be lost, whatever it raises."""
        try:
            yield
        except (ModelLostError, TimeLimitError) as error:
            if self._remote:
                raise
            raise ModelError(error_line(error)).with_traceback(error.__traceback__) from None
