"""Free space of a robot, and its path lengths to a goal."""

import functools
import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from vsnbench.protocol import free_space as free_space_module
from vsnbench.protocol.free_space import RESOLUTION_M, FreeSpace, distance_field_m, free_space
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.sites.geometry.walls import wall_shapes
from vsnbench.sites.site import Door, Room, Site, SiteObject, StartingPosition, Wall, load_site
from vsnbench.values.pose import Pose

RADIUS_M = 0.177


def two_rooms(door: Door | None = None, *objects: SiteObject) -> Site:
    """Two rooms of 4 m x 4 m side by side, the wall between them at x = 4."""
    sofa = SiteObject(id="sofa", category="sofa", position=(7.5, 2.0), size_m=(0.8, 2.0, 0.8))
    return Site(
        name="two-rooms",
        rooms=[
            Room(name="left", polygon=[(0, 0), (4, 0), (4, 4), (0, 4)]),
            Room(name="right", polygon=[(4, 0), (8, 0), (8, 4), (4, 4)]),
        ],
        walls=[
            Wall(start=(0, 0), end=(8, 0)),
            Wall(start=(8, 0), end=(8, 4)),
            Wall(start=(8, 4), end=(0, 4)),
            Wall(start=(0, 4), end=(0, 0)),
            Wall(start=(4, 0), end=(4, 4)),
        ],
        doors=[door] if door else [],
        objects=[sofa, *objects],
        starts=[StartingPosition(number=1, position=(1, 2), heading_deg=0)],
    )


DOOR = Door(name="door", start=(4, 1.6), end=(4, 2.4))


@functools.cache
def apartment_space() -> FreeSpace:
    return free_space(load_site("apartment"), RADIUS_M)


def test_the_way_through_an_open_door_is_straight() -> None:
    space = free_space(two_rooms(DOOR), RADIUS_M)
    assert space.geodesic_to_goal_m(Pose(1, 2), "sofa") == pytest.approx(7.1 - 1.0 - 1.0, abs=0.02)


@pytest.mark.parametrize("door", [None, DOOR.model_copy(update={"closed": True})])
def test_no_path_leads_through_a_wall_or_a_closed_door(door: Door | None) -> None:
    space = free_space(two_rooms(door), RADIUS_M)
    assert space.geodesic_to_goal_m(Pose(1, 2), "sofa") == math.inf


def test_no_path_leads_through_a_door_narrower_than_the_robot() -> None:
    site = two_rooms(DOOR)
    assert math.isfinite(free_space(site, 0.39).geodesic_to_goal_m(Pose(1, 2), "sofa"))
    assert free_space(site, 0.41).geodesic_to_goal_m(Pose(1, 2), "sofa") == math.inf


def test_the_way_around_a_corner_is_the_two_sides_of_it() -> None:
    """With the door in a corner, the path is a straight line to the door's edge and another from there."""
    space = free_space(two_rooms(Door(name="door", start=(4, 3.0), end=(4, 3.9))), RADIUS_M)
    start, reach = Pose(3.0, 0.5), 7.1 - 1.0
    before, after = (4 - 0.05, 3.0 + RADIUS_M), (4 + 0.05, 3.0 + RADIUS_M)
    least = math.dist(start.position, (before[0] - RADIUS_M, 3.0)) + reach - after[0]
    assert least < space.geodesic_to_goal_m(start, "sofa") < least + 0.45


def test_high_objects_and_rugs_are_not_obstacles() -> None:
    cabinet = SiteObject(id="shelf", category="wall_cabinet", position=(2, 2), size_m=(1, 1, 0.5), elevation_m=1.5)
    rug = SiteObject(id="rug", category="rug", position=(2, 2), size_m=(1, 1, 0.01), solid=False)
    table = SiteObject(id="table", category="table", position=(2, 2), size_m=(1, 1, 0.7))
    for thing in (cabinet, rug):
        assert free_space(two_rooms(DOOR, thing), RADIUS_M).clearance_at_m(2, 2) > RADIUS_M
    assert free_space(two_rooms(DOOR, table), RADIUS_M).clearance_at_m(2, 2) == 0


def test_a_goal_that_does_not_exist_is_infinitely_far() -> None:
    assert free_space(two_rooms(DOOR), RADIUS_M).geodesic_to_goal_m(Pose(1, 2), "bed") == math.inf


def test_a_start_already_near_enough_has_no_way_to_go() -> None:
    assert free_space(two_rooms(DOOR), RADIUS_M).geodesic_to_goal_m(Pose(6.5, 2), "sofa") == 0.0


def test_a_start_outside_the_rooms_reaches_nothing() -> None:
    assert free_space(two_rooms(DOOR), RADIUS_M).geodesic_to_goal_m(Pose(-5, 2), "sofa") == math.inf


def test_the_free_space_of_a_site_is_made_once() -> None:
    assert free_space(two_rooms(DOOR), RADIUS_M) is free_space(two_rooms(DOOR), RADIUS_M)
    assert free_space(two_rooms(DOOR), RADIUS_M) is not free_space(two_rooms(DOOR), 0.3)


def test_free_cells_keep_the_robots_radius_from_every_wall() -> None:
    space = apartment_space()
    walls = shapely.union_all(wall_shapes(space.site))
    assert shapely.distance(space.points(space.cells), walls).min() >= RADIUS_M - 1e-9
    assert 0.3 < space.cells.mean() < 0.8


def test_every_start_has_a_way_to_every_goal() -> None:
    space = apartment_space()
    ways = [space.geodesic_to_goal_m(start.pose, goal) for start in space.site.starts for goal in GOALS]
    assert all(0 < way < 15 for way in ways)


GOALS = ("chair", "sofa", "table", "bed", "toilet", "monitor", "plant")
positions = st.tuples(st.floats(0.2, 9.8), st.floats(0.2, 7.3))
goals = st.sampled_from(GOALS)


@settings(deadline=None, max_examples=60)
@given(positions, goals)
def test_no_way_is_shorter_than_the_straight_line(position: tuple[float, float], goal: str) -> None:
    space = apartment_space()
    assume(space.clearance_at_m(*position) >= RADIUS_M)
    nearest = min(thing.shape.distance(shapely.Point(position)) for thing in space.site.instances(goal))
    length = space.geodesic_to_goal_m(Pose(*position), goal)
    assume(math.isfinite(length))  # next to the wardrobe is a free area that a robot cannot reach
    assert length >= max(0.0, nearest - 1.0) - RESOLUTION_M


CLOSED = DOOR.model_copy(update={"closed": True})


@pytest.mark.parametrize("site", [two_rooms(DOOR), two_rooms(CLOSED), load_site("apartment")], ids=lambda one: one.name)
@pytest.mark.parametrize("goal", ["sofa", "plant", "nothing"])
def test_starts_without_a_path_are_those_whose_length_is_infinite(site: Site, goal: str) -> None:
    space, rules = free_space(site, RADIUS_M), ProtocolParameters()
    starts = [Pose(float(x_m), float(y_m)) for x_m in np.arange(-0.5, 10.5, 0.13) for y_m in np.arange(-0.5, 8.5, 0.13)]
    lost = [start for start in starts if math.isinf(space.geodesic_to_goal_m(start, goal, rules))]
    assert space.without_path(starts, goal, rules) == lost
    assert lost


@settings(deadline=None, max_examples=40)
@given(positions, st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), goals)
def test_a_small_step_changes_the_distance_by_no_more_than_the_step(
    position: tuple[float, float], dx: float, dy: float, goal: str
) -> None:
    space = apartment_space()
    moved = (position[0] + dx, position[1] + dy)
    assume(space.clearance_at_m(*position) > RADIUS_M + 0.15)
    one, other = (space.geodesic_to_goal_m(Pose(*each), goal) for each in (position, moved))
    assert abs(one - other) <= math.hypot(dx, dy) + RESOLUTION_M


def test_a_field_over_nothing_but_the_region_is_zero_and_without_a_region_infinite() -> None:
    free = np.ones((5, 5), np.bool_)
    assert (distance_field_m(free, np.full((5, 5), -1.0)) == 0).all()
    assert np.isinf(distance_field_m(free, np.full((5, 5), 1.0))).all()


def test_a_region_that_fills_one_room_is_out_of_reach_from_another() -> None:
    free = np.zeros((6, 9), np.bool_)
    free[1:5, 1:4] = free[1:5, 5:8] = True
    level = np.where(np.arange(9) < 4, -1.0, 1.0) * np.ones((6, 1))
    field = distance_field_m(free, level)
    assert (field[1:5, 1:4] == 0).all()
    assert np.isinf(field[1:5, 5:8]).all()


def test_an_end_in_contact_has_a_way_left_and_a_start_there_has_none() -> None:
    space = free_space(two_rooms(DOOR), RADIUS_M)
    clear, touching, inside = Pose(1, 2), Pose(0.06, 2), Pose(20, 2)
    rules = ProtocolParameters()
    assert space.remaining_m(clear, "sofa", rules) == space.geodesic_to_goal_m(clear, "sofa", rules)
    assert math.isinf(space.geodesic_to_goal_m(touching, "sofa", rules))
    assert space.remaining_m(touching, "sofa", rules) == pytest.approx(7.1 - 1.0 - 0.06, abs=0.05)
    assert math.isinf(space.remaining_m(inside, "sofa", rules))


def test_results_are_cached_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    site = two_rooms(Door(name="door", start=(4, 1.5), end=(4, 2.5)))
    made = FreeSpace(site, RADIUS_M)
    ways = made.geodesic_field_m("sofa", ProtocolParameters())
    monkeypatch.setattr(free_space_module, "distance_field_m", lambda *_: pytest.fail("worked out again"))
    monkeypatch.setattr(FreeSpace, "_clearance_of_all", lambda _: pytest.fail("worked out again"))
    found = FreeSpace(site, RADIUS_M)
    np.testing.assert_array_equal(found.clearance_m, made.clearance_m)
    np.testing.assert_array_equal(found.geodesic_field_m("sofa", ProtocolParameters()), ways)
    with pytest.raises(pytest.fail.Exception):
        FreeSpace(two_rooms(), RADIUS_M)


@pytest.mark.parametrize(("heading_deg", "ahead_m"), [(0, 0.3), (180, math.inf), (60, 0.6)])
def test_the_way_straight_ahead_ends_at_the_first_wall(heading_deg: float, ahead_m: float) -> None:
    """The wall at x = 4 is 0.1 m thick."""
    space = free_space(two_rooms(), RADIUS_M)
    pose = Pose.from_degrees(3.65, 2.0, heading_deg)
    assert space.free_ahead_m(pose) == pytest.approx(ahead_m, abs=2 * RESOLUTION_M)


def test_ways_of_many_positions_are_those_of_each_to_the_bit() -> None:
    space = free_space(two_rooms(DOOR), RADIUS_M)
    places = np.random.default_rng(0).uniform(-0.5, (8.5, 4.5), (2000, 2))  # in the rooms, in walls and outside
    each = [space.geodesic_to_goal_m(Pose(x_m, y_m), "sofa") for x_m, y_m in places.tolist()]
    assert space.geodesics_to_goal_m(places, "sofa", ProtocolParameters()).tolist() == each
    assert 0.5 < np.isfinite(each).mean() < 1
