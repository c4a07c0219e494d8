"""The base class of robots, simulated or real."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType, TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.execution import Execution
from vsnbench.sensing.exchange import Exchange
from vsnbench.sites.site import StartingPosition
from vsnbench.values.battery import Battery
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.fix import Fix
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import ActionKind, Drive
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import RobotIdentity


@dataclass(frozen=True, slots=True, eq=False)
class DrivingView:
    """What a robot sees and does while it drives, or before it leaves its position."""

    depth_m: npt.NDArray[np.float32]
    """(H, W) newest raw depth image, metres, NaN where invalid."""
    camera: Camera
    pose: Pose
    """Odometry at the capture of the image, relative to the start of the episode."""
    stamp_s: float
    """Time of the capture on the robot's clock."""
    age_s: float
    """Time since the capture."""
    linear_m_s: float
    angular_rad_s: float
    """Both are 0 for a robot that is about to leave its position."""
    remaining_m: float
    """Distance that this leg of the movement still has to cover; infinity if unknown."""

    @property
    def turns_on_the_spot(self) -> bool:
        """Whether the robot turns without leaving its position, which needs no free way."""
        return not self.linear_m_s and bool(self.angular_rad_s)


Watch = Callable[[DrivingView], str]
"""Returns why the robot must not drive on, or an empty string."""

CameraPreview = Callable[[], npt.NDArray[np.uint8] | None]
"""Returns a robot's newest camera image, as `Robot.preview`."""
BatteryReader = Callable[[], Battery | None]
"""Returns a robot's newest battery report, as `Robot.battery`."""


class Robot(ABC):
    """A mobile base with a camera that executes one movement at a time.

    Every method may raise RobotError. A subclass sets `sensors`, and overrides the attributes below whose default does
    not fit. A robot is a context manager: leaving it calls `close`.
    """

    sensors: frozenset[Sensor]
    """Sensors in its observations."""

    cameras: frozenset[CameraRole] = frozenset({CameraRole.FRONT})
    """Roles of the cameras in its observations."""

    conditions: Mapping[str, Any] = MappingProxyType({})
    """What else results depend on, as JSON by name. Trials under other conditions belong to another campaign.

    Names in use: `noise` (settings of the simulated noise), `simulator` (its version), `base` (how a simulated base
    differs from an ideal one), `odometry_rate_hz`, `rate_factor`, `depth_frames`, `adapter` (name and version of a
    motion adapter).
    """

    action_kinds: frozenset[ActionKind] = frozenset({ActionKind.DISCRETE})
    """Kinds of a model's answer that it executes. A discrete action is a `Move` with the sizes of the protocol."""

    drives_on: bool = False
    """Whether it can drive while a model thinks. Only a base that takes velocity commands can. If False, it need not
    implement `follow`, `advance` and `come_to_rest`: continuous execution is refused before the first trial."""

    can_be_watched: bool = False
    """Whether a stack can drive it, which commands velocities itself: `advance` is then called without `follow`."""

    needs_operator: bool = False
    """Whether an operator must put the robot at the start of every episode, before `begin`."""

    is_rehearsal: bool = False
    """Whether the robot simulates being placed by an operator: `simulate_placement` moves it to its mark."""

    renders_views: bool = False
    """Whether `view_from` renders what a camera that is mounted otherwise would see; only in simulation."""

    has_preview: bool = False
    """Whether `preview` returns images while the robot drives."""

    @property
    @abstractmethod
    def identity(self) -> RobotIdentity:
        """Profile and kind of the robot; constant while it is open."""

    @property
    def battery(self) -> Battery | None:
        """Last battery report; None if there is none. Read from any thread."""
        return None

    @property
    def commanded(self) -> tuple[float, float, float] | None:
        """Velocity that a stack commands now: ahead and to the left in m/s, turn in rad/s.

        None if no stack drives, or if it is not known.
        """
        return None

    @property
    def exchange(self) -> Exchange | None:
        """Topics and actions on its network, by which a stack is told goals; None without such a network."""
        return None

    @property
    def driven_against(self) -> str:
        """Node that kept commanding velocities after the robot was last brought to rest; empty if none did."""
        return ""

    def set_execution(self, execution: Execution | None) -> None:
        """Take how the next episodes are executed, which decides `drives_on`; None for stop-and-go.

        Called before `begin` in a study, whose arms may be models and stacks. Does nothing by default.
        """

    def wait_until_ready(self) -> None:
        """Wait until every part of the robot answers. Called before the operator is asked to place the robot.

        Raises:
            RobotError: a part does not answer; the message says what to start.
        """

    def simulate_placement(self, start: StartingPosition, seed: int) -> None:
        """Move the robot near its mark, as an operator would. Called only if `is_rehearsal` is True.

        A further call for the same mark moves the robot nearer to it.

        Raises:
            RobotError: the robot cannot be there.
        """
        raise NotImplementedError(f"{type(self).__name__}.simulate_placement")

    def keep_real_time(self) -> None:
        """Let simulated movements take as long as on a real robot. Called if an operator is present.

        Does nothing by default. Only a rehearsal needs it: without an operator to practise, faster is better.
        """

    @abstractmethod
    def begin(self, start: StartingPosition, seed: int) -> None:
        """Start an episode at `start` with odometry at zero.

        A simulated robot moves there; a robot with `needs_operator` has been put there.

        Raises:
            NotPlacedError: the robot is not placed correctly, and an operator can correct that.
            RobotError: the robot cannot start.
        """

    def set_start_pose(self, pose: Pose) -> None:
        """Take the measured pose, in the site's frame, as the start of the estimated trajectory.

        Called after `begin` and before the first action, if the pose was measured. Does nothing by default.
        """

    @abstractmethod
    def observe(self) -> Observation:
        """Return new measurements, taken after the last motion ended."""

    def view_from(self, camera: Camera) -> Observation:
        """Return what another camera at the robot's pose would see; its images depend on no earlier call.

        Called only if `renders_views` is True, after `observe`, for disturbances that move the camera.
        """
        raise NotImplementedError(f"{type(self).__name__}.view_from")

    @abstractmethod
    def drive(self, movement: Drive, watch: Watch | None = None) -> MotionResult:
        """Execute one movement to its end and return the measured motion.

        Called only with kinds in `action_kinds`. A robot for discrete actions receives a `Move` that turns or drives,
        or `STOP`, which does neither. Its `holds_heading` says that a turn goes to the last target plus the angle: a
        robot that turns accurately may ignore it.

        A robot with a depth camera calls `watch` with the newest image before each leg that leaves its position, and at
        the rate of its camera while it drives. When `watch` returns a reason, the robot stops at once and returns it as
        `MotionResult.blocked`.

        Args:
            movement: in the robot's frame.
            watch: decides whether the way ahead is free; None for an action that was checked before it began.
        """

    def now_s(self) -> float | None:
        """Return the time on the clock of `Observation.stamp_s`; None where time passes only in motions.

        Called only if `drives_on` is True. On a real robot time passes while a model thinks.
        """
        return None

    def follow(self, movement: Drive, anchor: Pose | None = None) -> None:
        """Replace the running path without a stop, and return at once; time passes in `advance`.

        Called only if `drives_on` is True, which `vsnbench run` checks before the first trial. The movement is a
        `Waypoint`, a `Trajectory` or a `Velocity`.

        Args:
            movement: in the frame of `anchor`.
            anchor: odometry at the capture of the image that the movement answers; None for the present pose.
        """
        raise NotImplementedError(f"{type(self).__name__}.follow")

    def advance(self, until_s: float, watch: Watch | None = None) -> MotionResult:
        """Drive on until a time on the robot's clock, and return the motion since the call.

        Where time passes between two calls, the motion is that since the last call, or since the capture of the first
        image. `watch` then also checks the way between the calls.

        Called only if `drives_on` is True, like `follow`.

        At the end of its path the robot stops and waits. When `watch` returns a reason, it stops, drops the path and
        waits; the result has the reason as `blocked`. A contact or a failure ends the call before the time is over.

        Args:
            until_s: on the clock of `Observation.stamp_s`.
            watch: called at the rate of the camera before and while the robot leaves its position.
        """
        raise NotImplementedError(f"{type(self).__name__}.advance")

    def come_to_rest(self) -> MotionResult:
        """Drop the path, brake within the accelerations of the base, and return the motion once it is at rest.

        Called only if `drives_on` is True, like `follow`. A contact ends it at once.
        """
        raise NotImplementedError(f"{type(self).__name__}.come_to_rest")

    def interrupted_motion(self) -> MotionResult | None:
        """Return what was measured since `drive` after the last `observe`; None if it is not known.

        Called after `halt`, if a request to stop has interrupted the motion. The result is not completed;
        it is `NOT_BEGUN` if the motion had not begun.
        """
        return None

    @abstractmethod
    def locate(self) -> Fix:
        """Return the robot's pose in the site. Used for judging; the model never receives it."""

    def preview(self) -> npt.NDArray[np.uint8] | None:
        """Return the newest camera image (H, W, 3), or None if there is no new one.

        Called from any thread, during motions too, if `has_preview` is True. If `drives_on` is True, also called
        between two calls of `advance`, from their thread, for a film.
        """
        return None

    @abstractmethod
    def halt(self) -> None:
        """Command zero velocity. Safe at any time, repeatedly and from any thread."""

    def close(self) -> None:
        """Halt and release all resources."""
        self.halt()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
