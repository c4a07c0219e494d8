"""The expert that labels every pose agrees with the oracle that plans from one."""

import numpy as np
import pytest

from tests.training.recipes import TINY
from training.recipe import Recipe
from training.rollout import INDEX, demonstrate
from training.shards import UNLABELLED
from training.twin_world import TwinWorld
from vsnbench.models.goal_views import ViewWish, view_points, wanted_poses
from vsnbench.models.pirlnav.policy import GOALS
from vsnbench.protocol.actions import Action

SEED = 10_001


@pytest.fixture(scope="module")
def world() -> TwinWorld:
    return TwinWorld(TINY, SEED)


def walk(world: TwinWorld, goal: str, rng: np.random.Generator) -> tuple[int, float, int | None]:
    """Follow the expert; return its actions, how far from the goal it stops, and what the planner needs."""
    start = pose = world.draw_start(goal, rng)
    expert, actions = world.expert(goal), 0
    while (action := expert.action_at(pose)) is not Action.STOP and actions < 150:
        assert action is not None
        before, pose = pose, world.lattice.after(pose, action)
        assert pose != before
        actions += 1
    lattice = world.lattice
    points = view_points(lattice.space, goal, ViewWish(0.8, world.camera.mount_height_m))
    planned = lattice.planner.plan(start, wanted_poses(lattice.space, lattice.planner, points, np.radians(25)))
    return actions, world.goal_distance_m(goal, pose), None if planned is None else len(planned)


@pytest.mark.parametrize("goal", ["chair", "bed", "toilet"])
def test_following_it_reaches_the_goal_in_about_as_few_actions_as_the_planner(world: TwinWorld, goal: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(2):
        actions, distance_m, planned = walk(world, goal, rng)
        assert distance_m < 1.0
        assert planned is not None
        assert abs(actions - planned) <= 3 + 0.2 * planned


def test_demonstrations_are_knocked_off_their_way_and_still_end_with_stop(world: TwinWorld) -> None:
    plan = Recipe(name="r").demonstrations.model_copy(update={"episodes": 6, "lanes": 6, "perturbed_share": 0.1})
    shard = demonstrate(world, plan, np.random.default_rng(3))
    last = np.append(np.flatnonzero(shard.begins)[1:] - 1, len(shard) - 1)
    assert (shard.expert[last] == INDEX[Action.STOP]).sum() >= 5
    took, wished = shard.previous[1:][~shard.begins[1:]], shard.expert[:-1][~shard.begins[1:]]
    assert (took != wished + 1).any()
    assert (shard.expert != UNLABELLED).mean() > 0.95
    assert shard.image(0).shape == (64, 64, 3)
    assert sorted(set(shard.goals.tolist())) == sorted(GOALS.values())


def test_what_is_in_view_is_told_with_its_nearness(world: TwinWorld) -> None:
    goal = "bed"
    rng = np.random.default_rng(1)
    pose = world.draw_start(goal, rng)
    while (action := world.expert(goal).action_at(pose)) is not Action.STOP:
        assert action is not None
        pose = world.lattice.after(pose, action)
    labels = world.look(pose).labels
    number = GOALS[goal]
    assert labels[number] > 0.2
    assert labels[len(GOALS) + number] > 1 / (1 + 1.5)


def test_the_same_seed_gives_the_same_demonstrations(world: TwinWorld) -> None:
    plan = TINY.demonstrations.model_copy(update={"max_actions": 6})
    one, other = (demonstrate(world, plan, np.random.default_rng(9)) for _ in range(2))
    assert np.array_equal(one.images, other.images)
    assert np.array_equal(one.expert, other.expert)
