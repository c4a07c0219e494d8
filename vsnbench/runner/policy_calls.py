"""Every call of a policy, which is somebody else's code: what it is shown, what it answers, and how it fails.

It is shown the sensors on its card and nothing else; its answer is checked whole; and whatever it raises, an exit
included, is a `PolicyFailedError` of one line. Only a request to stop, which interrupts it from outside, passes.
"""

import logging
import traceback

from vsnbench.errors import DecisionError, ModelError, ModelLostError
from vsnbench.harmless_text import error_line
from vsnbench.models.contract import Policy, SurveyedPolicy
from vsnbench.protocol.decision import Decision
from vsnbench.protocol.decision_check import checked_decision
from vsnbench.protocol.observation import Observation, shown_to_policy
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_profile import Base
from vsnbench.protocol.site import Site
from vsnbench.runner.stopping import Stopped, Stopping

logger = logging.getLogger(__name__)

_LONGEST_TRACEBACK = 20_000


class PolicyFailedError(Exception):
    """The policy raised, or answered with something that is no decision; the message is one line for the record."""


class PolicyCalls:
    """Calls one policy through one episode."""

    def __init__(self, policy: Policy, stop: Stopping) -> None:
        """Take the policy as its card describes it now.

        Args:
            policy: who is called.
            stop: its requests interrupt a policy and are none of its own failures, also where it swallows them.
        """
        self._policy = policy
        self._stop = stop
        self._name = policy.card.name
        self._sensors = frozenset(policy.card.sensors)

    def reset(self, site: Site, goal: str, start: Pose, base: Base, seed: int, parameters: ProtocolParameters) -> None:
        """Begin an episode; only a policy that asks for the survey is handed the site and the true start.

        Raises:
            PolicyFailedError: it raised.
            ModelLostError: it runs elsewhere and cannot be reached.
        """
        try:
            if isinstance(self._policy, SurveyedPolicy):
                self._policy.survey(site, start, base, parameters)
            self._policy.reset(goal, seed)
        except (Stopped, ModelLostError):
            raise
        except BaseException as error:
            raise self._failed("reset", error) from None
        self._stop.act_now()

    def act(self, observation: Observation) -> Decision:
        """Return the policy's decision on the robot's own observation, of which it sees private copies.

        Raises:
            PolicyFailedError: it raised, or answered with no decision.
            SensorLostError: the observation lacks a sensor of its card.
            ModelLostError: it runs elsewhere and gave no answer in time.
        """
        shown = shown_to_policy(observation, self._sensors)
        try:
            decision = checked_decision(self._policy.act(shown))
        except (Stopped, ModelLostError):
            raise
        except BaseException as error:
            raise self._failed("act", error) from None
        self._stop.act_now()
        return decision

    def _failed(self, where: str, error: BaseException) -> PolicyFailedError:
        """Log the traceback, which is for the policy's author, and return the line that goes into the record.

        Raises:
            Stopped: somebody asked for it meanwhile; what the policy made of that does not count.
        """
        self._stop.act_now()
        if isinstance(error, DecisionError):
            words = error_line(error, named=False)
            return PolicyFailedError(f"{where}: not a decision that can be carried out and recorded: {words}")
        logger.error("model %s failed in %s:\n%s", self._name, where, _traceback(error))
        return PolicyFailedError(f"{where}: {error_line(error, named=type(error) is not ModelError)}")


def _traceback(error: BaseException) -> str:
    try:
        text = "".join(traceback.format_exception(error))
    except BaseException as second:  # an exception can be anything: its attributes too
        return f"(no traceback can be made of it: {type(second).__name__})"
    text = text.encode("utf-8", "backslashreplace").decode("utf-8")
    return text if len(text) <= _LONGEST_TRACEBACK else f"…{text[-_LONGEST_TRACEBACK:]}"
