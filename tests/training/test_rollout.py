"""Demonstrations: perturbed, labelled at every step, and the same again from the same seed."""

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest

from tests.training.recipes import TINY
from training.flat_world import FlatWorld, View
from training.recipe import Recipe
from training.rollout import INDEX, Lane, _students_turn, demonstrate, evaluate
from training.shards import STRIPS, UNLABELLED, mirrored
from vsnbench.models.pirlnav.policy import GOALS
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose


@pytest.fixture(scope="module")
def world() -> FlatWorld:
    return FlatWorld(TINY, 10_001)


class Only:
    """A student that knows one action."""

    def __init__(self, action: Action) -> None:
        self.action = action

    def choose(self, lanes: Sequence[Lane], views: Sequence[View]) -> tuple[list[Action], npt.NDArray[np.float16]]:
        return [self.action] * len(lanes), np.arange(len(lanes), dtype=np.float16)[:, None]


def test_demonstrations_are_knocked_off_their_way_and_still_end_with_stop(world: FlatWorld) -> None:
    plan = Recipe(name="r").demonstrations.model_copy(update={"episodes": 6, "lanes": 6, "perturbed_share": 0.1})
    shard = demonstrate(world, plan, np.random.default_rng(3)).shard
    last = np.append(np.flatnonzero(shard.begins)[1:] - 1, len(shard) - 1)
    assert (shard.expert[last] == INDEX[Action.STOP]).sum() >= 5
    took, wished = shard.previous[1:][~shard.begins[1:]], shard.expert[:-1][~shard.begins[1:]]
    assert (took != wished + 1).any()
    assert (shard.expert != UNLABELLED).mean() > 0.95
    assert shard.image(0).shape == (64, 64, 3)
    assert sorted(set(shard.goals.tolist())) == sorted(GOALS.values())


def test_what_is_in_view_is_told_with_its_nearness(world: FlatWorld) -> None:
    goal, number = "bed", GOALS["bed"]
    pose, search = world.draw_start(goal, np.random.default_rng(1)), world.search(goal)
    while True:
        view = world.look(pose)
        search.look(pose, view.in_view)
        action = search.action_at(pose)
        assert action is not None
        if action is Action.STOP:
            break
        pose = world.lattice.after(pose, action)
    shares = view.labels[: STRIPS * len(GOALS)].reshape(len(GOALS), STRIPS)
    assert shares[number].max() > 0.3
    assert view.labels[STRIPS * len(GOALS) + number] > 1 / (1 + 1.5)


def test_a_mirror_swaps_left_and_right(world: FlatWorld) -> None:
    view = world.look(world.draw_start("bed", np.random.default_rng(1)))
    labels = view.labels.astype(np.float32)
    image, turned = mirrored(view.rgb, labels)
    assert np.array_equal(image[:, 0], view.rgb[:, -1])
    assert turned[0] == labels[STRIPS - 1]
    assert turned[-1] == labels[-6]
    again = mirrored(*mirrored(view.rgb, labels))
    assert np.array_equal(again[0], view.rgb)
    assert np.array_equal(again[1], labels)


def test_the_same_seed_gives_the_same_demonstrations(world: FlatWorld) -> None:
    plan = TINY.demonstrations.model_copy(update={"max_actions": 6})
    one, other = (demonstrate(world, plan, np.random.default_rng(9)).shard for _ in range(2))
    assert np.array_equal(one.images, other.images)
    assert np.array_equal(one.expert, other.expert)


def test_a_student_drives_by_turns_and_its_features_are_kept(world: FlatWorld) -> None:
    whole = {"student_actions": 30, "expert_actions": 1, "perturbed_share": 0.0, "max_actions": 30}
    plan = TINY.demonstrations.model_copy(update=whole)
    given = demonstrate(world, plan, np.random.default_rng(3), Only(Action.TURN_LEFT))
    assert given.features is not None
    assert len(given.features) == len(given.shard)
    took, wished = given.shard.previous[1:][~given.shard.begins[1:]], given.shard.expert[:-1][~given.shard.begins[1:]]
    other = took != wished + 1
    assert other.any()
    assert (took[other] == 1 + INDEX[Action.TURN_LEFT]).all()
    assert given.shard.images.size == 0


def test_a_student_that_stops_at_once_is_driven_on_by_the_demonstrator(world: FlatWorld) -> None:
    plan = TINY.demonstrations.model_copy(update={"max_actions": 150})
    shard = demonstrate(world, plan, np.random.default_rng(3), Only(Action.STOP)).shard
    last = np.append(np.flatnonzero(shard.begins)[1:] - 1, len(shard) - 1)
    assert (shard.expert[last] == INDEX[Action.STOP]).sum() >= 3
    outcome = evaluate(world, 6, Only(Action.STOP), np.random.default_rng(3), 150)
    assert (outcome.stops, outcome.actions) == (6, 6)


def test_student_and_demonstrator_change_places(world: FlatWorld) -> None:
    plan = TINY.demonstrations.model_copy(update={"student_actions": 4, "expert_actions": 4, "max_actions": 60})
    lane, rng, turns = Lane("bed", Pose(0, 0), Pose(0, 0)), np.random.default_rng(0), []
    for _ in range(60):
        turns.append(_students_turn(lane, plan, rng))
        lane.steps += 1
    runs = [len(list(group)) for _, group in itertools.groupby(turns)]
    assert len(runs) > 10
    assert max(runs) <= 4
    assert 15 < sum(turns) < 45
