"""The baselines without search: `random` and `forward`."""

from collections import Counter

import pytest

from tests.models.looks import look
from vsnbench.models.baselines.forward import ForwardUntilBlocked
from vsnbench.models.baselines.random_walk import RandomWalk
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose


def random_actions(seed: int, count: int = 50) -> list[Action]:
    policy = RandomWalk()
    policy.reset("chair", seed)
    return [policy.act(look()).action for _ in range(count)]


def test_the_same_seed_gives_the_same_actions() -> None:
    assert random_actions(3) == random_actions(3)
    assert random_actions(3) != random_actions(4)


def test_a_reset_forgets_the_last_episode() -> None:
    policy = RandomWalk()
    policy.reset("chair", 3)
    for _ in range(7):
        policy.act(look())
    policy.reset("chair", 3)
    assert [policy.act(look()).action for _ in range(50)] == random_actions(3)


def test_random_draws_the_four_actions_about_equally_often() -> None:
    count = Counter(random_actions(11, 4000))
    assert set(count) == {Action.STOP, Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT}
    assert all(850 < number < 1150 for number in count.values())


def test_forward_goes_straight_where_the_way_is_free() -> None:
    policy = ForwardUntilBlocked()
    policy.reset("chair", 0)
    assert [policy.act(look(Pose(0.25 * step, 0), 3.0)).action for step in range(20)] == [Action.MOVE_FORWARD] * 20


def test_forward_turns_to_one_side_until_the_depth_image_is_free() -> None:
    policy = ForwardUntilBlocked()
    policy.reset("chair", 0)
    turns = {policy.act(look(depth_m=0.45)).action for _ in range(4)}
    assert len(turns) == 1
    assert turns <= {Action.TURN_LEFT, Action.TURN_RIGHT}
    assert policy.act(look(depth_m=3.0)).action is Action.MOVE_FORWARD


@pytest.mark.parametrize("seed", range(4))
def test_forward_turns_when_its_move_did_not_move(seed: int) -> None:
    """Odometry shows that the robot did not move, although the depth image does not."""
    policy = ForwardUntilBlocked()
    policy.reset("chair", seed)
    assert policy.act(look(depth_m=3.0)).action is Action.MOVE_FORWARD
    assert policy.act(look(depth_m=3.0)).action.turns
    later = [policy.act(look(depth_m=3.0)).action for _ in range(8)]
    assert Action.MOVE_FORWARD in later


def test_forward_never_stops() -> None:
    policy = ForwardUntilBlocked()
    policy.reset("chair", 0)
    assert Action.STOP not in {policy.act(look(depth_m=0.3 + 0.1 * (step % 9))).action for step in range(150)}
