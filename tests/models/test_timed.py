"""A policy that takes too long is lost, in this process as far as Python allows."""

import signal
import threading
from typing import Any

import pytest

from tests.models.remote.servers import look
from vsnbench.errors import ModelLostError
from vsnbench.models.contract import ModelCard, SurveyedPolicy
from vsnbench.models.registry import create_policy
from vsnbench.models.timed import timed
from vsnbench.protocol.actions import Action
from vsnbench.protocol.decision import Decision


class Sleeper:
    card = ModelCard("sleeper")

    def __init__(self) -> None:
        self.never = threading.Event()
        self.closed = False

    def reset(self, goal: str, seed: int) -> None:
        self.sleeps = seed > 0

    def act(self, observation: Any) -> Decision:
        if self.sleeps:
            self.never.wait(60)
        return Decision(Action.STOP)

    def close(self) -> None:
        self.closed = True


def test_an_action_that_takes_too_long_is_lost_and_the_next_episode_goes_on() -> None:
    inner = Sleeper()
    policy = timed(inner, 0.1)
    policy.reset("chair", 1)
    with pytest.raises(ModelLostError, match=r"no answer within 0\.1 s"):
        policy.act(look())
    policy.reset("chair", 0)
    assert policy.act(look()).action is Action.STOP
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_the_rest_of_the_policy_is_as_it_was() -> None:
    inner = Sleeper()
    policy = timed(inner, 1.0)
    assert policy.card is inner.card
    assert not isinstance(policy, SurveyedPolicy)
    policy.close()  # type: ignore[attr-defined]
    assert inner.closed
    assert isinstance(timed(create_policy("oracle"), 1.0), SurveyedPolicy)
