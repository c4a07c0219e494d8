"""`models check` finds common violations of the policy contract."""

import numpy as np
import pytest

from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.contract_check import check_policy
from vsnbench.values.action import Action
from vsnbench.values.decision import Decision
from vsnbench.values.observation import Sensor

TURNS = (Action.TURN_LEFT, Action.TURN_RIGHT)


class Sound(Policy):
    card = ModelCard("sound", goals=frozenset({"chair"}), sensors=frozenset({Sensor.DEPTH}))

    def reset(self, goal, seed):
        if goal != "chair":
            raise ValueError(f"unknown goal {goal}")
        self.random = np.random.default_rng(seed)

    def act(self, observation):
        assert observation.depth_m is not None
        return Decision(TURNS[int(self.random.integers(2))])


class Unseeded(Sound):
    def reset(self, goal, seed):
        super().reset(goal, seed)
        self.random = np.random.default_rng()


class Remembering(Sound):
    episodes = 0

    def reset(self, goal, seed):
        super().reset(goal, seed + self.episodes // 6)
        self.episodes += 1


class TakesEveryGoal(Sound):
    def reset(self, goal, seed):
        self.random = np.random.default_rng(seed)


class OneSize(Sound):
    def act(self, observation):
        assert observation.depth_m.shape[1] == 640, "this network is built for 640 columns"
        return super().act(observation)


class NeedsDepth(Sound):
    def act(self, observation):
        return Decision(TURNS[int(np.nanargmax(observation.depth_m[0, :2]))])


class Wordy(Sound):
    def act(self, observation):
        super().act(observation)
        return "left"


class Untyped(Sound):
    def act(self, observation):
        super().act(observation)
        return Decision("FLY")


def failed(policy) -> dict[str, str]:
    return {finding.what: finding.seen for finding in check_policy(policy) if not finding.passed}


def test_a_sound_policy_passes_everything() -> None:
    assert failed(Sound()) == {}


@pytest.mark.parametrize(
    ("policy", "what", "seen"),
    [
        (Unseeded, "same seed, same actions", "differs for the same seed and images"),
        (Remembering, "episodes are independent", "differs after another episode"),
        (TakesEveryGoal, "unknown goal", "although the card lists goals"),
        (OneSize, "other image sizes", "33 x 17: AssertionError: this network is built for 640 columns"),
        (NeedsDepth, "black image, no depth", "All-NaN slice"),
        (Wordy, "same seed, same actions", "Decision"),
        (Untyped, "same seed, same actions", "action must be an Action or a movement, got a str"),
    ],
)
def test_a_fault_is_found_and_said(policy, what, seen) -> None:
    assert seen in failed(policy())[what]


def test_an_error_that_is_its_own_cause_is_told_like_any_other() -> None:
    class Ring(Sound):
        def act(self, observation):
            error = ValueError("round and round")
            raise error from error

    assert "round and round" in failed(Ring())["sensors on the card"]


def test_what_a_model_raises_is_told_with_the_line_of_its_own_code() -> None:
    class Misspelt(Sound):
        def act(self, observation):
            return Decision(Action["FLY"])  # raised in the standard library, asked for here

    line = Misspelt.act.__code__.co_firstlineno + 1
    assert failed(Misspelt())["same seed, same actions"] == f"KeyError: 'FLY' (test_contract_check.py, line {line})"


def test_a_sensor_that_is_never_read_is_pointed_out() -> None:
    class Idle(Sound):
        def act(self, observation):
            return Decision(Action.STOP)

    found = {finding.what: finding for finding in check_policy(Idle())}["sensors on the card"]
    assert found.passed
    assert "depth on the card but not read" in found.seen
