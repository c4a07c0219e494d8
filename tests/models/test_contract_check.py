"""`models check` finds common violations of the policy contract."""

import numpy as np
import pytest

from tests.runner.stand_ins import PROFILE
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.contract_check import check_policy
from vsnbench.values.decision import Decision
from vsnbench.values.goal import GoalKind
from vsnbench.values.movement import Action, ActionKind, Chunk, Velocity, Waypoint
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


class Always(Policy):
    """A policy with one answer, and only the default kinds on its card."""

    card = ModelCard("always")
    answer = Action.TURN_LEFT

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        return Decision(self.answer)


class AlwaysAWaypoint(Always):
    answer = Waypoint(1.0, 0.0)


class AlwaysLooksUp(Always):
    answer = Action.LOOK_UP


class LooksUpInAChunk(Always):
    card = ModelCard("chunks", action_kinds=frozenset({ActionKind.DISCRETE, ActionKind.CHUNK}))
    answer = Chunk((Action.TURN_LEFT, Action.LOOK_UP))


class TooFast(Always):
    card = ModelCard("fast", action_kinds=frozenset({ActionKind.VELOCITY}))
    answer = Velocity(PROFILE.base.max_linear_m_s * 1.1)


class OtherWaypoints(Sound):
    card = ModelCard("unseeded waypoints", action_kinds=frozenset({ActionKind.WAYPOINT}))
    drawn = np.random.default_rng(0)

    def act(self, observation):
        return Decision(Waypoint(1.0, float(self.drawn.uniform())))


class TakesOneKind(Always):
    """A policy that reads what describes a goal of its kind, and can read nothing else."""

    def __init__(self, kind, goals=None):
        self.card = ModelCard("one kind", goal_kinds=frozenset({kind}), goals=goals)

    def reset(self, goal, seed):
        (kind,) = self.card.goal_kinds
        if goal.kind is not kind:
            raise ValueError(f"a goal of kind {goal.kind}")
        if kind is GoalKind.IMAGE:
            assert goal.image.shape[2] == 3
        elif kind is GoalKind.ROUTE:
            assert len(goal.images) > 1
        elif kind is GoalKind.POINT:
            assert len(goal.point) == 2
        elif kind is GoalKind.CATEGORY:
            if self.card.goals is not None and goal not in self.card.goals:
                raise ValueError(f"unknown goal {goal}")
        else:
            assert len(goal.text.split()) > 2


def failed(policy) -> dict[str, str]:
    return {finding.what: finding.seen for finding in check_policy(policy, PROFILE) if not finding.passed}


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
        (AlwaysAWaypoint, "same seed, same actions", "answered with waypoint, but its card states discrete"),
        (AlwaysLooksUp, "same seed, same actions", "answered with LOOK_UP, and no robot tilts its camera"),
        (LooksUpInAChunk, "same seed, same actions", "answered with LOOK_UP, and no robot tilts its camera"),
        (TooFast, "same seed, same actions", "exceeds this base's maximum"),
        (OtherWaypoints, "same seed, same actions", "action 1 differs for the same seed and images"),
    ],
)
def test_a_fault_is_found_and_said(policy, what, seen) -> None:
    assert seen in failed(policy())[what]


@pytest.mark.parametrize("kind", [kind for kind in GoalKind if kind is not GoalKind.SEQUENCE])
def test_a_model_of_one_kind_of_goal_receives_goals_of_this_kind(kind) -> None:
    assert failed(TakesOneKind(kind)) == {}


@pytest.mark.parametrize("words", [{"couch", "tv"}, {"mug", "shoe"}])
def test_a_model_receives_the_words_of_its_own_vocabulary(words) -> None:
    policy = TakesOneKind(GoalKind.CATEGORY, goals=frozenset(words))
    assert failed(policy) == {}
    seen = {finding.what: finding.seen for finding in check_policy(policy)}
    assert set(seen["goals"].split(", ")) == words


def test_a_goal_on_the_card_that_the_model_does_not_take_is_named() -> None:
    class KnowsChairs(Sound):
        card = ModelCard("chairs", goals=frozenset({"chair", "bed"}), sensors=frozenset({Sensor.DEPTH}))

    assert failed(KnowsChairs())["goals"].startswith("goal of kind category, 'bed': ValueError: unknown goal bed")


def test_a_result_is_known_before_the_next_check_runs() -> None:
    class Counting(Sound):
        calls = 0

        def act(self, observation):
            self.calls += 1
            return super().act(observation)

    policy = Counting()
    findings = check_policy(policy)
    assert next(findings).what == "card"
    assert policy.calls == 0
    assert next(findings).what == "goals"
    assert policy.calls == 1


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
