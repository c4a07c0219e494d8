"""Stages, visibility and clearance of a course in two rooms, against hand-computed values."""

import math

import pytest

from tests.protocol.test_free_space import DOOR, RADIUS_M, two_rooms
from vsnbench.protocol.course import Approach, CourseMap, Stage
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.sites.site import Door
from vsnbench.values.pose import Pose

FIELD_OF_VIEW_DEG = 60.0


def ground(door: Door | None = DOOR, field_of_view_deg: float | None = FIELD_OF_VIEW_DEG) -> CourseMap:
    return CourseMap(two_rooms(door), RADIUS_M, field_of_view_deg, ProtocolParameters())


def approach(*poses: Pose, of: CourseMap | None = None) -> Approach:
    found = (of or ground()).approach("sofa", poses)
    assert found is not None
    return found


AWAY, TOWARDS, HALF, NEAR = (Pose(1, 2, math.pi), Pose(1, 2, 0), Pose(3.7, 2, math.pi), Pose(6.5, 2, math.pi))


@pytest.mark.parametrize(
    ("poses", "succeeded", "stage"),
    [
        ((AWAY,), False, Stage.NONE),
        ((AWAY, TOWARDS, AWAY), False, Stage.SEEN),
        ((AWAY, HALF, AWAY), False, Stage.APPROACHED),
        ((AWAY, NEAR, AWAY), False, Stage.REACHED),
        ((AWAY, NEAR), True, Stage.STOPPED),
    ],
)
def test_the_furthest_stage_at_any_pose_counts(poses: tuple[Pose, ...], succeeded: bool, stage: Stage) -> None:
    assert approach(*poses).stage(succeeded) is stage


def test_with_an_unknown_camera_the_stage_is_unknown_until_the_robot_approaches() -> None:
    blind = ground(field_of_view_deg=None)
    assert approach(TOWARDS, of=blind).stage(succeeded=False) is None
    assert approach(AWAY, HALF, of=blind).stage(succeeded=False) is Stage.APPROACHED


def test_a_goal_is_in_view_within_the_field_of_view_and_not_through_a_closed_door() -> None:
    headings = [0.0, 29.0, 31.0, -29.0]
    looks = [Pose.from_degrees(3.0, 2.0, heading) for heading in headings]
    seen = approach(*looks).in_view
    assert seen is not None
    assert seen.tolist() == [True, True, False, True]
    hidden = approach(*looks, of=ground(DOOR.model_copy(update={"closed": True}))).in_view
    assert hidden is not None
    assert not hidden.any()


def test_the_way_left_and_being_there_are_those_of_the_judge() -> None:
    found = approach(Pose(1, 2), Pose(6.05, 2), Pose(6.15, 2))
    assert found.remaining_m == pytest.approx([5.1, 0.05, 0.0], abs=0.03)
    assert found.reached.tolist() == [False, False, True]


def test_clearance_is_measured_from_the_edge_of_the_base_along_the_whole_path() -> None:
    """The outer wall's face is at y = 0.05; the two poses are 0.6 m and 0.35 m from it."""
    found_m = ground().clearances_m([Pose(1, 0.65), Pose(3, 0.65), Pose(3, 0.4)])
    assert found_m.min() == pytest.approx(0.4 - 0.05 - RADIUS_M)
    assert found_m.max() == pytest.approx(0.65 - 0.05 - RADIUS_M)
    assert len(found_m) == 1 + 2.25 / 0.05
    still_m = ground().clearances_m([Pose(1, 0.65)] * 40)
    assert still_m.tolist() == [pytest.approx(0.6 - RADIUS_M)]


def test_turning_on_the_spot_does_not_weigh_in_the_percentile() -> None:
    moving = [Pose(1, 0.65), Pose(3.5, 0.65)]
    turning = [Pose(1, 0.65)] + [Pose(3.5, 0.65, turn / 10) for turn in range(60)]
    assert ground().clearances_m(moving).tolist() == ground().clearances_m(turning).tolist()


def test_nothing_is_known_without_poses_or_of_a_goal_that_the_site_lacks() -> None:
    assert not len(ground().clearances_m([]))
    assert ground().approach("sofa", []) is None
    assert ground().approach("toilet", [TOWARDS]) is None


def test_what_is_ahead_of_a_robot_is_named() -> None:
    facing = ground()
    assert facing.solid_ahead(Pose(1, 0.05 + RADIUS_M + 0.1, -math.pi / 2)) == "wall"
    assert facing.solid_ahead(Pose(7.1 - RADIUS_M - 0.1, 2.0, 0.0)) == "sofa"
    assert facing.solid_ahead(Pose(2, 2, 0.0)) == ""
