"""Simulated robot in real time: base and camera run in threads and send messages to a `RobotOutlet`.

It is independent of middleware: a node of ROS 1 or ROS 2 implements `RobotOutlet`.
"""

import math
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from vsnbench.control.command import Command
from vsnbench.simulator.dynamics.noise import NoiseSettings, noisy_depth
from vsnbench.simulator.dynamics.physics import CONTROL_PERIOD_S, simulator_version
from vsnbench.simulator.dynamics.simulated_base import Contact, SimulatedBase
from vsnbench.simulator.rendering.renderer import Renderer
from vsnbench.simulator.rendering.shading import mark_out_of_range
from vsnbench.simulator.scene import build_scene
from vsnbench.simulator.simulated_operator import SimulatedOperator
from vsnbench.sites.site import Site
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.encoding.images import depth_millimetres
from vsnbench.values.pose import Attitude, Pose
from vsnbench.values.robot_identity import SimulationAccount
from vsnbench.values.robot_profile import IDEAL_BASE, BaseDynamics, RobotProfile

_GIVE_UP_CATCHING_UP_S = 0.2
BATTERY_FULL_H = 3.0
"""Battery life in hours, about that of a Kobuki with the small battery."""
_BATTERY_AT_FIRST = 0.9
_BATTERY_PERIOD_S = 1.0


@dataclass(frozen=True, slots=True)
class SimulationOptions:
    """Options of a simulated robot."""

    rate_factor: float = 1.0
    """Simulated seconds per second; if not 1, all nodes use simulated time."""
    noise: NoiseSettings | None = None
    dynamics: BaseDynamics = IDEAL_BASE
    """Behaviour of the base."""
    is_rehearsal: bool = False
    """Whether a placement has errors, as if an operator had moved the robot."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraImages:
    """One set of camera images."""

    stamp_s: float
    rgb: npt.NDArray[np.uint8]
    """(H, W, 3)."""
    depth_mm: npt.NDArray[np.uint16]
    """(H, W), 0 out of range."""
    instances: npt.NDArray[np.uint16]
    """(H, W) 1-based index of the site's object; 0 for the building."""


class RobotOutlet(Protocol):
    """Receiver of a simulated robot's messages; called from the simulation's threads."""

    def publish_time(self, stamp_s: float) -> None:
        """Called after each control period."""

    def publish_odometry(self, pose: Pose, stamp_s: float, attitude: Attitude) -> None:
        """Called with each odometry measurement, and the attitude of the base."""

    def publish_truth(self, pose: Pose, stamp_s: float) -> None:
        """Called with the true pose in the site's frame."""

    def publish_battery(self, share: float, stamp_s: float) -> None:
        """Called with the battery's state: 0 empty, 1 full."""

    def publish_lifted(self, lifted: bool) -> None:
        """Called when the operator lifts the robot or puts it down."""

    def publish_contact(self, _before: Contact | None, now: Contact | None) -> None:
        """Called when a contact begins, changes or ends."""

    def watched_cameras(self) -> frozenset[CameraRole]:
        """Roles of the cameras whose images have a receiver; only those are rendered."""

    def publish_images(self, images: Mapping[CameraRole, CameraImages]) -> None:
        """Called with the images of the watched cameras."""


class RobotPlayer:
    """Runs a simulated robot from `start` until `close`."""

    def __init__(
        self,
        site: Site,
        profile: RobotProfile,
        options: SimulationOptions,
        outlet: RobotOutlet,
        camera_rate_hz: float,
        command_timeout_s: float,
    ) -> None:
        scene = build_scene(site)
        self._profile = profile
        self._options = options
        self._outlet = outlet
        self._odometry_rate_hz = options.dynamics.odometry_rate_hz or profile.base.odometry_rate_hz
        self.account = SimulationAccount(
            simulator=simulator_version(),
            site=site.name,
            site_sha256=site.sha256,
            profile_sha256=profile.sha256,
            odometry_rate_hz=self._odometry_rate_hz,
            base=options.dynamics.conditions,
            rate_factor=options.rate_factor,
            noise=None if options.noise is None else options.noise.model_dump(mode="json"),
            is_rehearsal=options.is_rehearsal,
        )
        self.categories = {number: thing.category for number, thing in enumerate(site.objects, start=1)}
        """Category of each number in `CameraImages.instances`."""
        self._camera_rate_hz = camera_rate_hz
        self._base = SimulatedBase(site, scene, profile, options.noise, options.dynamics, command_timeout_s)
        self._renderer = Renderer(scene)
        self._rng = np.random.default_rng(0)
        self._shininess = scene.shininess(len(site.objects))
        self._operator = SimulatedOperator() if options.is_rehearsal else None
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._contact: Contact | None = None
        # Stamps follow the base's clock, which starts at the present time and counts periods; the first is still to
        # pass.
        self._epoch_s = time.time() - CONTROL_PERIOD_S
        self._threads = [
            threading.Thread(target=self._run_base, name="base", daemon=True),
            threading.Thread(target=self._run_camera, name="camera", daemon=True),
        ]

    def start(self) -> None:
        """Start the threads after a first image, which may take seconds to compile code."""
        self._images(frozenset({CameraRole.FRONT}))
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stop the threads."""
        self._closed.set()
        for thread in self._threads:
            thread.join(2.0)

    def set_command(self, command: Command) -> None:
        """Accept a velocity command; ignore commands that are not finite."""
        if not all(map(math.isfinite, (command.linear_m_s, command.angular_rad_s, command.lateral_m_s))):
            return
        with self._lock:
            self._base.set_command(command)

    def reset_odometry(self) -> None:
        """Set the odometry to zero."""
        with self._lock:
            self._base.reset_odometry()

    def put_down(self, x_m: float, y_m: float, heading_rad: float, seed: int) -> str:
        """Place the robot; with a simulated operator, lift it and put it down with errors.

        Only a robot that an operator places reports that it is lifted. Otherwise this report, on its own topic, could
        arrive after the start of an episode on a busy machine and end the episode.

        Args:
            x_m: position in the site's frame.
            y_m: position in the site's frame.
            heading_rad: heading in the site's frame.
            seed: seed of the noise from now on and of the operator's errors.

        Returns:
            The reason why the robot cannot be there, or an empty string.
        """
        try:
            pose = Pose(x_m, y_m, heading_rad)
        except ValueError:
            return "the pose must be finite"
        seed, operator = abs(seed), self._operator
        if operator:
            self._outlet.publish_lifted(True)
        with self._lock:
            if operator:
                pose = operator.put_down(pose, self._base.pose, seed, lambda there: self._base.put_down(there, seed))
            touched = self._base.put_down(pose, seed)
            self._rng = np.random.default_rng(seed)
        if operator:
            self._outlet.publish_lifted(False)
        return f"it touches {touched} there" if touched else ""

    def _run_base(self) -> None:
        """Advance time at the configured rate; on a slow machine, fall behind instead of catching up."""
        period_s = CONTROL_PERIOD_S / self._options.rate_factor
        odometry_due_s = battery_due_s = 0.0
        due_s = time.monotonic()
        while not self._closed.is_set():
            with self._lock:
                contact = self._base.advance()
                now_s, truth = self._base.now_s, self._base.pose
                due = now_s >= odometry_due_s - 1e-6
                odometry = self._base.read_odometry() if due else None
                attitude = self._base.attitude
            stamp_s = self._epoch_s + now_s
            self._outlet.publish_time(stamp_s)
            if odometry is not None:
                odometry_due_s = max(odometry_due_s + 1 / self._odometry_rate_hz, now_s - CONTROL_PERIOD_S)
                self._outlet.publish_odometry(odometry, stamp_s, attitude)
            self._outlet.publish_truth(truth, stamp_s)
            if now_s >= battery_due_s:
                battery_due_s = now_s + _BATTERY_PERIOD_S
                self._outlet.publish_battery(battery_share(now_s), stamp_s)
            if contact != self._contact:
                self._outlet.publish_contact(self._contact, contact)
                self._contact = contact
            due_s = max(due_s + period_s, time.monotonic() - _GIVE_UP_CATCHING_UP_S)
            time.sleep(max(due_s - time.monotonic(), 0))

    def _run_camera(self) -> None:
        """Take images at the camera's rate while they have a receiver."""
        period_s = 1 / self._camera_rate_hz / self._options.rate_factor
        due_s = time.monotonic()
        while not self._closed.is_set():
            if watched := self._outlet.watched_cameras():
                self._outlet.publish_images(self._images(watched))
            due_s = max(due_s + period_s, time.monotonic() - period_s)
            time.sleep(max(due_s - time.monotonic(), 0))

    def _images(self, watched: frozenset[CameraRole]) -> dict[CameraRole, CameraImages]:
        with self._lock:
            pose, attitude, now_s = self._base.pose, self._base.attitude, self._base.now_s
        cameras = {CameraRole.FRONT: self._profile.camera, **self._profile.cameras}
        return {role: self._images_of(cameras[role], pose, attitude, now_s) for role in cameras if role in watched}

    def _images_of(self, camera: Camera, pose: Pose, attitude: Attitude, now_s: float) -> CameraImages:
        frame = self._renderer.render(camera, pose, attitude)
        depth_m = frame.depth_m
        if self._options.noise is not None:
            shininess = self._shininess[frame.instance]
            depth_m = noisy_depth(depth_m, frame.rgb, shininess, self._options.noise.depth, self._rng)
        mark_out_of_range(depth_m, np.float32(camera.depth_min_m), np.float32(camera.depth_max_m))
        return CameraImages(
            self._epoch_s + now_s, frame.rgb, depth_millimetres(depth_m), frame.instance.astype(np.uint16)
        )


def battery_share(passed_s: float) -> float:
    """Return the state of a simulated battery after a time in seconds."""
    return max(_BATTERY_AT_FIRST - passed_s / 3600 / BATTERY_FULL_H, 0.0)
