"""The demonstrator searches by what was in view, and only then goes for the goal."""

import numpy as np
import pytest

from tests.training.recipes import TINY
from training.explorer import Search
from training.flat_world import FlatWorld
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose


@pytest.fixture(scope="module")
def world() -> FlatWorld:
    return FlatWorld(TINY, 10_001)


def follow(world: FlatWorld, search: Search, pose: Pose, until: int = 150) -> tuple[Pose, list[Action], list[bool]]:
    """Let the demonstrator drive; return where it ends, its actions, and whether the goal was found before each."""
    actions, found = [], []
    while len(actions) < until:
        search.look(pose, world.look(pose).in_view)
        found.append(bool(search.found))
        action = search.action_at(pose)
        assert action is not None
        actions.append(action)
        if action is Action.STOP:
            break
        pose = world.lattice.after(pose, action)
    return pose, actions, found


@pytest.mark.parametrize("goal", ["sofa", "bed", "toilet"])
def test_it_finds_goals_that_are_not_in_view_at_the_start(world: FlatWorld, goal: str) -> None:
    rng, hidden = np.random.default_rng(4), 0
    for _ in range(4):
        pose, actions, found = follow(world, world.search(goal), world.draw_start(goal, rng))
        assert actions[-1] is Action.STOP
        assert world.goal_distance_m(goal, pose) < 1.0
        hidden += not found[0]
    assert hidden


def test_before_the_goal_is_in_view_its_whereabouts_change_nothing(world: FlatWorld) -> None:
    start = world.draw_start("toilet", np.random.default_rng(7))
    _, one, found = follow(world, world.search("toilet"), start, until=40)
    blind = Search(world.search("toilet").survey, frozenset({-1}), world.search("toilet").half_view_rad)
    _, other, _ = follow(world, blind, start, until=40)
    searched = found.index(True) if True in found else 40
    assert searched > 5
    assert one[:searched] == other[:searched]


def test_it_begins_by_turning_until_it_has_looked_around(world: FlatWorld) -> None:
    start = world.draw_start("toilet", np.random.default_rng(7))
    _, actions, found = follow(world, world.search("toilet"), start, until=14)
    assert not any(found[:6])
    assert actions[:6] == [Action.TURN_LEFT] * 6


def test_patches_behind_the_robot_or_behind_a_wall_are_not_seen(world: FlatWorld) -> None:
    survey = world.search("bed").survey
    search = Search(survey, frozenset(), world.search("bed").half_view_rad)
    pose = world.draw_start("bed", np.random.default_rng(1))
    search.look(pose, ())
    here = survey.patch_at(pose)
    assert search.seen[here]
    assert not search.seen[~survey.in_sight[here]].any()
    off = np.abs(np.angle(np.exp(1j * (survey.bearing_rad[here] - pose.heading_rad))))
    behind = off > np.pi / 2
    behind[here] = False
    assert behind.any()
    assert not search.seen[behind].any()


def test_the_lookouts_together_overlook_nearly_all_of_the_floor(world: FlatWorld) -> None:
    survey = world.search("bed").survey
    assert survey.around[survey.lookouts].any(axis=0).mean() > 0.9
    assert len(survey.lookouts) < 20
