"""A model's permissions are fixed when it is loaded; a model that exceeds its time is lost."""

import signal
import threading
from typing import Any

import pytest

from tests.models.remote.servers import look
from vsnbench.errors import ModelError, ModelLostError
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.loaded import LoadedPolicy
from vsnbench.models.registry import create_policy
from vsnbench.values.decision import Decision
from vsnbench.values.movement import Action
from vsnbench.values.observation import Sensor


class Sleeper(Policy):
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


class SwallowingSleeper(Sleeper):
    def act(self, observation: Any) -> Decision:
        try:
            return super().act(observation)
        except BaseException:
            return Decision(Action.MOVE_FORWARD)


@pytest.mark.parametrize("kind", [Sleeper, SwallowingSleeper])
def test_an_action_that_takes_too_long_is_lost_and_the_next_episode_goes_on(kind: type[Sleeper]) -> None:
    policy = LoadedPolicy(kind(), 0.1)
    policy.reset("chair", 1)
    with pytest.raises(ModelLostError, match=r"no answer within 0\.1 s"):
        policy.act(look())
    policy.reset("chair", 0)
    assert policy.act(look()).action is Action.STOP
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_a_model_that_is_closed_was_closed_itself() -> None:
    inner = Sleeper()
    LoadedPolicy(inner, 1.0).close()
    assert inner.closed


class Growing(Policy):
    """Sets the survey and all sensors in its card after it has been loaded."""

    def __init__(self) -> None:
        self.card = ModelCard("growing", sensors=frozenset({Sensor.RGB}))

    def reset(self, goal: str, seed: int) -> None:
        self.needs_survey = True
        self.card = ModelCard("growing", sensors=frozenset(Sensor))

    def act(self, observation: Any) -> Decision:
        return Decision(Action.STOP)


def test_what_a_model_is_handed_is_decided_when_it_is_loaded() -> None:
    policy = LoadedPolicy(Growing())
    policy.reset("chair", 1)
    assert policy.policy.needs_survey
    assert not policy.needs_survey
    assert policy.card.sensors == {Sensor.RGB}
    assert LoadedPolicy(create_policy("oracle")).needs_survey


class Pretending(Growing):
    """Raises an error that only a remote model may raise."""

    def act(self, observation: Any) -> Decision:
        raise ModelLostError("\x1b[31m" + 1_000_000 * "x")


def test_a_model_in_this_process_cannot_be_lost_by_its_own_word() -> None:
    with pytest.raises(ModelError, match=r"ModelLostError: \\x1b\[31mx") as raised:
        LoadedPolicy(Pretending()).act(look())
    assert len(str(raised.value)) < 1000
    with pytest.raises(ModelLostError):
        LoadedPolicy(Pretending(), remote=True).act(look())
