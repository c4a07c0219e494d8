"""Images of a robot's further cameras over ROS, of the time of the main camera's image."""

import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from vsnbench.errors import ImageError, SensorLostError
from vsnbench.ros.common.robot_link import RobotLink
from vsnbench.sensing.images.camera_images import Stamped, beyond_range, decode_color, decode_depth, median_depth_m
from vsnbench.sensing.images.intrinsics import CalibrationError
from vsnbench.sensing.images.rectifier import Rectifier
from vsnbench.sensing.robot_reports import RobotSnapshot
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.observation import Observation, observation_of
from vsnbench.values.pose import Attitude, Pose

MAX_APART_S: Final = 0.05
"""Largest difference between the stamps of the main camera's image and of another camera's."""
_WAIT_S: Final = 0.3
"""Time for the images of other cameras to arrive, besides two periods of the camera."""


class FurtherCameras:
    """Makes the observations of the further cameras that the profile and its interface name.

    Args:
        link: connection to the robot.
        cameras: the profile's further cameras.
        rectifier: returns the rectifier of a topic's images to a camera on a base with an attitude.
    """

    def __init__(
        self,
        link: RobotLink,
        cameras: dict[CameraRole, Camera],
        rectifier: Callable[[str, Camera, Attitude], Rectifier],
    ) -> None:
        self._link = link
        self._cameras = {role: camera for role, camera in cameras.items() if role in link.names.cameras}
        self._rectifier = rectifier

    @property
    def roles(self) -> frozenset[CameraRole]:
        """Roles of the cameras."""
        return frozenset(self._cameras)

    def beside(self, stamp_s: float) -> dict[CameraRole, tuple[Stamped[Any], ...]]:
        """Return the colour image, and the depth image if there is one, of each camera at a time of the main camera.

        They are not decoded, which may take longer than the images are kept.

        Raises:
            SensorLostError: a camera is silent, or its images are of another time.
        """
        topics = {role: self._link.names.cameras[role] for role in self._cameras}
        return {
            role: tuple(self._nearest(role, topic, stamp_s) for topic in (its.color, its.depth) if topic)
            for role, its in topics.items()
        }

    def seen(
        self, images: Mapping[CameraRole, tuple[Stamped[Any], ...]], attitude: Attitude, pose: Pose
    ) -> dict[CameraRole, Observation]:
        """Return the observations of images that `beside` has found.

        Args:
            images: colour and depth of each camera.
            attitude: attitude of the base.
            pose: odometry at the main camera's image.

        Raises:
            SensorLostError: an image does not fit the profile.
        """
        return {role: self._seen(role, *found, attitude=attitude, pose=pose) for role, found in images.items()}

    def _seen(
        self,
        role: CameraRole,
        color: Stamped[Any],
        depth: Stamped[Any] | None = None,
        *,
        attitude: Attitude,
        pose: Pose,
    ) -> Observation:
        topics, camera = self._link.names.cameras[role], self._cameras[role]
        try:
            rgb = decode_color(self._link.image(color.payload))
            frame = None if depth is None else decode_depth(self._link.image(depth.payload))
            for image in (rgb,) if frame is None else (rgb, frame):
                self._require_size(role, camera, image)
            measured: dict[str, Any] = {"rgb": self._rectifier(topics.color, camera, attitude).image(rgb), "pose": pose}
            if depth is not None and frame is not None:
                depth_m = median_depth_m([frame], camera.depth_min_m, camera.depth_max_m)
                rectifier = self._rectifier(topics.depth, camera, attitude)
                beyond = rectifier.labels(beyond_range(frame, depth_m, camera.depth_max_m))
                measured |= {"depth_m": rectifier.depth(depth_m), "beyond_range": beyond}
                measured["depth_stamp_s"] = depth.stamp_s
        except (ImageError, CalibrationError) as error:
            raise SensorLostError(
                f"the {role.value} camera: {error.statement}", advice=error.advice, code=error.code
            ) from error
        return observation_of(color.stamp_s, camera.on(attitude), **measured)

    def _nearest(self, role: CameraRole, topic: str, stamp_s: float) -> Stamped[Any]:
        """Return the image of a topic that is nearest to a time."""

        def nearest(now: RobotSnapshot) -> Stamped[Any] | None:
            images = now.further.get(topic, ())
            return min(images, key=lambda image: abs(image.stamp_s - stamp_s), default=None)

        def paired(now: RobotSnapshot) -> Stamped[Any] | None:
            image = nearest(now)
            return image if image is not None and abs(image.stamp_s - stamp_s) <= MAX_APART_S + 1e-6 else None

        found = self._link.wait_for(paired, _WAIT_S + 2 / self._link.names.camera_rate_hz)
        if found is not None:
            return found
        image = nearest(self._link.snapshot())
        if image is None:
            raise SensorLostError(
                f"the {role.value} camera has sent no image on {topic}",
                advice="start its driver, or correct interface.cameras in the profile",
                code="silent-camera",
            )
        late = f", the last one {time.monotonic() - image.arrival_s:.1f} s ago" if image.stamp_s < stamp_s else ""
        raise SensorLostError(
            f"the image of the {role.value} camera is {1000 * abs(image.stamp_s - stamp_s):.0f} ms from that of the "
            f"front camera; at most {1000 * MAX_APART_S:.0f} ms are one moment{late}",
            advice="let the cameras take their images together, or raise their rates",
            code="cameras-apart",
        )

    def _require_size(self, role: CameraRole, camera: Camera, image: Any) -> None:
        height, width = image.shape[:2][:: -1 if self._link.image_turns % 2 else 1]
        if (width, height) != (camera.width, camera.height):
            raise SensorLostError(
                f"an image of the {role.value} camera is {width}x{height}, the profile has "
                f"{camera.width}x{camera.height}",
                advice="set the mode of the camera driver, or the camera of the profile",
                code="wrong-image-size",
            )
