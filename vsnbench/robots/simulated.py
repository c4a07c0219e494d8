"""The simulated robot."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.control.command import STANDSTILL, Command, Controller, MotionStatus
from vsnbench.control.controller import MotionController
from vsnbench.control.law import heading_after
from vsnbench.control.legs import LegPlan
from vsnbench.control.settings import MotionSettings
from vsnbench.errors import RobotError
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.contract import DrivingView, PathCheck, Robot
from vsnbench.robots.simulated_mover import SimulatedMover
from vsnbench.sensing.movement_check import RequestedDrive, displacement_m, distance_along
from vsnbench.sensing.movements import Outcome
from vsnbench.simulator.dynamics.driven_base import DrivenBase
from vsnbench.simulator.dynamics.noise import NoiseSettings, noisy_depth
from vsnbench.simulator.dynamics.physics import CONTROL_PERIOD_S, Touch, simulator_version
from vsnbench.simulator.rendering.renderer import Frame, Renderer
from vsnbench.simulator.rendering.shading import mark_out_of_range
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import Site, StartingPosition
from vsnbench.values.action import Action
from vsnbench.values.camera import Camera
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.motion_result import NOT_BEGUN, Collision, CollisionSource, MotionResult
from vsnbench.values.movement import DRIVE_KINDS, ActionKind, Drive
from vsnbench.values.observation import InstanceImage, Observation, Sensor, observation_of
from vsnbench.values.pose import Pose, wrap_angle
from vsnbench.values.robot_identity import SIMULATED, RobotIdentity, kind_of_class
from vsnbench.values.robot_profile import IDEAL_BASE, RobotProfile

_LOOK_PERIOD_S = 0.1
"""Simulated time between two depth images while a movement with parameters runs."""


@dataclass(slots=True)
class _Motion:
    """Begin of a movement."""

    start: Pose
    start_s: float
    movement: Drive | None = None
    """None for a discrete action."""
    path_m: float | None = None
    """Driven so far, of a movement with parameters."""


class SimulatedRobot(Robot):
    """A robot of a profile in the simulation of a site.

    Simulated time passes only during motion and starts at zero with every episode. The same seed gives the same
    episode, bit by bit. Without `noise`, the only error of odometry is wheel slip. Colours and object labels are
    rendered only if they are in `read`, or if noise depends on them.
    """

    sensors = frozenset({Sensor.RGB, Sensor.DEPTH, Sensor.ODOMETRY, Sensor.INSTANCES})
    action_kinds = frozenset({ActionKind.DISCRETE}) | DRIVE_KINDS
    renders_views = True

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
        self._draws_labels = Sensor.INSTANCES in read or noise is not None
        self._draws_colours = self._draws_labels or Sensor.RGB in read
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
        self._mover: SimulatedMover | None = None
        self._physics = self._base.physics
        self._renderer = Renderer(scene)
        self._shininess = scene.shininess(len(site.objects))
        self._categories = {number: thing.category for number, thing in enumerate(site.objects, start=1)}
        self._odometry_period_s = 1 / profile.base.odometry_rate_hz
        self._begun = False
        self._motion: _Motion | None = None

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
        self._depth_rng = np.random.default_rng(depth_seed)
        self._other_depth_rng = np.random.default_rng(other_depth_seed)
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
        self._begun = True

    def observe(self) -> Observation:
        """Return the camera's images and the odometry."""
        self._require_begun()
        self._motion = None
        return self._view(self.profile.camera.without_roll, self._depth_rng)

    def view_from(self, camera: Camera) -> Observation:
        """Return the images of a camera that is mounted otherwise, with noise of its own, and the odometry."""
        self._require_begun()
        return self._view(camera.without_roll, self._other_depth_rng)

    def _view(self, camera: Camera, depth_rng: np.random.Generator) -> Observation:
        here = self._physics.pose
        colours: dict[str, Any] = {}
        if self._draws_colours:
            view = self._renderer.render(camera, here) if self._draws_labels else self._renderer.look(camera, here)
            depth_m = view.depth_m
            colours = {"rgb": view.rgb, "instances": None}
            if isinstance(view, Frame):
                depth_m = self._with_noise(view, depth_rng)
                colours["instances"] = InstanceImage(view.instance, self._categories)
        else:
            depth_m = self._renderer.measure(camera, here)
        beyond_range = depth_m > np.float32(camera.depth_max_m)
        mark_out_of_range(depth_m, np.float32(camera.depth_min_m), np.float32(camera.depth_max_m))
        pose = _reported(self._odometry)
        return observation_of(
            self._physics.time_s, camera, depth_m=depth_m, pose=pose, beyond_range=beyond_range, **colours
        )

    def _with_noise(self, view: Frame, rng: np.random.Generator) -> npt.NDArray[np.float32]:
        if self.noise is None:
            return view.depth_m
        return noisy_depth(view.depth_m, view.rgb, self._shininess[view.instance], self.noise.depth, rng)

    def execute(self, action: Action) -> MotionResult:
        """Execute an action. A contact stops it at once."""
        self._require_begun()
        if not action.moves:
            return MotionResult(completed=True, pose=_reported(self._odometry))
        start, start_s = self._odometry, self._physics.time_s
        self._motion = _Motion(start, start_s)
        if self._mover is not None:
            return self._moved(self._mover, self._mover.execute(action), start, start_s)
        self._target_heading_rad = heading_after(action, self._target_heading_rad, self.settings)
        controller = MotionController(action, start, self._target_heading_rad, self.settings)
        touch: Touch | None = None
        command = controller.step(start, start_s)
        while controller.status is MotionStatus.MOVING:
            touch = self._base.drive(command)
            self._read_odometry()
            if touch:
                controller.abort(f"touched {self._name_of(touch)}")
                self._physics.stop()
                break
            command = controller.step(self._odometry, self._physics.time_s, self._odometry_stamp_s)
        return self._result(controller, start, start_s, touch)

    def drive(self, movement: Drive, check: PathCheck) -> MotionResult:
        """Execute a movement leg by leg. A contact stops it at once, and so does the check."""
        self._require_begun()
        start, start_s = self._odometry, self._physics.time_s
        self._motion = motion = _Motion(start, start_s, movement, 0.0)
        if self._mover is not None:
            return self._driven(self._mover, movement, check)
        plan = LegPlan(movement, start)
        controller, touch, blocked = None, None, ""
        while (leg := plan.next(self._odometry)) is not None and not blocked:
            controller = leg.controller(self._odometry, self.settings)
            command, looked_s = STANDSTILL, -math.inf
            while controller.status is MotionStatus.MOVING:
                now_s = self._physics.time_s
                if leg.translates and now_s - looked_s >= _LOOK_PERIOD_S - CONTROL_PERIOD_S / 2:
                    looked_s = now_s
                    if blocked := check(self._driving_view(command, controller.remaining_m)):
                        controller.abort(blocked)
                        self._physics.stop()
                        break
                command = controller.step(self._odometry, now_s, self._odometry_stamp_s)
                before = self._odometry
                touch = self._base.drive(command)
                self._read_odometry()
                motion.path_m = (motion.path_m or 0.0) + before.distance_to(self._odometry)
                if touch:
                    controller.abort(f"touched {self._name_of(touch)}")
                    self._physics.stop()
                    break
            self._read_odometry(fresh=True)
            if not controller.done:
                break
        self._target_heading_rad = self._odometry.heading_rad
        result = self._result(controller, start, start_s, touch)
        return replace(
            result,
            completed=result.completed and not plan.failure,
            failure=result.failure or plan.failure,
            displacement_m=displacement_m(start, self._odometry, movement),
            path_m=motion.path_m,
            blocked=blocked,
        )

    def interrupted_motion(self) -> MotionResult | None:
        """Return the odometry's motion since the movement after the last observation began."""
        motion = self._motion
        if motion is None:
            return NOT_BEGUN
        if self._mover is not None and motion.path_m is not None:
            motion.path_m = self._mover.path_m
        result = self._result(None, motion.start, motion.start_s, None)
        displaced_m = displacement_m(motion.start, self._odometry, motion.movement)
        return replace(result, completed=False, displacement_m=displaced_m, path_m=motion.path_m)

    def _driven(self, mover: SimulatedMover, movement: Drive, check: PathCheck) -> MotionResult:
        """Execute a movement on a base that is not ideal."""
        start, start_s = self._odometry, self._physics.time_s
        requested = RequestedDrive(movement, self.settings)
        blocked, looked_s = "", -math.inf

        def blocked_now() -> str:
            nonlocal blocked, looked_s
            now_s = self._physics.time_s
            if mover.command.linear_m_s and now_s - looked_s >= _LOOK_PERIOD_S - CONTROL_PERIOD_S / 2:
                looked_s = now_s
                blocked = check(self._driving_view(mover.command, requested.remaining_m(start, mover.reading)))
            return blocked

        result = self._moved(mover, mover.drive(movement, blocked_now), start, start_s)
        return replace(
            result,
            failure="" if blocked else result.failure,
            displacement_m=displacement_m(start, self._odometry, movement),
            path_m=mover.path_m,
            blocked=blocked,
        )

    def _moved(self, mover: SimulatedMover, outcome: Outcome, start: Pose, start_s: float) -> MotionResult:
        """Return the measured motion of a base that is not ideal."""
        self._odometry = mover.reading
        name = self._name_of(mover.touch) if mover.touch else ""
        return MotionResult(
            completed=outcome.answer and mover.touch is None,
            displacement_m=distance_along(start, self._odometry),
            turn_rad=self._odometry.heading_rad - start.heading_rad,
            duration_s=self._physics.time_s - start_s,
            collision=Collision(CollisionSource.CONTACT, name) if name else None,
            failure=f"touched {name}" if name else outcome.reason,
            corrections=outcome.corrections,
            pose=_reported(self._odometry),
        )

    def _driving_view(self, command: Command, remaining_m: float) -> DrivingView:
        """Return what the depth camera sees now; with noise, if the robot has noise."""
        camera = self.profile.camera.without_roll
        if self.noise is None:
            depth_m = self._renderer.measure(camera, self._physics.pose)
        else:
            depth_m = self._with_noise(self._renderer.render(camera, self._physics.pose), self._depth_rng)
        mark_out_of_range(depth_m, np.float32(camera.depth_min_m), np.float32(camera.depth_max_m))
        return DrivingView(depth_m, camera, 0.0, command.linear_m_s, command.angular_rad_s, remaining_m)

    def _result(self, controller: Controller | None, start: Pose, start_s: float, touch: Touch | None) -> MotionResult:
        """Return the measured motion since `start`; without a controller, the robot had nothing to do."""
        self._read_odometry(fresh=True)
        motion = self._odometry.relative_to(start)
        return MotionResult(
            completed=controller is None or controller.done,
            displacement_m=distance_along(start, self._odometry),
            turn_rad=motion.heading_rad,
            duration_s=self._physics.time_s - start_s,
            collision=Collision(CollisionSource.CONTACT, self._name_of(touch)) if touch else None,
            failure=controller.failure if controller is not None else "",
            corrections=controller.corrections if controller is not None else 0,
            pose=_reported(self._odometry),
        )

    def locate(self) -> Fix:
        """Return the true pose of the base."""
        self._require_begun()
        return Fix(self._physics.pose, PoseSource.SIMULATED)

    def halt(self) -> None:
        """Do nothing: the robot moves only within `execute`."""

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


def _reported(pose: Pose) -> Pose:
    """Return odometry with a wrapped heading, as robots report it."""
    return Pose(pose.x_m, pose.y_m, wrap_angle(pose.heading_rad))
