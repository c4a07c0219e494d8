"""A robot over ROS 1 or ROS 2: movements, camera and odometry (paper, Section 3.1.4).

Every wait has a limit, and every exit commands zero velocity. The answer of discrete_move is compared with the
odometry, because upstream's server always answers True.
"""

import logging
import math
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.control.command import STANDSTILL
from vsnbench.control.legs import longest_duration_s
from vsnbench.control.settings import MotionSettings
from vsnbench.errors import RobotError, SensorLostError
from vsnbench.protocol.execution import Execution
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.contract import Robot, Watch
from vsnbench.robots.ros.camera import CAMERA_TIMEOUT_S, RosCamera
from vsnbench.robots.ros.conditions import await_account, conditions_of, require_same_conditions
from vsnbench.robots.ros.image_timing import unfit_while_driving
from vsnbench.robots.ros.link import connect
from vsnbench.robots.ros.movement_runner import MovementRunner
from vsnbench.robots.ros.path_looks import PathLooks
from vsnbench.robots.ros.path_runner import PathRunner
from vsnbench.robots.ros.start import (
    Patience,
    await_fresh_odometry,
    carry_rehearsed_robot,
    place_simulated_robot,
    require_no_hazard,
    wait_until_ready,
)
from vsnbench.robots.ros.watchdog import require_watchdog
from vsnbench.sensing.exchange import Exchange
from vsnbench.sensing.images.camera_images import MotionEnd
from vsnbench.sites.site import StartingPosition
from vsnbench.values.battery import Battery
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import ActionKind, Drive
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import RobotIdentity, SimulationAccount
from vsnbench.values.robot_profile import RobotProfile

logger = logging.getLogger(__name__)

PATIENCE_S = 30.0
"""Time in which the parts of a robot have to answer before an episode."""


_TIMED_S = 2.0
"""Time in which the images of a robot arrive at their rate again, after a pause."""


class RosRobot(Robot):
    """A real robot, or one of `vsnbench robots simulate`; one per process."""

    has_preview = True

    def __init__(
        self,
        profile: RobotProfile,
        parameters: ProtocolParameters | None = None,
        patience_s: float = PATIENCE_S,
    ) -> None:
        self.profile = profile
        parameters = parameters if parameters is not None else ProtocolParameters()
        if (turn_deg := parameters.turn_deg) != round(turn_deg):
            raise RobotError(
                f"discrete_move cannot turn by {turn_deg:g}°",
                advice="set turn_deg to whole degrees",
                code="fractional-turn",
            )
        self._settings = MotionSettings.for_robot(profile, parameters)
        self._patience_s = patience_s
        self._start: Pose | None = None
        self._link = connect(profile)
        self._captured_s = -math.inf
        """Time of the last image of an observation."""
        self.movements = MovementRunner(self._link, self._settings)
        self._paths = PathRunner(self._link, self.movements)
        self._looks: PathLooks | None = None
        self._simulation: SimulationAccount | None = None
        try:
            patience, execution = Patience(patience_s), parameters.execution
            self._link.others_drive = execution is not None and execution.is_by_stack  # its publisher is expected
            wait_until_ready(self._link, patience)
            if self._link.can_be_placed:
                self._link.join_simulation()
                self._simulation = await_account(self._link, profile, patience)
            self.can_be_watched = bool(self._link.names.command)
            self.is_rehearsal = self._simulation is not None and self._simulation.is_rehearsal
            self.needs_operator = self._simulation is None or self.is_rehearsal
            self._camera = RosCamera(self._link, profile)
            self._depth_frames = self._camera.depth_frames
            self.set_execution(execution)
        except BaseException:
            self._link.close()
            raise
        if self._link.can_drive:
            adapter, kinds = self._link.adapter, profile.drive_kinds
            self.action_kinds = (kinds & adapter.movements if adapter else kinds) | {ActionKind.DISCRETE}
        self.cameras = self._camera.roles
        self.sensors = frozenset(
            {Sensor.RGB, Sensor.ODOMETRY}
            | ({Sensor.DEPTH} if self._link.names.depth else set())
            | ({Sensor.INSTANCES} if self._camera.labelled else set())
        )

    def set_execution(self, execution: Execution | None) -> None:
        """Take how the next episodes are executed; see `Robot`.

        Raises:
            RobotError: the images cannot be timed while the robot drives, or the base does not stop by itself.
        """
        self._continuous = execution is not None
        self._by_stack = execution is not None and execution.is_by_stack
        self._link.others_drive = self._by_stack
        self.drives_on = self.can_be_watched if self._by_stack else self._link.follows_paths
        if self._continuous and self.drives_on:
            self._require_timed_images()
        if not self._by_stack:
            require_watchdog(self._link, self.profile)
        frames = min(self._depth_frames, 1) if self._continuous else self._depth_frames  # of a moment, while it drives
        self._camera.depth_frames = frames
        self.conditions: Mapping[str, Any] = conditions_of(self._link, self.profile, self._simulation, frames)

    @property
    def identity(self) -> RobotIdentity:
        """Profile and kind of the robot, and whether a simulator plays it."""
        site = self._simulation.site_sha256 if self._simulation else ""
        return RobotIdentity(self.profile, self._link.kind, simulated=self._simulation is not None, site_sha256=site)

    @property
    def battery(self) -> Battery | None:
        """Last report of the base's battery."""
        return self._link.snapshot().battery

    @property
    def commanded(self) -> tuple[float, float, float] | None:
        """Last velocity of the stack; zero once the base has dropped it."""
        if not self._by_stack:
            return None
        now = self._link.snapshot()
        is_old = time.monotonic() - now.steered_s > self._link.names.command_timeout_s
        sent = STANDSTILL if is_old else now.commanded
        velocity = (sent.linear_m_s, sent.lateral_m_s, sent.angular_rad_s)
        return velocity if all(map(math.isfinite, velocity)) else None

    @property
    def exchange(self) -> Exchange:
        """Topics and actions of other nodes on the robot's network."""
        return self._link.exchange

    @property
    def driven_against(self) -> str:
        """Node that still commanded velocities when the base was last held."""
        return self.movements.driven_against

    def preview(self) -> npt.NDArray[np.uint8] | None:
        """Return the newest camera image; None if there is no new one."""
        return self._camera.preview()

    def wait_until_ready(self) -> None:
        """Wait until every part of the robot answers; see `Robot`."""
        wait_until_ready(self._link, Patience(self._patience_s))

    def begin(self, start: StartingPosition, seed: int) -> None:
        """Start an episode at `start`; the simulator moves a simulated robot there.

        The odometry of the base is not reset; poses are relative to its present value.

        Raises:
            NotPlacedError: a hazard sensor is active.
            RobotError: a part does not answer in time or was replaced, or the robot cannot be at `start`.
        """
        self._start = None
        patience = Patience(self._patience_s)
        wait_until_ready(self._link, patience)
        patience.retry(lambda: require_same_conditions(self._link, self._simulation, self.conditions))
        if not self.needs_operator:
            place_simulated_robot(self._link, start, seed, patience)
        else:
            require_no_hazard(self._link)
        patience.retry(lambda: self._link.begin_episode(min(patience.left_s, 2.0)))
        await_fresh_odometry(self._link, patience)
        self._link.clear_events()
        now = self._link.snapshot()
        assert now.latest is not None  # noqa: S101  # awaited above
        self.movements.begin(now)
        self._paths.begin()
        if self._continuous:
            self._require_timed_images()
            self._camera.capture(self.movements.end, self._paths.captured_at)  # the first answer must not wait for code
        self._start = start.pose

    def simulate_placement(self, start: StartingPosition, seed: int) -> None:
        """Have the simulator put the robot down near its mark; nearer with each call."""
        carry_rehearsed_robot(self._link, start, seed, Patience(self._patience_s))

    def set_start_pose(self, pose: Pose) -> None:
        """Take the measured pose as the start of the estimated trajectory."""
        self._start = pose

    def observe(self) -> Observation:
        """Return images taken after the last motion; the depth is the median of several images.

        Raises:
            SensorLostError: a camera or the odometry is silent, or does not fit the profile.
        """
        self._require_begun()
        movements = self.movements
        movements.before = None
        if not self._continuous:
            return self._camera.capture(movements.end, lambda _: movements.relative(movements.fresh()))
        end = MotionEnd(self._captured_s, -math.inf) if self._paths.measures else movements.end
        observation = self._camera.capture(end, self._paths.captured_at)
        self._captured_s = observation.stamp_s
        return observation

    def drive(self, movement: Drive, watch: Watch | None = None) -> MotionResult:
        """Execute a movement by discrete_move, or by this process, and measure it by the odometry.

        With a watch, the depth images that arrive meanwhile are checked, and a blocked way ends the movement.
        """
        self._require_begun()
        if movement.goes_sideways and ActionKind.SIDESTEP not in self.action_kinds:
            return MotionResult(completed=False, failure="what moves the base executes no movement to the side")
        looks = self._looks_of(watch if movement.is_watched else None)
        return self.movements.run(movement, longest_duration_s(movement, self._settings) + 2.0, looks)

    def _looks_of(self, watch: Watch | None) -> PathLooks | None:
        return PathLooks(self._camera, watch, self.movements.origin) if watch and self._link.names.depth else None

    def now_s(self) -> float | None:
        """Return the time on the clock of the odometry's stamps, which also stamps the images."""
        return self._paths.now_s

    def follow(self, movement: Drive, anchor: Pose | None = None) -> None:
        """Replace the running path by another one, from the anchor on; it begins with `advance`."""
        self._require_begun()
        self._paths.follow(movement, anchor)

    def advance(self, until_s: float, watch: Watch | None = None) -> MotionResult:
        """Drive on until a time on the robot's clock; a thread watches the robot, also between the calls."""
        self._require_begun()
        if watch is None or self._looks is None or self._looks.check is not watch:
            self._looks = self._looks_of(watch)
        return self._paths.advance(until_s, self._looks)

    def come_to_rest(self) -> MotionResult:
        """Brake, and return the motion until the base is at rest."""
        return self._paths.come_to_rest()

    def interrupted_motion(self) -> MotionResult | None:
        """Return the odometry's motion since the movement after the last observation began."""
        return self._paths.taken() if self._paths.measures else self.movements.interrupted()

    def locate(self) -> Fix:
        """Return the pose of the simulator, or the start composed with the odometry."""
        self._require_begun()
        now = self._link.snapshot()
        if not self.needs_operator:
            if now.truth is None or time.monotonic() - now.truth.arrival_s > CAMERA_TIMEOUT_S:
                raise SensorLostError(
                    "the simulator is silent",
                    advice="check that vsnbench robots simulate is running",
                    code="silent-simulator",
                )
            return Fix(now.truth.payload, PoseSource.SIMULATED)
        assert self._start is not None  # noqa: S101  # _require_begun
        return Fix(self._start.compose(self.movements.relative(now)), PoseSource.ESTIMATED)

    def halt(self) -> None:
        """Command zero velocity, and hold it while a movement or a path may be running."""
        self._paths.halt()
        self.movements.halt()

    def close(self) -> None:
        """Halt and leave the network."""
        self._paths.halt()
        self.movements.close()
        self._link.close()

    def _require_timed_images(self) -> None:
        """Make sure that the pose of the robot at the capture of an image is known while it drives.

        Raises:
            RobotError: it is not.
        """
        names = self._link.names
        if not self._link.wait_for(lambda now: unfit_while_driving(names, now) is None, _TIMED_S):
            raise unfit_while_driving(names, self._link.snapshot()) or RobotError("the images arrive irregularly")

    def _require_begun(self) -> None:
        if self._start is None:
            raise RobotError("the robot has no pose yet", advice="begin an episode first", code="not-begun")
