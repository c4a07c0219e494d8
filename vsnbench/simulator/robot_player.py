"""A robot played in real time: base and camera in threads of their own, handed to whoever publishes what they say.

It knows no middleware. The node of a ROS 1 or ROS 2 robot is a RobotOutlet and nothing more.
"""

import math
import threading
import time
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from vsnbench.motion.controller import Command
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_identity import SimulationAccount
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site
from vsnbench.simulator.noise import NoiseSettings, noisy_depth
from vsnbench.simulator.physics import CONTROL_PERIOD_S, simulator_version
from vsnbench.simulator.pretended_person import PretendedPerson
from vsnbench.simulator.renderer import Renderer
from vsnbench.simulator.scene import build_scene
from vsnbench.simulator.simulated_base import Contact, SimulatedBase

_GIVE_UP_CATCHING_UP_S = 0.2
BATTERY_FULL_H = 3.0
"""Hours that a played battery lasts, about those of a Kobuki's small one."""
_BATTERY_AT_FIRST = 0.9
_BATTERY_PERIOD_S = 1.0


@dataclass(frozen=True, slots=True)
class SimulationOptions:
    """How the robot is played."""

    rate_factor: float = 1.0
    """Simulated seconds per second; other than 1, everybody's time comes from the simulator."""
    noise: NoiseSettings | None = None
    command_lag_s: float = 0.0
    """Dead time of the base."""
    odometry_rate_hz: float | None = None
    """Instead of the profile's."""
    pretend_real: bool = False
    """Who asks for the robot to be placed finds it near the mark, as if a person had put it there."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """What the camera took at one moment."""

    stamp_s: float
    rgb: npt.NDArray[np.uint8]
    """(H, W, 3)."""
    depth_mm: npt.NDArray[np.uint16]
    """(H, W), 0 out of range."""
    instances: npt.NDArray[np.uint16]
    """(H, W), the 1-based index of the site's object; 0 for the building."""


class RobotOutlet(Protocol):
    """Where a played robot's messages go; called from the player's threads."""

    def tell_time(self, stamp_s: float) -> None:
        """A control period has passed."""
        ...

    def tell_odometry(self, pose: Pose, stamp_s: float) -> None:
        """The base counted its wheels."""
        ...

    def tell_truth(self, pose: Pose, stamp_s: float) -> None:
        """Where the robot truly stands now."""
        ...

    def tell_battery(self, share: float, stamp_s: float) -> None:
        """The base measured its battery: 0 empty, 1 full."""
        ...

    def tell_lifted(self, lifted: bool) -> None:
        """A person lifts the robot, or has put it down."""
        ...

    def tell_contact(self, _before: Contact | None, now: Contact | None) -> None:
        """A contact began, changed or ended."""
        ...

    def wants_pictures(self) -> bool:
        """Whether anybody looks."""
        ...

    def show(self, picture: Picture) -> None:
        """The camera took a picture."""
        ...


class RobotPlayer:
    """Plays one robot from `start` until it is closed."""

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
        self._odometry_rate_hz = options.odometry_rate_hz or profile.base.odometry_rate_hz
        self.account = SimulationAccount(
            simulator=simulator_version(),
            site=site.name,
            site_sha256=site.sha256,
            profile_sha256=profile.sha256,
            odometry_rate_hz=self._odometry_rate_hz,
            command_lag_s=options.command_lag_s,
            rate_factor=options.rate_factor,
            noise=None if options.noise is None else options.noise.model_dump(mode="json"),
            pretends_to_be_real=options.pretend_real,
        )
        self.categories = {number: thing.category for number, thing in enumerate(site.objects, start=1)}
        """By the numbers of `Picture.instances`."""
        self._camera_rate_hz = camera_rate_hz
        self._base = SimulatedBase(site, scene, profile, options.noise, options.command_lag_s, command_timeout_s)
        self._renderer = Renderer(scene)
        self._rng = np.random.default_rng(0)
        self._shininess = _shininess(scene, len(site.objects))
        self._person = PretendedPerson() if options.pretend_real else None
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._felt: Contact | None = None
        # Stamps follow the base's clock, which starts at the present and then only counts periods, the first of which
        # has still to pass.
        self._epoch_s = time.time() - CONTROL_PERIOD_S
        self._threads = [
            threading.Thread(target=self._run_base, name="base", daemon=True),
            threading.Thread(target=self._run_camera, name="camera", daemon=True),
        ]

    def start(self) -> None:
        """Let time pass, once a first picture was taken: where nothing is compiled yet, that takes seconds."""
        self._picture()
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stop playing."""
        self._closed.set()
        for thread in self._threads:
            thread.join(2.0)

    def hear(self, command: Command) -> None:
        """Take a velocity command; one that is no number is not heard."""
        if not (math.isfinite(command.linear_m_s) and math.isfinite(command.angular_rad_s)):
            return
        with self._lock:
            self._base.hear(command)

    def reset_odometry(self) -> None:
        """Take the command to zero the odometry."""
        with self._lock:
            self._base.reset_odometry()

    def put_down(self, x_m: float, y_m: float, heading_rad: float, seed: int) -> str:
        """Have the robot stand there; where a person is played, too, as one does it: lifted and put down.

        Nobody lifts a robot that no person places: a base's word of it comes on a topic of its own, and where the
        machine is busy it would come after the episode has begun, and end it.

        Args:
            x_m: where, in the site's frame.
            y_m: likewise.
            heading_rad: likewise.
            seed: of the noise from there on, and of a pretended person's errors.

        Returns:
            Why it cannot stand there; empty when it does.
        """
        try:
            pose = Pose(x_m, y_m, heading_rad)
        except ValueError:
            return "a place needs finite numbers"
        seed = abs(seed)
        by_hand = self._person is not None
        if by_hand:
            self._outlet.tell_lifted(True)
        with self._lock:
            if self._person is not None:
                pose = self._person.put_down(
                    pose, self._base.pose, seed, lambda there: self._base.put_down(there, seed)
                )
            touched = self._base.put_down(pose, seed)
            self._rng = np.random.default_rng(seed)
        if by_hand:
            self._outlet.tell_lifted(False)
        return f"it touches {touched} there" if touched else ""

    def _run_base(self) -> None:
        """Let time pass at the wanted rate; fall behind rather than rush where the machine is too slow."""
        period_s = CONTROL_PERIOD_S / self._options.rate_factor
        odometry_due_s = battery_due_s = 0.0
        due_s = time.monotonic()
        while not self._closed.is_set():
            with self._lock:
                contact = self._base.advance()
                now_s, odometry, truth = self._base.now_s, self._base.odometry, self._base.pose
            stamp_s = self._epoch_s + now_s
            self._outlet.tell_time(stamp_s)
            if now_s >= odometry_due_s - 1e-6:
                odometry_due_s = max(odometry_due_s + 1 / self._odometry_rate_hz, now_s - CONTROL_PERIOD_S)
                self._outlet.tell_odometry(odometry, stamp_s)
            self._outlet.tell_truth(truth, stamp_s)
            if now_s >= battery_due_s:
                battery_due_s = now_s + _BATTERY_PERIOD_S
                self._outlet.tell_battery(battery_share(now_s), stamp_s)
            if contact != self._felt:
                self._outlet.tell_contact(self._felt, contact)
                self._felt = contact
            due_s = max(due_s + period_s, time.monotonic() - _GIVE_UP_CATCHING_UP_S)
            time.sleep(max(due_s - time.monotonic(), 0))

    def _run_camera(self) -> None:
        """Take pictures at the camera's rate while somebody looks."""
        period_s = 1 / self._camera_rate_hz / self._options.rate_factor
        due_s = time.monotonic()
        while not self._closed.is_set():
            if self._outlet.wants_pictures():
                self._outlet.show(self._picture())
            due_s = max(due_s + period_s, time.monotonic() - period_s)
            time.sleep(max(due_s - time.monotonic(), 0))

    def _picture(self) -> Picture:
        with self._lock:
            pose, now_s = self._base.pose, self._base.now_s
        frame = self._renderer.render(self._profile.camera, pose)
        depth_m = frame.depth_m
        if self._options.noise is not None:
            shininess = self._shininess[frame.instance]
            depth_m = noisy_depth(depth_m, frame.rgb, shininess, self._options.noise.depth, self._rng)
        depth_mm = _millimetres(depth_m, self._profile)
        return Picture(self._epoch_s + now_s, frame.rgb, depth_mm, frame.instance.astype(np.uint16))


def battery_share(passed_s: float) -> float:
    """Return how full a played battery is after so many seconds."""
    return max(_BATTERY_AT_FIRST - passed_s / 3600 / BATTERY_FULL_H, 0.0)


def _millimetres(depth_m: npt.NDArray[np.float32], profile: RobotProfile) -> npt.NDArray[np.uint16]:
    """Return depth as the camera's driver sends it: whole millimetres, 0 out of range."""
    nearest_m, farthest_m = profile.camera.depth_min_m, min(profile.camera.depth_max_m, 65.534)
    valid = (depth_m >= nearest_m) & (depth_m <= farthest_m)
    return np.where(valid, np.rint(np.where(valid, depth_m, 0) * 1000), 0).astype(np.uint16)


def _shininess(scene: Any, objects: int) -> npt.NDArray[np.float32]:
    """Return by instance how shiny its shiniest part is; the building is matt."""
    shininess = np.zeros(objects + 1, np.float32)
    for part in scene.primitives:
        if part.instance and part.visible:
            shininess[part.instance] = max(shininess[part.instance], part.material.shininess)
    return shininess
