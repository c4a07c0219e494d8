"""The simulated robot: the contract of robots, carried out in the embedded world instead of a real one."""

from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from vsnbench.errors import RobotError
from vsnbench.motion.controller import MotionController, MotionStatus
from vsnbench.motion.law import heading_after
from vsnbench.motion.settings import MotionSettings
from vsnbench.protocol.actions import Action
from vsnbench.protocol.fix import Fix, PoseSource
from vsnbench.protocol.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.protocol.observation import InstanceImage, Observation, Sensor, observation_of
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose, wrap_angle
from vsnbench.protocol.robot_identity import SIMULATED, RobotIdentity, kind_of_class
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site, StartingPosition
from vsnbench.simulator.noise import NoiseSettings, OdometryDrift, noisy_depth
from vsnbench.simulator.odometry import WheelOdometry
from vsnbench.simulator.physics import CONTROL_PERIOD_S, Physics, Touch, simulator_version
from vsnbench.simulator.primitives import Scene
from vsnbench.simulator.renderer import Frame, Renderer
from vsnbench.simulator.scene import build_scene
from vsnbench.simulator.shading import mark_out_of_range


class SimulatedRobot:
    """A robot of some profile in a site's simulated twin.

    Simulated time passes by motion only and starts at zero with every episode; the same seed gives the same episode,
    bit by bit. Without `noise` the only error of odometry is the wheels' slip. Labels of objects and colours
    are drawn only where they are `read`, or where noise depends on them.
    """

    sensors = frozenset({Sensor.RGB, Sensor.DEPTH, Sensor.ODOMETRY, Sensor.INSTANCES})

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
        self.conditions: Mapping[str, Any] = {"simulator": simulator_version()} | (
            {} if noise is None else {"noise": noise.model_dump(mode="json")}
        )
        self.settings = MotionSettings.for_robot(profile, parameters)
        scene = build_scene(site)
        self._physics = Physics(scene, profile.base)
        self._renderer = Renderer(scene)
        self._shininess = _shininess_of_objects(scene, len(site.objects))
        self._categories = {number: thing.category for number, thing in enumerate(site.objects, start=1)}
        self._odometry_period_s = 1 / profile.base.odometry_rate_hz
        self._begun = False

    @property
    def identity(self) -> RobotIdentity:
        """Who it is; a subclass is a robot of its own."""
        kind = SIMULATED if type(self) is SimulatedRobot else kind_of_class(type(self))
        return RobotIdentity(self.profile, kind, simulated=True, site_sha256=self.site.sha256)

    def begin(self, start: StartingPosition, seed: int) -> None:
        """Stand at `start` with odometry, time and heading target at zero.

        Raises:
            RobotError: the robot touches something there.
        """
        drift_seed, depth_seed = np.random.SeedSequence(seed).spawn(2)
        self._depth_rng = np.random.default_rng(depth_seed)
        self._drift = OdometryDrift(self.noise.odometry, np.random.default_rng(drift_seed)) if self.noise else None
        self._physics.place(start.pose)
        if touch := self._physics.touch():
            raise RobotError(
                f"starting position {start.number} of site {self.site.name} touches {self._name_of(touch)}",
                advice=f"move it away by more than the robot's radius of {self.profile.base.radius_m} m",
            )
        self._wheels = WheelOdometry(self._physics.geometry)
        self._odometry = Pose(0.0, 0.0, 0.0)
        self._odometry_stamp_s = 0.0
        self._target_heading_rad = 0.0
        self._begun = True

    def observe(self) -> Observation:
        """Return what the camera and the odometry say here; the robot stands still."""
        self._require_begun()
        camera = self.profile.camera
        here = self._physics.pose
        if not self._draws_colours:
            depth_m = self._renderer.measure(camera, here)
            mark_out_of_range(depth_m, np.float32(camera.depth_min_m), np.float32(camera.depth_max_m))
            return observation_of(self._physics.time_s, camera, depth_m=depth_m, pose=_reported(self._odometry))
        view = self._renderer.render(camera, here) if self._draws_labels else self._renderer.look(camera, here)
        depth_m = view.depth_m
        if self.noise is not None and isinstance(view, Frame):
            shininess = self._shininess[view.instance]
            depth_m = noisy_depth(depth_m, view.rgb, shininess, self.noise.depth, self._depth_rng)
        mark_out_of_range(depth_m, np.float32(camera.depth_min_m), np.float32(camera.depth_max_m))
        return Observation(
            rgb=view.rgb,
            depth_m=depth_m,
            pose=_reported(self._odometry),
            stamp_s=self._physics.time_s,
            camera=camera,
            instances=InstanceImage(view.instance, self._categories) if isinstance(view, Frame) else None,
        )

    def execute(self, action: Action) -> MotionResult:
        """Carry out one action; a contact stops it at once."""
        self._require_begun()
        if action is Action.STOP:
            return MotionResult(completed=True, pose=_reported(self._odometry))
        start, began_s = self._odometry, self._physics.time_s
        self._target_heading_rad = heading_after(action, self._target_heading_rad, self.settings)
        controller = MotionController(action, start, self._target_heading_rad, self.settings)
        touch: Touch | None = None
        command = controller.step(start, began_s)
        while controller.status is MotionStatus.MOVING:
            touch = self._physics.drive(command)
            self._read_odometry()
            if touch:
                controller.abort(f"touched {self._name_of(touch)}")
                self._physics.stop()
                break
            command = controller.step(self._odometry, self._physics.time_s, self._odometry_stamp_s)
        self._read_odometry(fresh=True)
        way = self._odometry.relative_to(start)
        distance_m = start.distance_to(self._odometry)
        return MotionResult(
            completed=controller.done,
            displacement_m=distance_m if way.x_m >= 0 else -distance_m,
            turn_rad=way.heading_rad,
            duration_s=self._physics.time_s - began_s,
            collision=Collision(CollisionSource.CONTACT, self._name_of(touch)) if touch else None,
            failure=controller.failure,
            corrections=controller.corrections,
            pose=_reported(self._odometry),
        )

    def locate(self) -> Fix:
        """Return where the base truly stands."""
        self._require_begun()
        return Fix(self._physics.pose, PoseSource.SIMULATED)

    def halt(self) -> None:
        """Nothing to do: time only passes, and the robot only moves, within `execute`."""

    def close(self) -> None:
        """Let go of the episode; `begin` starts another."""
        self._begun = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _require_begun(self) -> None:
        if not self._begun:
            raise RobotError("the simulated robot stands nowhere yet", advice="begin an episode first")

    def _read_odometry(self, *, fresh: bool = False) -> None:
        """Let the base's computer count, and take its newest message, as rarely as this base sends one."""
        pose = self._wheels.update(self._physics.wheel_angles)
        if self._drift is not None:
            pose = self._drift.update(pose)
        now_s = self._physics.time_s
        due_s = self._odometry_stamp_s + self._odometry_period_s
        if fresh or now_s >= due_s - CONTROL_PERIOD_S / 2:
            self._odometry, self._odometry_stamp_s = pose, now_s

    def _name_of(self, touch: Touch) -> str:
        """Return the id of the object, or what part of the building it is."""
        return self.site.objects[touch.instance - 1].id if touch.instance else touch.category


def _reported(pose: Pose) -> Pose:
    """Return odometry as it is reported: with a wrapped heading."""
    return Pose(pose.x_m, pose.y_m, wrap_angle(pose.heading_rad))


def _shininess_of_objects(scene: Scene, objects: int) -> npt.NDArray[np.float32]:
    """Return by instance how shiny its shiniest part is; the building is matt."""
    shininess = np.zeros(objects + 1, np.float32)
    for primitive in scene.primitives:
        if primitive.instance and primitive.visible:
            shininess[primitive.instance] = max(shininess[primitive.instance], primitive.material.shininess)
    return shininess
