"""A robot that drives on does not turn into what it has seen before, nor to where it has not looked."""

import pytest

from tests.robots.test_simulated_drive import ROOM
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.contract import DrivingView
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.depth_guard import Refusal
from vsnbench.runner.episode.local_map import REMEMBERED_M, LocalMap
from vsnbench.runner.episode.path_guard import PathGuard
from vsnbench.sites.site import Site, SiteObject, StartingPosition
from vsnbench.values.movement import Move

PARAMETERS = ProtocolParameters()
TURTLEBOT = load_profile("turtlebot2")
CAMERA = TURTLEBOT.camera.model_copy(update={"width": 160, "height": 120})
PROFILE = TURTLEBOT.model_copy(update={"camera": CAMERA})
POST = SiteObject(id="post", category="box", position=(0.05, 0.27), heading_deg=0, size_m=(0.1, 0.1, 1.0))
"""Beside the lane, with 4 cm between its side and that of a robot in the middle of the lane."""


class Drive:
    """A robot in a room, and the guard that sees what it sees."""

    def __init__(self, *things: SiteObject, remembers: bool = True) -> None:
        self.robot = SimulatedRobot(Site.model_validate(ROOM.model_dump() | {"objects": things}), PROFILE)
        self.robot.begin(StartingPosition(number=1, position=(-1.25, 0.0), heading_deg=0.0), 1)
        self.map = LocalMap(PROFILE, PARAMETERS.depth_guard)
        self.guard = PathGuard(PROFILE, PARAMETERS, self.map if remembers else None)

    def ahead(self, distance_m: float) -> "Drive":
        for _ in range(round(distance_m / 0.05)):
            self.map.observe(self.robot.observe())
            assert self.robot.drive(Move(0.05)).completed
        return self

    def stops(self, linear_m_s: float, angular_rad_s: float) -> Refusal | None:
        seen = self.robot.observe()
        assert seen.depth_m is not None
        view = DrivingView(seen.depth_m, seen.camera, seen.pose, seen.stamp_s, 0.0, linear_m_s, angular_rad_s, 3.0)
        reason = self.guard(view)
        assert self.guard.last is not None
        assert bool(reason) is self.guard.last.blocked
        return self.guard.last.refusal


@pytest.mark.parametrize("remembers", [True, False])
def test_a_turn_into_a_post_that_has_left_the_view_is_stopped_by_the_local_map(remembers: bool) -> None:
    drive = Drive(POST, remembers=remembers).ahead(1.15)
    assert drive.stops(0.3, 0.0) is None, "the robot passes it"
    assert drive.stops(0.3, -0.5) is None
    assert drive.stops(0.3, 0.5) is (Refusal.OBSTACLE if remembers else None)
    if remembers:
        assert drive.guard.last is not None
        assert drive.guard.last.side == "left"
        assert "left, as seen before" in drive.guard.last.text


def test_a_robot_may_turn_away_from_what_is_beside_it() -> None:
    drive = Drive(POST).ahead(1.3)
    assert drive.stops(0.3, 0.5) is None, "the post is behind its middle"


@pytest.mark.parametrize("remembers", [True, False])
def test_a_turn_to_where_no_image_has_looked_is_stopped_and_a_straight_way_is_not(remembers: bool) -> None:
    drive = Drive(remembers=remembers)
    assert drive.stops(0.3, 0.0) is None
    assert drive.stops(0.3, 0.1) is None
    for angular_rad_s in (0.5, -0.5):
        assert drive.stops(0.2, angular_rad_s) is (Refusal.UNSEEN if remembers else None)
    drive.ahead(1.0)
    assert drive.stops(0.3, 0.5) is None, "it has seen the way beside it"


def test_a_turn_on_the_spot_and_a_way_back_are_not_checked_but_seen() -> None:
    drive = Drive(POST).ahead(1.15)
    images = len(drive.map._ways)
    for velocity in ((0.0, 0.5), (-0.3, 0.5)):
        seen = drive.robot.observe()
        assert seen.depth_m is not None
        stamp_s = seen.stamp_s + abs(velocity[0]) + 0.1
        assert not drive.guard(DrivingView(seen.depth_m, seen.camera, seen.pose, stamp_s, 0.0, *velocity, 3.0))
    assert len(drive.map._ways) == images + 2


def test_an_image_is_forgotten_after_a_way_and_an_older_image_changes_nothing() -> None:
    drive = Drive(POST).ahead(0.6)
    first = drive.robot.observe()
    drive.map.observe(first)
    assert first.depth_m is not None

    def posts() -> int:
        cells = drive.map.around(first.pose, 1.2)
        return int(cells.occupied[(abs(cells.left_m - 0.27) < 0.1) & (cells.ahead_m > 0.3)].sum())

    assert posts() >= 3
    blind = first.depth_m.copy()
    blind[:] = float("nan")
    where = first.pose
    for k in range(1, 12):
        where = type(where)(where.x_m + 0.2, where.y_m, where.heading_rad)
        assert (posts() > 0) is (0.2 * (k - 1) <= REMEMBERED_M)
        drive.map.add(blind, first.camera, where, first.stamp_s + k)
    drive.map.observe(first)
    assert posts() == 0
