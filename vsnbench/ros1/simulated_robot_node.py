"""The robot's own side of the stack, played around the embedded world: robot_api and camera_api on real ROS topics.

Imported only where ROS is installed.
"""

import json
import logging
import math
import threading
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Bool, Empty, String

from vsnbench.motion.controller import Command
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site
from vsnbench.ros1.interface import ros1_interface
from vsnbench.ros1.master import Master, MasterError
from vsnbench.ros1.messages import BumperEvent, CliffEvent, PlaceRobot, PlaceRobotResponse, WheelDropEvent
from vsnbench.ros1.simulation import (
    ACCOUNT,
    CATEGORIES,
    CONTACT,
    GROUND_TRUTH,
    INSTANCES,
    PLACE,
    SimulationAccount,
)
from vsnbench.simulator.noise import NoiseSettings, noisy_depth
from vsnbench.simulator.physics import CONTROL_PERIOD_S, simulator_version
from vsnbench.simulator.renderer import Frame, Renderer
from vsnbench.simulator.scene import build_scene
from vsnbench.simulator.simulated_base import Contact, SimulatedBase

logger = logging.getLogger(__name__)

NODE = "simulated_robot"
_GIVE_UP_CATCHING_UP_S = 0.2


@dataclass(frozen=True, slots=True)
class SimulationOptions:
    """How the robot is played."""

    rate_factor: float = 1.0
    """Simulated seconds per second; other than 1, everybody's time comes from /clock."""
    noise: NoiseSettings | None = None
    command_lag_s: float = 0.0
    """Dead time of the base."""
    odometry_rate_hz: float | None = None
    """Instead of the profile's."""


class SimulatedRobotNode:
    """Plays one robot until it is closed; the node must have been started."""

    def __init__(self, site: Site, profile: RobotProfile, options: SimulationOptions, master: Master) -> None:
        self._master = master
        scene = build_scene(site)
        self._profile = profile
        self._names = ros1_interface(profile)
        self._options = options
        self._odometry_rate_hz = options.odometry_rate_hz or profile.base.odometry_rate_hz
        self._base = SimulatedBase(
            site, scene, profile, options.noise, options.command_lag_s, self._names.command_timeout_s
        )
        self._renderer = Renderer(scene)
        self._rng = np.random.default_rng(0)
        self._shininess = _shininess(scene, len(site.objects))
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._felt: Contact | None = None
        # Stamps follow the base's clock, which starts at the present and then only counts periods, the first of which
        # has still to pass.
        self._epoch_s = time.time() - CONTROL_PERIOD_S
        self._advertise(site)
        self._base_thread = threading.Thread(target=self._run_base, name="base", daemon=True)
        self._camera_thread = threading.Thread(target=self._run_camera, name="camera", daemon=True)
        self._base_thread.start()
        self._camera_thread.start()

    def close(self) -> None:
        """Stop playing."""
        self._closed.set()
        self._base_thread.join(2.0)
        self._camera_thread.join(2.0)
        if self._options.rate_factor != 1:
            try:
                self._master.ask("deleteParam", "/use_sim_time")
            except (MasterError, LookupError) as error:
                logger.warning("/use_sim_time stays set: %s", error)

    def _advertise(self, site: Site) -> None:
        names = self._names

        def publisher(topic: str, kind: Any, *, latch: bool = False, queue: int = 10) -> Any:
            return rospy.Publisher(topic, kind, queue_size=queue, latch=latch, tcp_nodelay=True) if topic else None

        self._odometry = publisher(names.odometry, Odometry)
        self._bumper = publisher(names.bumper, BumperEvent if names.bumper_type.startswith("kobuki") else Bool)
        # Advertised as a base does; an apartment has no cliffs.
        self._cliff = publisher(names.cliff, CliffEvent if names.cliff_type.startswith("kobuki") else Bool)
        self._wheel_drop = publisher(
            names.wheel_drop, WheelDropEvent if names.wheel_drop_type.startswith("kobuki") else Bool
        )
        self._color = publisher(names.color, Image, queue=1)
        self._color_info = publisher(names.color_info, CameraInfo, queue=1)
        self._depth = publisher(names.depth, Image, queue=1)
        self._depth_info = publisher(names.depth_info, CameraInfo, queue=1)
        self._truth = publisher(GROUND_TRUTH, Odometry)
        self._contact = publisher(CONTACT, String, latch=True)
        self._instances = publisher(INSTANCES, Image, queue=1)
        self._clock = publisher("/clock", Clock) if self._options.rate_factor != 1 else None
        account = publisher(ACCOUNT, String, latch=True)
        account.publish(String(self._account(site).model_dump_json()))
        categories = publisher(CATEGORIES, String, latch=True)
        categories.publish(String(json.dumps({n: thing.category for n, thing in enumerate(site.objects, start=1)})))
        self._contact.publish(String(""))
        rospy.Subscriber(names.command, Twist, self._on_command, queue_size=50, tcp_nodelay=True)
        if names.reset_odometry:
            rospy.Subscriber(names.reset_odometry, Empty, self._on_reset_odometry, queue_size=1)
        rospy.Service(PLACE, PlaceRobot, self._on_place)

    def _account(self, site: Site) -> SimulationAccount:
        noise = self._options.noise
        return SimulationAccount(
            simulator=simulator_version(),
            site=site.name,
            site_sha256=site.sha256,
            profile_sha256=self._profile.sha256,
            odometry_rate_hz=self._odometry_rate_hz,
            command_lag_s=self._options.command_lag_s,
            rate_factor=self._options.rate_factor,
            noise=None if noise is None else noise.model_dump(mode="json"),
        )

    def _on_command(self, twist: Any) -> None:
        with self._lock:
            self._base.hear(Command(twist.linear.x, twist.angular.z))

    def _on_reset_odometry(self, _message: Any) -> None:
        with self._lock:
            self._base.reset_odometry()

    def _on_place(self, request: Any) -> Any:
        """Do what a person does: lift the robot, put it down there."""
        if not all(map(math.isfinite, (request.x, request.y, request.heading))):
            return PlaceRobotResponse(False, "a place needs finite numbers")
        self._tell_wheels(dropped=True)
        with self._lock:
            touched = self._base.put_down(Pose(request.x, request.y, request.heading), abs(request.seed))
            self._rng = np.random.default_rng(abs(request.seed))
        self._tell_wheels(dropped=False)
        return PlaceRobotResponse(not touched, f"it touches {touched} there" if touched else "")

    def _tell_wheels(self, *, dropped: bool) -> None:
        if self._wheel_drop is None:
            return
        if self._wheel_drop.data_class is Bool:
            self._wheel_drop.publish(Bool(dropped))
            return
        state = WheelDropEvent.DROPPED if dropped else WheelDropEvent.RAISED
        for wheel in (WheelDropEvent.LEFT, WheelDropEvent.RIGHT):
            self._wheel_drop.publish(WheelDropEvent(wheel, state))

    def _run_base(self) -> None:
        """Let time pass at the wanted rate; fall behind rather than rush where the machine is too slow."""
        period_s = CONTROL_PERIOD_S / self._options.rate_factor
        odometry_due_s = 0.0
        due_s = time.monotonic()
        while not self._closed.is_set():
            with self._lock:
                contact = self._base.advance()
                now_s, odometry, truth = self._base.now_s, self._base.odometry, self._base.pose
            stamp = rospy.Time.from_sec(self._epoch_s + now_s)
            if self._clock is not None:
                self._clock.publish(Clock(stamp))
            if now_s >= odometry_due_s - 1e-6:
                odometry_due_s = max(odometry_due_s + 1 / self._odometry_rate_hz, now_s - CONTROL_PERIOD_S)
                self._odometry.publish(_odometry_message(odometry, stamp, "odom"))
            if self._truth.get_num_connections():
                self._truth.publish(_odometry_message(truth, stamp, "site"))
            self._feel(contact)
            due_s = max(due_s + period_s, time.monotonic() - _GIVE_UP_CATCHING_UP_S)
            time.sleep(max(due_s - time.monotonic(), 0))

    def _feel(self, contact: Contact | None) -> None:
        """Report a contact when it begins and when it ends."""
        if contact == self._felt:
            return
        self._contact.publish(String(contact.name if contact else ""))
        if self._bumper is not None:
            for change, pressed in ((self._felt, False), (contact, True)):
                if change is not None and change.bumper is not None:
                    self._bumper.publish(self._bumper_event(change.bumper, pressed=pressed))
        self._felt = contact

    def _bumper_event(self, part: int, *, pressed: bool) -> Any:
        if self._bumper.data_class is Bool:
            return Bool(pressed)
        return BumperEvent(part, BumperEvent.PRESSED if pressed else BumperEvent.RELEASED)

    def _run_camera(self) -> None:
        """Take pictures at the camera's rate while somebody looks."""
        period_s = 1 / self._names.camera_rate_hz / self._options.rate_factor
        due_s = time.monotonic()
        while not self._closed.is_set():
            if any(p is not None and p.get_num_connections() for p in (self._color, self._depth, self._instances)):
                self._take_picture()
            due_s = max(due_s + period_s, time.monotonic() - period_s)
            time.sleep(max(due_s - time.monotonic(), 0))

    def _take_picture(self) -> None:
        with self._lock:
            pose, now_s = self._base.pose, self._base.now_s
        frame = self._renderer.render(self._profile.camera, pose)
        stamp = rospy.Time.from_sec(self._epoch_s + now_s)
        if self._instances.get_num_connections():
            self._instances.publish(_image(frame.instance.astype(np.uint16), "16UC1", stamp))
        self._depth_and_info(frame, stamp)
        self._color.publish(_image(frame.rgb, "rgb8", stamp))
        if self._color_info is not None:
            self._color_info.publish(_camera_info(self._profile, stamp, "camera_rgb_optical_frame"))

    def _depth_and_info(self, frame: Frame, stamp: Any) -> None:
        if self._depth is None:
            return
        depth_m = frame.depth_m
        if self._options.noise is not None:
            shininess = self._shininess[frame.instance]
            depth_m = noisy_depth(depth_m, frame.rgb, shininess, self._options.noise.depth, self._rng)
        self._depth.publish(_image(_millimetres(depth_m, self._profile), "16UC1", stamp))
        if self._depth_info is not None:
            self._depth_info.publish(_camera_info(self._profile, stamp, "camera_depth_optical_frame"))


def _millimetres(depth_m: npt.NDArray[np.float32], profile: RobotProfile) -> npt.NDArray[np.uint16]:
    """Return depth as the camera's driver sends it: whole millimetres, 0 out of range."""
    nearest_m, farthest_m = profile.camera.depth_min_m, min(profile.camera.depth_max_m, 65.534)
    valid = (depth_m >= nearest_m) & (depth_m <= farthest_m)
    return np.where(valid, np.rint(np.where(valid, depth_m, 0) * 1000), 0).astype(np.uint16)


def _image(pixels: npt.NDArray[Any], encoding: str, stamp: Any) -> Any:
    message = Image()
    message.header.stamp = stamp
    message.header.frame_id = "camera_rgb_optical_frame" if encoding == "rgb8" else "camera_depth_optical_frame"
    message.height, message.width = pixels.shape[:2]
    message.encoding = encoding
    message.step = pixels[0].nbytes
    message.data = pixels.tobytes()
    return message


def _camera_info(profile: RobotProfile, stamp: Any, frame_id: str) -> Any:
    camera = profile.camera
    focal, (cx, cy) = camera.focal_px, camera.center_px
    info = CameraInfo()
    info.header.stamp = stamp
    info.header.frame_id = frame_id
    info.width, info.height = camera.width, camera.height
    info.distortion_model = "plumb_bob"
    info.D = [0.0] * 5
    info.K = [focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0]
    info.R = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    info.P = [focal, 0.0, cx, 0.0, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return info


def _odometry_message(pose: Pose, stamp: Any, frame_id: str) -> Any:
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = frame_id
    message.child_frame_id = "base_footprint"
    message.pose.pose.position.x, message.pose.pose.position.y = pose.position
    message.pose.pose.orientation.z = math.sin(pose.heading_rad / 2)
    message.pose.pose.orientation.w = math.cos(pose.heading_rad / 2)
    return message


def _shininess(scene: Any, objects: int) -> npt.NDArray[np.float32]:
    """Return by instance how shiny its shiniest part is; the building is matt."""
    shininess = np.zeros(objects + 1, np.float32)
    for part in scene.primitives:
        if part.instance and part.visible:
            shininess[part.instance] = max(shininess[part.instance], part.material.shininess)
    return shininess
