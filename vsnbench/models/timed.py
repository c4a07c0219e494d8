"""A deadline for a policy that runs in this process, as far as Python allows.

A timer's signal interrupts Python code and whatever waits in it; it does not interrupt a library that computes for
minutes without coming back to Python, and it cannot end the threads that a policy has started. A process of its own
(`--isolate`) can be ended whatever it does.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from vsnbench.errors import ModelLostError
from vsnbench.models.contract import ModelCard, Policy, SurveyedPolicy
from vsnbench.protocol.decision import Decision
from vsnbench.protocol.observation import Observation
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_profile import Base
from vsnbench.protocol.site import Site


class TimedPolicy:
    """A policy whose `act` is lost (ModelLostError) when it takes longer than its deadline; the main thread's only."""

    def __init__(self, policy: Policy, act_timeout_s: float) -> None:
        self._policy = policy
        self._act_timeout_s = act_timeout_s
        self.card: ModelCard = policy.card

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode."""
        self._policy.reset(goal, seed)

    def act(self, observation: Observation) -> Decision:
        """Return the next action.

        Raises:
            ModelLostError: it took too long.
        """
        with _deadline(self._act_timeout_s):
            return self._policy.act(observation)

    def close(self) -> None:
        """Let the policy go."""
        close = getattr(self._policy, "close", None)
        if close is not None:
            close()


class TimedSurveyedPolicy(TimedPolicy):
    """The same for a policy that is handed the site."""

    _policy: SurveyedPolicy

    def survey(self, site: Site, start: Pose, base: Base, parameters: ProtocolParameters) -> None:
        """Hand the site on."""
        self._policy.survey(site, start, base, parameters)


def timed(policy: Policy, act_timeout_s: float) -> Policy:
    """Return the policy with a deadline for each action."""
    if isinstance(policy, SurveyedPolicy):
        return TimedSurveyedPolicy(policy, act_timeout_s)
    return TimedPolicy(policy, act_timeout_s)


@contextmanager
def _deadline(timeout_s: float) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def passed(_number: int, _frame: FrameType | None) -> None:
        raise ModelLostError(f"act: no answer within {timeout_s:g} s")

    before = signal.signal(signal.SIGALRM, passed)
    signal.setitimer(signal.ITIMER_REAL, timeout_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
