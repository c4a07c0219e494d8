"""What a policy sees of an episode under disturbances; the robot, the guard, the judge and the record are not affected.

The order is that of a camera: the mount, glare, the lens, the sensor's noise, then frames that are lost or late. Every
random number depends only on the trial's seed, the disturbance and the number of the observation. A disturbance
therefore acts alike alone and together with others, and on any number of workers.
"""

import math
import zlib
from collections import deque
from typing import Any

import numpy as np

from vsnbench.protocol.disturbances import Disturbances
from vsnbench.robots.contract import Robot
from vsnbench.runner.disturbances.images import blur, depth_holes, glare, low_light
from vsnbench.simulator.dynamics.noise import OdometryDrift, OdometryNoise
from vsnbench.values.camera import Camera
from vsnbench.values.observation import ARRAYS, Observation, Sensor, with_changes
from vsnbench.values.pose import Pose, wrap_angle


class PolicyView:
    """Makes what the policy sees in one episode from what the robot observes; without disturbances, the same."""

    def __init__(self, disturbances: Disturbances, robot: Robot, seed: int) -> None:
        self._disturbances = disturbances
        self._robot = robot
        self._seed = seed
        self._count = 0
        self.camera: Camera = displaced(robot.identity.profile.camera, disturbances)
        """Camera whose images the policy sees."""
        self._lamp_rad = float(self._rng("glare").uniform(-math.pi, math.pi)) if disturbances else 0.0
        drift = disturbances["odometry_drift"]
        noise = (
            None
            if drift is None
            else OdometryNoise(way_scale_std=drift, turn_scale_std=drift, wander_rad_per_sqrt_m=drift)
        )
        self._drift = None if noise is None else OdometryDrift(noise, self._rng("odometry_drift"))
        self._heading_rad = 0.0
        self._shown: Observation | None = None
        self._late: deque[Observation] = deque(maxlen=1 + round(disturbances["stale_frames"] or 0))

    @property
    def latency_s(self) -> float:
        """Delay of each of the policy's decisions."""
        return self._disturbances["latency"] or 0.0

    def of(self, observation: Observation) -> Observation:
        """Return what the policy sees. Called once with every observation of the robot, in order."""
        if not self._disturbances:
            return observation
        self._count += 1
        images = self._robot.view_from(self.camera) if self._disturbances.geometric else observation
        seen = self._with_drift(self._with_frames(self._disturbed_images(images)), observation.pose)
        self._late.append(seen)
        return self._late[0]

    def _disturbed_images(self, observation: Observation) -> Observation:
        chosen = self._disturbances
        changed: dict[str, Any] = {}
        if Sensor.RGB in observation.sensors:
            rgb = observation.rgb
            if (value := chosen["glare"]) is not None:
                rgb = glare(rgb, value, observation.camera, self._lamp_rad - observation.pose.heading_rad)
            if (value := chosen["blur"]) is not None:
                rgb = blur(rgb, value)
            if (value := chosen["low_light"]) is not None:
                rgb = low_light(rgb, value, self._rng("low_light"))
            changed["rgb"] = rgb
        if (value := chosen["depth_holes"]) is not None and observation.depth_m is not None:
            changed["depth_m"], lost = depth_holes(observation.depth_m, value, self._rng("depth_holes"))
            if observation.beyond_range is not None:
                changed["beyond_range"] = observation.beyond_range & ~lost
        return with_changes(observation, **changed)

    def _with_frames(self, observation: Observation) -> Observation:
        """Return the observation, with the images of the one before where its own are lost."""
        share, before = self._disturbances["dropped_frames"], self._shown
        if share is not None and before is not None and self._rng("dropped_frames").random() < share:
            kept = [name for name, spec in ARRAYS if not spec.is_image and hasattr(observation, name)]
            return with_changes(before, pose=observation.pose, **{name: getattr(observation, name) for name in kept})
        self._shown = observation
        return observation

    def _with_drift(self, observation: Observation, pose: Pose) -> Observation:
        """Return the observation with the odometry of now, which drifts."""
        if self._drift is None:
            return observation
        self._heading_rad += wrap_angle(pose.heading_rad - self._heading_rad)
        return with_changes(observation, pose=self._drift.update(Pose(pose.x_m, pose.y_m, self._heading_rad)))

    def _rng(self, name: str) -> np.random.Generator:
        """Return the random numbers of a disturbance for the current observation."""
        return np.random.default_rng([self._seed, zlib.crc32(name.encode()), self._count])


def displaced(camera: Camera, disturbances: Disturbances) -> Camera:
    """Return the camera with the mount of the disturbances.

    Raises:
        ValueError: the camera would be below the floor or out of the range of a profile.
    """
    if not disturbances.geometric:
        return camera
    mount = {
        "mount_height_m": camera.mount_height_m + (disturbances["camera_height"] or 0.0),
        "tilt_deg": camera.tilt_deg + (disturbances["camera_tilt"] or 0.0),
    }
    return Camera.model_validate({**camera.without_roll.model_dump(), **mount})
