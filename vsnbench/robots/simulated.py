"""The simulated robot."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.control.command import STANDSTILL, Command, Controller, MotionStatus
from vsnbench.control.leg import Leg
from vsnbench.control.legs import LegPlan, controller_of, refusal
from vsnbench.control.settings import MotionSettings
from vsnbench.errors import RobotError
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.contract import DrivingView, Robot, Watch
from vsnbench.robots.driving_on import LOOK_PERIOD_S, DrivingOn
from vsnbench.robots.simulated_camera import SIMULATED_SENSORS, SimulatedCamera
from vsnbench.robots.simulated_mover import SimulatedMover
from vsnbench.sensing.movement_check import displacement_m, remaining_m
from vsnbench.simulator.dynamics.driven_base import DrivenBase
from vsnbench.simulator.dynamics.noise import NoiseSettings
from vsnbench.simulator.dynamics.physics import CONTROL_PERIOD_S, Touch, simulator_version
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import Site, StartingPosition
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.motion_result import NOT_BEGUN, Collision, CollisionSource, MotionResult
from vsnbench.values.movement import STOP, ActionKind, Drive
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import SIMULATED, RobotIdentity, kind_of_class
from vsnbench.values.robot_profile import IDEAL_BASE, RobotProfile


@dataclass(slots=True)
class _Motion:
    """Begin of a movement, and how far the robot has driven since."""

    movement: Drive
    start: Pose
    start_s: float
    path_m: float = 0.0


class SimulatedRobot(Robot):
    """A robot of a profile in the simulation of a site.

    Simulated time passes only during motion and starts at zero with every episode. The same seed gives the same
    episode, bit by bit. Without `noise`, the only error of odometry is wheel slip. Colours and object labels are
    rendered only if they are in `read`, or if noise depends on them.
    """

    sensors = SIMULATED_SENSORS
    renders_views = True
    drives_on = True

    def __init__(
        self,
        site: Site,
        profile: RobotProfile,
        parameters: ProtocolParameters | None = None,
        noise: NoiseSettings | None = None,
        read: frozenset[Sensor] = sensors,
    ) -> None:
        self.site = site
        self.profile = profile
        self.noise = noise
        self.action_kinds = frozenset({ActionKind.DISCRETE}) | profile.drive_kinds
        self.cameras = frozenset({CameraRole.FRONT, *profile.cameras})
        self.conditions: Mapping[str, Any] = (
            {"simulator": simulator_version()}
            | ({} if noise is None else {"noise": noise.model_dump(mode="json")})
            | ({} if profile.dynamics is None else {"base": profile.dynamics.conditions})
            | profile.tolerance_conditions
        )
        self.settings = MotionSettings.for_robot(profile, parameters)
        scene = build_scene(site)
        dynamics = profile.dynamics or IDEAL_BASE
        self._base = DrivenBase(scene, profile.base, dynamics, None if noise is None else noise.odometry)
        self._camera = SimulatedCamera(scene, site, profile, self._base, noise, read)
        self._mover: SimulatedMover | None = None
        self._physics = self._base.physics
        self._odometry_period_s = 1 / profile.base.odometry_rate_hz
        self._begun = False
        self._motion: _Motion | None = None
        self._driving: DrivingOn | None = None

    @property
    def identity(self) -> RobotIdentity:
        """Profile and kind of the robot. A subclass is another kind."""
        kind = SIMULATED if type(self) is SimulatedRobot else kind_of_class(type(self))
        return RobotIdentity(self.profile, kind, simulated=True, site_sha256=self.site.sha256)

    def begin(self, start: StartingPosition, seed: int) -> None:
        """Start an episode at `start` with odometry, time and target heading at zero.

        Raises:
            RobotError: the robot touches something there.
        """
        drift_seed, depth_seed, other_depth_seed = np.random.SeedSequence(seed).spawn(3)
        self._camera.begin(depth_seed, other_depth_seed)
        self._base.place(start.pose, np.random.default_rng(drift_seed))
        if touch := self._physics.touch():
            raise RobotError(
                f"starting position {start.number} of site {self.site.name} touches {self._name_of(touch)}",
                advice=f"move it away by more than the robot's radius of {self.profile.base.radius_m} m",
            )
        self._odometry = Pose(0.0, 0.0, 0.0)
        self._odometry_stamp_s = 0.0
        self._target_heading_rad = 0.0
        if self.profile.dynamics is not None:
            self._mover = SimulatedMover(self._base, self.profile, self.settings)
            self._odometry = self._mover.reading
        self._driving = None
        self._begun = True

    def observe(self) -> Observation:
        """Return the camera's images and the odometry."""
        self._require_begun()
        self._motion = None
        return self._camera.observe(self._odometry.wrapped)

    def view_from(self, camera: Camera) -> Observation:
        """Return the images of a camera that is mounted otherwise, with noise of its own, and the odometry."""
        self._require_begun()
        return self._camera.observe(self._odometry.wrapped, camera)

    def preview(self) -> npt.NDArray[np.uint8] | None:
        """Return the colours of now; only from the thread that drives the robot."""
        return self._camera.frame()

    def drive(self, movement: Drive, watch: Watch | None = None) -> MotionResult:
        """Execute a movement leg by leg. A contact stops it at once, and so does `watch`."""
        self._require_begun()
        if movement == STOP:
            return MotionResult(completed=True, pose=self._odometry.wrapped)
        self._motion = motion = _Motion(movement, self._odometry, self._physics.time_s)
        if self._mover is not None:
            return self._driven(self._mover, motion, watch)
        if refused := refusal(movement, self.settings):
            return self._measured(motion, MotionResult(completed=False, failure=refused))
        plan = LegPlan(movement, self._odometry, self.settings)
        controller, touch, blocked = None, None, ""
        while (leg := plan.next(self._odometry)) is not None:
            end_rad = leg.end_rad(self._target_heading_rad)
            controller = controller_of(leg, self._odometry, end_rad, self.settings)
            touch, blocked = self._drive_leg(leg, controller, motion, watch)
            if leg.holds_heading:
                self._target_heading_rad = end_rad
            else:
                self._read_odometry(fresh=True)  # for the next leg
                self._target_heading_rad = self._odometry.heading_rad
            if not controller.done:
                break
        failure = "" if blocked else plan.failure if controller is None else controller.failure or plan.failure
        result = MotionResult(
            completed=not failure and not blocked,
            collision=self._collision(touch),
            failure=failure,
            corrections=0 if controller is None else controller.corrections,
            blocked=blocked,
        )
        return self._measured(motion, result)

    def _drive_leg(
        self, leg: Leg, controller: Controller, motion: _Motion, watch: Watch | None
    ) -> tuple[Touch | None, str]:
        """Drive a leg to its end; return the contact that ended it, and why `watch` ended it."""
        command, looked_s = STANDSTILL, -math.inf
        if not leg.translates or leg.is_lateral:  # the camera does not look to the side
            watch = None
        holds_heading = leg.holds_heading
        while controller.status is MotionStatus.MOVING:
            now_s = self._physics.time_s
            if watch is not None and now_s - looked_s >= LOOK_PERIOD_S - CONTROL_PERIOD_S / 2:
                looked_s = now_s
                if blocked := watch(self._driving_view(command, controller.remaining_m)):
                    controller.abort(blocked)
                    self._physics.stop()
                    return None, blocked
            command = controller.step(self._odometry, now_s, self._odometry_stamp_s)
            if holds_heading and controller.status is not MotionStatus.MOVING:
                break  # at rest; between the legs of other movements, a period of zero velocity passes
            before = self._odometry
            touch = self._base.drive(command)
            self._read_odometry()
            if not holds_heading:  # of these movements the path is not reported
                motion.path_m += before.distance_to(self._odometry)
            if touch:
                controller.abort(f"touched {self._name_of(touch)}")
                self._physics.stop()
                return touch, ""
        return None, ""

    def follow(self, movement: Drive, anchor: Pose | None = None) -> None:
        """Replace the running path by another one, from the anchor on."""
        self._on().follow(movement, anchor)

    def advance(self, until_s: float, watch: Watch | None = None) -> MotionResult:
        """Let simulated time pass until a time of this robot's clock, along the running path."""
        return self._on().advance(until_s, watch)

    def come_to_rest(self) -> MotionResult:
        """Brake, and return the motion until the base is at rest."""
        return self._on().come_to_rest()

    def _on(self) -> DrivingOn:
        self._require_begun()
        self._motion = None
        if self._driving is None:
            self._driving = DrivingOn(
                self.settings, self._mover, self._base, self._read_newest, self._driving_view, self._name_of
            )
        return self._driving

    def _read_newest(self, *, fresh: bool = False) -> tuple[Pose, float]:
        """Update the odometry of a base that drives on; return it and its time."""
        if self._mover is not None:
            self._odometry = self._mover.read_now() if fresh else self._mover.reading
            return self._odometry, self._mover.reading_s
        self._read_odometry(fresh=fresh)
        return self._odometry, self._odometry_stamp_s

    def interrupted_motion(self) -> MotionResult | None:
        """Return the odometry's motion since the movement after the last observation began."""
        if self._driving is not None:
            return self._driving.motion()
        if self._motion is None:
            return NOT_BEGUN
        if self._mover is not None:
            self._motion.path_m = self._mover.path_m
        return self._measured(self._motion, MotionResult(completed=False))

    def _driven(self, mover: SimulatedMover, motion: _Motion, watch: Watch | None) -> MotionResult:
        """Execute a movement on a base that is not ideal."""
        blocked, looked_s = "", -math.inf

        def blocked_now() -> str:
            nonlocal blocked, looked_s
            now_s = self._physics.time_s
            is_due = mover.command.linear_m_s and now_s - looked_s >= LOOK_PERIOD_S - CONTROL_PERIOD_S / 2
            if watch is not None and is_due:
                looked_s = now_s
                left_m = remaining_m(motion.movement, motion.start, mover.reading)
                blocked = watch(self._driving_view(mover.command, left_m))
            return blocked

        result = mover.drive(motion.movement, blocked_now)
        self._odometry, motion.path_m = mover.reading, mover.path_m
        touched = self._collision(mover.touch)
        if touched is not None:
            result = replace(result, completed=False, failure=f"touched {touched.touched}")
        return self._measured(
            motion, replace(result, failure="" if blocked else result.failure, collision=touched, blocked=blocked)
        )

    def _measured(self, motion: _Motion, result: MotionResult) -> MotionResult:
        """Return a result with the measured motion since the begin of a movement."""
        self._read_odometry(fresh=True)
        return replace(
            result,
            displacement_m=displacement_m(motion.movement, motion.start, self._odometry),
            turn_rad=self._odometry.heading_rad - motion.start.heading_rad,
            duration_s=self._physics.time_s - motion.start_s,
            pose=self._odometry.wrapped,
            path_m=None if motion.movement.holds_heading else motion.path_m,
        )

    def _collision(self, touch: Touch | None) -> Collision | None:
        return Collision(CollisionSource.CONTACT, self._name_of(touch)) if touch else None

    def _driving_view(self, command: Command, remaining_m: float) -> DrivingView:
        """Return what the depth camera sees now; with noise, if the robot has noise."""
        depth_m, camera = self._camera.measure()
        pose, stamp_s = self._odometry.wrapped, self._physics.time_s
        return DrivingView(depth_m, camera, pose, stamp_s, 0.0, command.linear_m_s, command.angular_rad_s, remaining_m)

    def locate(self) -> Fix:
        """Return the true pose of the base."""
        self._require_begun()
        return Fix(self._physics.pose, PoseSource.SIMULATED)

    def halt(self) -> None:
        """Drop the path of a robot that drives on; otherwise it moves only within `drive`."""
        if self._driving is not None:
            self._driving.halt()

    def close(self) -> None:
        """End the episode."""
        self._begun = False

    def _require_begun(self) -> None:
        if not self._begun:
            raise RobotError("the simulated robot has no pose yet", advice="begin an episode first")

    def _read_odometry(self, *, fresh: bool = False) -> None:
        """Update the odometry, and read it at the rate at which this base sends messages."""
        if self._mover is not None:
            self._odometry = self._mover.reading
            return
        pose = self._base.measure()
        now_s = self._physics.time_s
        due_s = self._odometry_stamp_s + self._odometry_period_s
        if fresh or now_s >= due_s - CONTROL_PERIOD_S / 2:
            self._odometry, self._odometry_stamp_s = pose, now_s

    def _name_of(self, touch: Touch) -> str:
        """Return the ID of the touched object, or the category of the part of the building."""
        return self.site.objects[touch.instance - 1].id if touch.instance else touch.category
