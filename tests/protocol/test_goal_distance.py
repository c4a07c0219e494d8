"""Distance to a goal's nearest visible footprint, and the region where STOP succeeds."""

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.judge import distance_to_goal, stop_succeeds, success_region
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.sites.geometry.line_of_sight import Sight, sight
from vsnbench.sites.geometry.walls import wall_shapes
from vsnbench.sites.site import Door, Room, Site, SiteObject, StartingPosition, Wall, load_site
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.pose import Pose

PAPER = ProtocolParameters()
THROUGH_WALLS = ProtocolParameters(version=1)


def site_with(*objects: SiteObject) -> Site:
    corners = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]
    return Site(
        name="hall",
        rooms=[Room(name="hall", polygon=corners)],
        walls=[Wall(start=corners[0], end=corners[1])],
        objects=list(objects),
        starts=[StartingPosition(number=1, position=(1, 1), heading_deg=0)],
    )


def chair(number: int, x_m: float, y_m: float, size_m: float = 0.5, category: str = "chair") -> SiteObject:
    return SiteObject(id=f"{category}-{number}", category=category, position=(x_m, y_m), size_m=(size_m, size_m, 1.0))


def standing_at(x_m: float, y_m: float) -> Fix:
    return Fix(Pose(x_m, y_m, 1.0), PoseSource.SIMULATED)


def test_distance_is_measured_to_the_footprint_and_not_to_the_centre() -> None:
    measured = distance_to_goal(site_with(chair(1, 5, 5, size_m=2.0)), "chair", standing_at(3.1, 5), PAPER)
    assert measured.distance_m == pytest.approx(0.9)


def test_distance_is_measured_to_a_turned_footprint() -> None:
    thing = chair(1, 5, 5, size_m=2.0).model_copy(update={"heading_deg": 45.0})
    measured = distance_to_goal(site_with(thing), "chair", standing_at(3, 5), PAPER)
    assert measured.distance_m == pytest.approx(2 - 2**0.5)


def test_distance_is_measured_to_a_surveyed_outline_before_the_box() -> None:
    outlined = chair(1, 5, 5).model_copy(update={"footprint": [(4.0, 4.0), (6.0, 4.0), (5.0, 6.0)]})
    measured = distance_to_goal(site_with(outlined), "chair", standing_at(5, 3), PAPER)
    assert measured.distance_m == pytest.approx(1.0)


def test_the_nearest_of_several_instances_counts_and_is_named() -> None:
    measured = distance_to_goal(site_with(chair(1, 8, 8), chair(2, 3, 1)), "chair", standing_at(1, 1), PAPER)
    assert (measured.instance, measured.distance_m) == ("chair-2", pytest.approx(1.75))


def test_an_object_of_another_category_does_not_count() -> None:
    measured = distance_to_goal(
        site_with(chair(1, 1.5, 1, category="table"), chair(1, 5, 1)), "chair", standing_at(1, 1), PAPER
    )
    assert measured.distance_m == pytest.approx(3.75)


def test_a_robot_inside_the_footprint_is_at_no_distance() -> None:
    assert distance_to_goal(site_with(chair(1, 5, 5)), "chair", standing_at(5, 5), PAPER).distance_m == 0


def test_a_goal_that_the_site_lacks_has_no_distance() -> None:
    with pytest.raises(ValueError, match="no toilet"):
        distance_to_goal(site_with(chair(1, 5, 5)), "toilet", standing_at(1, 1), PAPER)


PLANT = SiteObject(id="plant-1", category="plant", position=(4.45, 2.0), size_m=(0.5, 0.5, 1.0))
"""The goal's near side is 0.15 m behind the face of the wall between the rooms."""


def two_rooms(*doors: Door, objects: tuple[SiteObject, ...] = (PLANT,)) -> Site:
    """Two rooms of 4 m x 4 m side by side, a wall of 0.1 m between them at x = 4."""
    corners = [(0.0, 0.0), (8.0, 0.0), (8.0, 4.0), (0.0, 4.0), (0.0, 0.0)]
    return Site(
        name="two-rooms",
        rooms=[
            Room(name="left", polygon=[(0, 0), (4, 0), (4, 4), (0, 4)]),
            Room(name="right", polygon=[(4, 0), (8, 0), (8, 4), (4, 4)]),
        ],
        walls=[*(Wall(start=one, end=other) for one, other in pairwise(corners)), Wall(start=(4, 0), end=(4, 4))],
        doors=list(doors),
        objects=list(objects),
        starts=[StartingPosition(number=1, position=(1, 2), heading_deg=0)],
    )


def test_a_goal_behind_a_wall_is_out_of_sight_however_near() -> None:
    measured = distance_to_goal(two_rooms(), "plant", standing_at(3.6, 2.0), PAPER)
    assert (measured.in_sight, measured.distance_m) == (False, pytest.approx(0.6))
    assert not measured.is_under(1.0)


def test_the_first_version_of_the_protocol_measures_through_walls() -> None:
    measured = distance_to_goal(two_rooms(), "plant", standing_at(3.6, 2.0), THROUGH_WALLS)
    assert measured.distance_m == pytest.approx(0.6)
    assert measured.is_under(1.0)


def test_an_open_door_is_looked_through_and_a_closed_one_is_not() -> None:
    door = Door(name="door", start=(4, 1.6), end=(4, 2.4))
    assert distance_to_goal(two_rooms(door), "plant", standing_at(3.6, 2.0), PAPER).is_under(1.0)
    shut = door.model_copy(update={"closed": True})
    assert not distance_to_goal(two_rooms(shut), "plant", standing_at(3.6, 2.0), PAPER).is_under(1.0)


def test_furniture_does_not_hide_a_goal() -> None:
    wardrobe = SiteObject(id="wardrobe", category="wardrobe", position=(5.0, 2.0), size_m=(0.4, 3.0, 2.2))
    measured = distance_to_goal(two_rooms(objects=(PLANT, wardrobe)), "plant", standing_at(5.4, 2.0), PAPER)
    assert measured == distance_to_goal(two_rooms(), "plant", standing_at(5.4, 2.0), PAPER)
    assert measured.is_under(1.0)


def test_a_goal_half_hidden_is_as_far_as_its_nearest_point_in_sight() -> None:
    """Through a door next to it, the line to the visible part of the plant touches the jamb."""
    door = Door(name="door", start=(4, 2.5), end=(4, 3.4))
    here = (3.7, 3.0)
    measured = distance_to_goal(two_rooms(door), "plant", standing_at(*here), PAPER)
    straight = PLANT.shape.distance(shapely.Point(here))
    assert straight + 0.01 < measured.distance_m < straight + 0.2
    seen = sight(two_rooms(door)).walls
    outline = shapely.get_coordinates(shapely.segmentize(PLANT.shape.boundary, 0.001))
    ways = [math.dist(here, each) for each in outline if not seen.intersects(shapely.LineString([here, each]))]
    assert measured.distance_m == pytest.approx(min(ways), abs=2e-3)


def test_a_nearer_instance_behind_a_wall_gives_way_to_one_in_sight() -> None:
    other = SiteObject(id="plant-2", category="plant", position=(2.0, 2.0), size_m=(0.4, 0.4, 1.0))
    measured = distance_to_goal(two_rooms(objects=(PLANT, other)), "plant", standing_at(3.6, 2.0), PAPER)
    assert (measured.instance, measured.distance_m, measured.in_sight) == ("plant-2", pytest.approx(1.4), True)


def test_nobody_looks_through_a_crack_of_the_survey() -> None:
    site = two_rooms()
    cracked = [*site.walls[:-1], Wall(start=(4, 0), end=(4, 1.945)), Wall(start=(4, 2.055), end=(4, 4))]
    measured = distance_to_goal(site.model_copy(update={"walls": cracked}), "plant", standing_at(3.6, 2.0), PAPER)
    assert not measured.in_sight


def test_the_shortest_way_leads_to_where_the_goal_is_in_sight() -> None:
    """Without visibility, STOP succeeds behind the wall; with it, the path goes through the door."""
    site = two_rooms(Door(name="door", start=(4, 3.0), end=(4, 3.9)))
    space, start = free_space(site, 0.177), Pose(3.6, 1.2)
    assert space.geodesic_to_goal_m(start, "plant", THROUGH_WALLS) == 0.0
    assert 1.5 < space.geodesic_to_goal_m(start, "plant", PAPER) < 2.5


def test_stop_at_once_is_named_by_the_instance_it_would_succeed_at() -> None:
    assert stop_succeeds(two_rooms(), "plant", Pose(3.6, 2.0), THROUGH_WALLS) == "plant-1"
    assert stop_succeeds(two_rooms(), "plant", Pose(3.6, 2.0), PAPER) is None
    assert stop_succeeds(two_rooms(), "plant", Pose(5.0, 2.0), PAPER) == "plant-1"
    assert stop_succeeds(two_rooms(), "toilet", Pose(5.0, 2.0), PAPER) is None


@settings(deadline=None, max_examples=150)
@given(
    st.floats(0.1, 9.9), st.floats(0.1, 7.4), st.sampled_from(["chair", "table", "bed", "toilet", "monitor", "plant"])
)
def test_the_region_of_success_is_where_the_judge_finds_it(x_m: float, y_m: float, goal: str) -> None:
    site, here = load_site("apartment"), shapely.Point(x_m, y_m)
    region = success_region(site, goal, PAPER)
    assume(region.boundary.distance(here) > 0.02)
    assume(sight(site).walls.distance(here) > 0.02)
    assert region.covers(here) == distance_to_goal(site, goal, standing_at(x_m, y_m), PAPER).is_under(1.0)


@settings(deadline=None, max_examples=60)
@given(st.floats(0.1, 7.9), st.floats(0.1, 3.9), st.floats(0.1, 2.9))
def test_in_sight_no_distance_is_shorter_and_every_line_of_it_is_clear(x_m: float, y_m: float, jamb_m: float) -> None:
    site = two_rooms(Door(name="door", start=(4, jamb_m), end=(4, jamb_m + 0.9)))
    here = shapely.Point(x_m, y_m)
    assume(not sight(site).walls.contains(here))
    straight = PLANT.shape.distance(here)
    seen_m = sight(site).distance_m((x_m, y_m), PLANT.shape)
    assert seen_m >= straight
    outline = shapely.get_coordinates(shapely.segmentize(PLANT.shape.boundary, 0.01))
    lines = shapely.linestrings(np.stack([np.broadcast_to((x_m, y_m), outline.shape), outline], axis=1))
    clear = ~shapely.intersects(shapely.union_all(wall_shapes(site)).buffer(-1e-3), lines)
    brute_m = float(np.min(shapely.length(lines)[clear], initial=math.inf))
    if PLANT.shape.covers(here):
        assert seen_m == 0
    elif math.isfinite(brute_m):
        assert seen_m == pytest.approx(brute_m, abs=0.02)
    else:
        assert not math.isfinite(seen_m) or seen_m > straight + 1e-3


def test_what_is_plainly_behind_walls_is_out_of_sight_by_its_shadows_too(monkeypatch: pytest.MonkeyPatch) -> None:
    site, random = load_site("apartment"), np.random.default_rng(3)
    places = [(float(x), float(y)) for x, y in random.uniform((0.2, 0.2), (9.8, 7.3), (25, 2))]

    def measured(goal: str) -> list[float]:
        return [distance_to_goal(site, goal, standing_at(x_m, y_m), PAPER).distance_m for x_m, y_m in places]

    quick = [measured(goal) for goal in ("chair", "plant", "bed")]
    monkeypatch.setattr(Sight, "_is_behind_walls", lambda *_: False)
    assert [measured(goal) for goal in ("chair", "plant", "bed")] == quick
