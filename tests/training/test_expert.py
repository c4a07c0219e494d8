"""The guide that answers at every pose agrees with the oracle that plans from one."""

import numpy as np
import pytest

from tests.training.recipes import TINY
from training.expert import guide_to_instance, guide_to_place
from training.flat_world import FlatWorld
from vsnbench.models.baselines.goal_views import ViewCriteria, target_poses, view_points
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose

SEED = 10_001


@pytest.fixture(scope="module")
def world() -> FlatWorld:
    return FlatWorld(TINY, SEED)


@pytest.mark.parametrize("goal", ["chair", "bed", "toilet"])
def test_following_it_reaches_the_goal_in_about_as_few_actions_as_the_planner(world: FlatWorld, goal: str) -> None:
    lattice, height_m = world.lattice, world.camera.mount_height_m
    guides = [guide_to_instance(lattice, thing, height_m) for thing in world.site.instances(goal)]
    points = view_points(lattice.space, goal, ViewCriteria(0.8, height_m))
    wanted = target_poses(lattice.space, lattice.planner, points, np.radians(25))
    rng = np.random.default_rng(5)
    for _ in range(2):
        start = pose = world.draw_start(goal, rng)
        guide, actions = min(guides, key=lambda each: each.ticks_from(start)), 0
        while (action := guide.action_at(pose)) is not Action.STOP and actions < 150:
            assert action is not None
            before, pose = pose, lattice.after(pose, action)
            assert pose != before
            actions += 1
        planned = lattice.planner.plan(start, wanted)
        assert world.goal_distance_m(goal, pose) < 1.0
        assert planned is not None
        assert abs(actions - len(planned)) <= 3 + 0.2 * len(planned)


def test_a_place_is_reached_facing_anywhere(world: FlatWorld) -> None:
    space = world.lattice.space
    target = world.draw_start("bed", np.random.default_rng(2))
    guide = guide_to_place(world.lattice, *space.cell_of(*target.position), within_m=0.3)
    pose, actions = world.draw_start("bed", np.random.default_rng(8)), 0
    while (action := guide.action_at(pose)) is not Action.STOP and actions < 150:
        assert action is not None
        pose = world.lattice.after(pose, action)
        actions += 1
    assert np.hypot(pose.x_m - target.x_m, pose.y_m - target.y_m) <= 0.35


def test_no_way_is_known_from_where_nothing_can_be_reached(world: FlatWorld) -> None:
    nowhere = guide_to_place(world.lattice, 0, 0, within_m=0.0)
    assert nowhere.action_at(world.draw_start("bed", np.random.default_rng(0))) is None
    assert nowhere.action_at(Pose(0.0, 0.0)) is None
