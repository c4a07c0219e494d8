"""The client's link to a motion adapter: the connection, which may be renewed, and the odometry of an episode."""

import contextlib
import os
import time

from vsnbench.control.settings import MotionSettings
from vsnbench.errors import RobotError, SensorLostError
from vsnbench.models.remote.vsnbench_policy import TOKEN_VARIABLE
from vsnbench.robots.adapter.connection import AdapterConnection
from vsnbench.robots.adapter.interface import adapter_interface
from vsnbench.robots.adapter.messages import AdapterState, problem_in
from vsnbench.sensing.odometry.odometry import OdometryTracker
from vsnbench.sites.site import StartingPosition
from vsnbench.values.battery import Battery
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import RobotProfile

IMAGES_S = 10.0
"""Time for images, or for a placement; a simulator may compile before its first."""
_REST_S = 2.0
"""Longest wait for a robot that rolls on after the answer."""
_LARGEST_SEED = 0x7FFF_FFFF_FFFF_FFFF


class AdapterLink:
    """Connects to the adapter of a profile, and again if the connection broke."""

    def __init__(self, profile: RobotProfile, settings: MotionSettings) -> None:
        """Connect.

        Raises:
            RobotError: the adapter does not answer, is none, speaks another version, or simulates another robot.
        """
        self._profile = profile
        self._settings = settings
        self._address = adapter_interface(profile).address
        self._connection = AdapterConnection(self._address, _token())
        self.card = self._connection.card
        account = self.card.simulation
        if account is not None and account.profile_sha256 != profile.sha256:
            self.close()
            raise RobotError(
                f"the adapter at {self._address} simulates another robot than {profile.name}, by the content of its "
                "profile",
                advice="start it with the profile of the run",
                code="other-simulated-robot",
            )
        self.battery: Battery | None = None
        self._origin = Pose(0.0, 0.0)
        self.forget_odometry()

    def live(self) -> AdapterConnection:
        """Return the open connection, or a new one to the same adapter.

        Raises:
            RobotError: the adapter does not answer, or is another one now.
        """
        if self._connection.is_open:
            return self._connection
        connection = AdapterConnection(self._address, _token())
        if connection.card != self.card:
            connection.close()
            raise RobotError(
                f"the adapter at {self._address} is now {connection.card} with another card, and "
                f"was {self.card} when this session began",
                advice="restart the session, which begins another campaign, or the former adapter",
                code="other-adapter",
            )
        self._connection = connection
        return connection

    def stop(self) -> None:
        """Tell the adapter to stop the robot, from any thread; one that has lost its client stops by itself."""
        if self._connection.is_open:
            with contextlib.suppress(RobotError):
                self._connection.stop()

    def close(self) -> None:
        """Stop the robot and disconnect."""
        self.stop()
        self._connection.close()

    def place(self, start: StartingPosition, seed: int) -> None:
        """Have a simulator put the robot at a start.

        Raises:
            RobotError: the robot cannot be there, or the adapter does not answer.
        """
        pose = [start.pose.x_m, start.pose.y_m, start.pose.heading_rad]
        answer = self.live().request("place", IMAGES_S, pose=pose, seed=seed & _LARGEST_SEED)
        self.forget_odometry()
        if problem := problem_in(answer):
            raise RobotError(
                f"the robot cannot be at starting position {start.number}: {problem}", code="cannot-be-placed"
            )

    def begin(self, seed: int) -> AdapterState:
        """Start an episode, whose poses are relative to the present one; return the present state.

        Raises:
            RobotError: the adapter does not answer.
        """
        self.live().request("begin", seed=seed & _LARGEST_SEED)
        self.forget_odometry()
        state = self.read()
        self._origin = self._origin.compose(self.pose)
        return state

    def forget_odometry(self) -> None:
        """Accept any odometry next: the robot was carried."""
        base = self._profile.base
        self._tracker = OdometryTracker(base.max_linear_m_s, base.max_angular_rad_s)

    def read(self) -> AdapterState:
        """Return the state of now.

        Raises:
            SensorLostError: the odometry is not sound.
            RobotError: the adapter does not answer.
        """
        state = AdapterState.of(self.live().request("state"))
        self.take(state)
        return state

    def take(self, state: AdapterState) -> Pose:
        """Take a state; return its odometry since the start of the episode, with an unwrapped heading.

        Raises:
            SensorLostError: the odometry has jumped.
        """
        self.battery = state.battery or self.battery
        if fault := self._tracker.add(*state.pose, state.stamp_s, time.monotonic()):
            raise SensorLostError(fault.text, advice="check the odometry of the adapter", code="invalid-odometry")
        return self.pose

    @property
    def pose(self) -> Pose:
        """Newest odometry since the start of the episode."""
        assert self._tracker.latest is not None  # noqa: S101  # a state was taken
        return self._tracker.latest.pose.relative_to(self._origin)

    def pose_at_rest(self) -> tuple[Pose, float]:
        """Return the pose once the odometry repeats, and its stamp; a base with a lag rolls on after its answer.

        The clock of a simulator that stands still has no more to say.
        """
        simulated, settings = self.card.simulation is not None, self._settings
        state, pose = self.read(), self.pose
        give_up_s = time.monotonic() + _REST_S
        while time.monotonic() < give_up_s:
            time.sleep(0.0 if simulated else settings.settle_s)
            before, stamp_s = pose, state.stamp_s
            state = self.read()
            pose = self.pose
            moved_m, turned_rad = pose.distance_to(before), abs(pose.heading_rad - before.heading_rad)
            if (simulated and state.stamp_s == stamp_s) or (
                moved_m < settings.position_tolerance_m and turned_rad < settings.heading_tolerance_rad
            ):
                break
        return pose, state.stamp_s


def _token() -> str:
    return os.environ.get(TOKEN_VARIABLE, "")
