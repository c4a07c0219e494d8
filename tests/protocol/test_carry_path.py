"""The path on which a person moves the robot to its mark is short and crosses no wall."""

import math

import shapely

from vsnbench.protocol.carry_path import carry_path
from vsnbench.protocol.free_space import free_space
from vsnbench.sites.site import load_site
from vsnbench.values.pose import Pose

APARTMENT = load_site("apartment")
SPACE = free_space(APARTMENT, 0.177)


def test_the_way_leads_through_the_doors_and_touches_nothing() -> None:
    walls = shapely.union_all([wall.shape for wall in APARTMENT.walls])
    doors = shapely.union_all([door.centre_line.buffer(0.3) for door in APARTMENT.doors])
    there, mark = APARTMENT.start(8).pose, APARTMENT.start(2).pose
    way = carry_path(SPACE, there, mark)
    assert way[0] == there.position
    assert way[-1] == mark.position
    assert not shapely.LineString(way).intersects(walls.difference(doors))
    length = shapely.LineString(way).length
    assert math.dist(there.position, mark.position) < length < 15


def test_there_is_no_way_into_a_wall() -> None:
    wall = APARTMENT.walls[0].centre_line.centroid
    assert carry_path(SPACE, APARTMENT.start(8).pose, Pose(wall.x, wall.y)) == []
