"""Sidesteps are refused where an obstacle was seen, and where nothing was seen."""

import pytest

from tests.robots.test_simulated_drive import ROOM
from tests.sensing.stand import LEGGED
from vsnbench.protocol.parameters import DepthGuard, ProtocolParameters
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.depth_guard import Refusal
from vsnbench.runner.episode.local_map import REMEMBERED_M, LocalMap
from vsnbench.runner.episode.side_guard import SideGuard
from vsnbench.sites.site import Site, SiteObject, StartingPosition
from vsnbench.values.movement import Move, Sidestep, Velocity

CAMERA = LEGGED.camera.model_copy(
    update={"width": 160, "height": 120, "horizontal_fov_deg": 90.0, "mount_height_m": 0.3, "depth_min_m": 0.2}
)
PROFILE = LEGGED.model_copy(update={"camera": CAMERA})
BOX = SiteObject(id="box-1", category="box", position=(0.2, 0.85), heading_deg=0, size_m=(0.4, 0.4, 0.4))


class Walk:
    """A robot in a room and the guard that sees what it sees."""

    def __init__(self, *things: SiteObject, start: tuple[float, float] = (-1.0, 0.0), guard: DepthGuard | None = None):
        self.robot = SimulatedRobot(Site.model_validate(ROOM.model_dump() | {"objects": things}), PROFILE)
        self.robot.begin(StartingPosition(number=1, position=start, heading_deg=0.0), 1)
        parameters = ProtocolParameters(depth_guard=guard or DepthGuard())
        self.map = LocalMap(PROFILE, parameters.depth_guard)
        self.guard = SideGuard(PROFILE.base, parameters, self.map)
        self.map.observe(self.robot.observe())

    def drive(self, *movements: Move | Sidestep | Velocity) -> "Walk":
        for movement in movements:
            assert self.robot.drive(movement).completed
            self.map.observe(self.robot.observe())
        return self


AHEAD = [Move(0.25)] * 5


def test_a_way_that_was_never_seen_is_refused_on_both_sides() -> None:
    walk = Walk()
    for left_m in (0.25, -0.25):
        reading = walk.guard.reading(left_m)
        assert reading.refusal is Refusal.UNSEEN
        assert reading.valid_share < 0.9


def test_a_way_that_was_seen_while_driving_past_it_is_free() -> None:
    walk = Walk().drive(*AHEAD)
    assert not walk.guard.reading(0.25).blocked
    walk.drive(Sidestep(0.25))
    assert not walk.guard.reading(-0.25).blocked, "the robot has just come from there"


def test_an_obstacle_beside_the_robot_is_remembered_and_the_other_side_is_free() -> None:
    walk = Walk(BOX).drive(*AHEAD)
    reading = walk.guard.reading(0.5)
    assert (reading.refusal, reading.side) == (Refusal.OBSTACLE, "left")
    assert reading.nearest_m == pytest.approx(0.65 - PROFILE.base.radius_m, abs=0.1)
    assert not walk.guard.reading(-0.25).blocked


LEFT, RIGHT = Velocity(0.1, 0.0, 2.0, 0.25), Velocity(0.1, 0.0, 2.0, -0.25)


def test_a_velocity_to_the_side_is_refused_towards_an_obstacle_and_where_nothing_was_seen() -> None:
    walk = Walk(BOX)
    assert walk.guard.reading_of(LEFT).refusal is Refusal.UNSEEN
    walk.drive(*AHEAD)
    reading = walk.guard.reading_of(LEFT)
    assert (reading.refusal, reading.side) == (Refusal.OBSTACLE, "left")
    assert reading.nearest_m == pytest.approx(0.65 - PROFILE.base.radius_m, abs=0.1)
    assert not walk.guard.reading_of(RIGHT).blocked
    assert not walk.guard.reading_of(Velocity(0.3, 0.5, 1.0)).blocked, "not to the side: the guard ahead decides"
    walk.drive(Sidestep(0.25))
    assert walk.guard.reading_of(Velocity(0.0, 0.0, 1.0, 0.2)).refusal is Refusal.OBSTACLE
    assert not walk.guard.reading_of(Velocity(0.0, 0.0, 1.0, -0.2)).blocked, "it may leave an obstacle that is near"


def test_what_was_seen_long_ago_is_forgotten() -> None:
    walk = Walk(start=(-2.5, 0.0)).drive(*AHEAD)
    assert not walk.guard.reading(0.25).blocked
    walk.drive(*[Move(-0.1), Move(0.1)] * (round(REMEMBERED_M / 0.2) + 1))
    assert walk.guard.reading(0.25).refusal is Refusal.UNSEEN


def test_a_guard_that_is_off_refuses_nothing() -> None:
    assert not Walk(guard=DepthGuard(enabled=False)).guard.reading(0.25).blocked
