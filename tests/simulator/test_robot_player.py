"""A simulated robot in real time, for any middleware: placements, commands and its account."""

import math

import pytest

from tests.simulator.places import square_room, turtlebot2
from vsnbench.control.command import Command
from vsnbench.simulator.dynamics.noise import NoiseSettings
from vsnbench.simulator.robot_player import BATTERY_FULL_H, RobotPlayer, SimulationOptions, battery_share
from vsnbench.sites.site import SiteObject
from vsnbench.values.camera import CameraRole
from vsnbench.values.robot_profile import BaseDynamics

ROOM = square_room(
    6.0, SiteObject(id="bed-1", category="bed", position=(1.0, 1.0), size_m=(1.0, 1.0, 0.5)), start=(4.0, 4.0)
)


class Outlet:
    """Records when the robot is lifted; the player is not started, so nothing else is published."""

    def __init__(self) -> None:
        self.lifted: list[bool] = []

    def publish_lifted(self, lifted: bool) -> None:
        self.lifted.append(lifted)


@pytest.fixture
def outlet() -> Outlet:
    return Outlet()


@pytest.fixture
def player(outlet: Outlet) -> RobotPlayer:
    return played(outlet)


def played(outlet: Outlet, *, is_rehearsal: bool = False) -> RobotPlayer:
    options = SimulationOptions(
        noise=NoiseSettings(), dynamics=BaseDynamics(dead_time_s=0.1), is_rehearsal=is_rehearsal
    )
    return RobotPlayer(ROOM, turtlebot2(), options, outlet, 30.0, 0.6)


def test_a_placement_is_exact_and_not_a_lift(player: RobotPlayer, outlet: Outlet) -> None:
    assert player.put_down(3.0, 4.0, 1.0, -7) == ""
    assert (player._base.pose.position, player._base.pose.heading_rad) == ((3.0, 4.0), 1.0)
    assert outlet.lifted == [], "a wheel drop that comes late would end the episode"


def test_a_simulated_operator_lifts_the_robot(outlet: Outlet) -> None:
    assert played(outlet, is_rehearsal=True).put_down(3.0, 4.0, 1.0, -7) == ""
    assert outlet.lifted == [True, False]


def test_the_battery_discharges_to_zero() -> None:
    shares = [battery_share(hours * 3600) for hours in (0, 1, 100)]
    assert shares == [0.9, pytest.approx(0.9 - 1 / BATTERY_FULL_H), 0.0]


def test_a_placement_in_contact_is_refused(player: RobotPlayer) -> None:
    assert player.put_down(1.0, 1.0, 0.0, 0) == "it touches bed-1 there"


@pytest.mark.parametrize("spoilt", [(math.nan, 0, 0), (0, math.inf, 0), (0, 0, math.nan)])
def test_an_invalid_pose_is_refused_without_a_lift(player: RobotPlayer, outlet: Outlet, spoilt) -> None:
    before = player._base.pose
    assert player.put_down(*spoilt, 0) == "the pose must be finite"
    assert (player._base.pose, outlet.lifted) == (before, [])


@pytest.mark.parametrize("spoilt", [Command(math.nan, 0.0), Command(0.0, math.inf)])
def test_a_velocity_that_is_not_finite_is_ignored(player: RobotPlayer, spoilt: Command) -> None:
    player.set_command(spoilt)
    for _ in range(20):
        player._base.advance()
    assert player._base.command == Command()
    assert player._base.pose.position == pytest.approx((4.0, 4.0), abs=1e-6)


def test_the_account_describes_the_simulation(player: RobotPlayer) -> None:
    account = player.account
    assert (account.site, account.site_sha256) == (ROOM.name, ROOM.sha256)
    assert account.profile_sha256 == turtlebot2().sha256
    assert account.odometry_rate_hz == turtlebot2().base.odometry_rate_hz
    assert {"base", "noise"} <= set(account.conditions)
    assert player.categories == {1: "bed"}


def test_only_watched_cameras_are_rendered(outlet: Outlet) -> None:
    profile = turtlebot2()
    small = profile.camera.model_copy(update={"width": 64, "height": 48, "mount_forward_m": 0.0})
    sides = {
        role: small.model_copy(update={"yaw_deg": deg}) for role, deg in ((CameraRole.LEFT, 90), (CameraRole.REAR, 180))
    }
    several = profile.model_copy(update={"camera": small, "cameras": sides})
    player = RobotPlayer(ROOM, several, SimulationOptions(), outlet, 30.0, 0.6)
    for watched in ({CameraRole.FRONT}, {CameraRole.LEFT}, {CameraRole.FRONT, CameraRole.LEFT, CameraRole.REAR}):
        assert set(player._images(frozenset(watched))) == watched
