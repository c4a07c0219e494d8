"""The ROS messages of a recorded episode: images, calibration, odometry, frames, actions, goal.

Times are on the robot's clock: images when they were taken, odometry before and after each motion.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from vsnbench.errors import RecordError
from vsnbench.interop.bag_messages import CAMERA_FRAME, TF, Messages
from vsnbench.interop.episodes import cameras_of, moved_s, taken_s
from vsnbench.results.files.confined_paths import confined, read_confined
from vsnbench.results.files.images import depth_path, rgb_path
from vsnbench.results.model import EpisodeRecord
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.encoding.images import decode_picture
from vsnbench.values.step import StepRecord

COLOR, COLOR_INFO = "/camera/color/image_raw/compressed", "/camera/color/camera_info"
DEPTH, DEPTH_INFO = "/camera/depth/image_raw", "/camera/depth/camera_info"
ODOMETRY, FRAMES, FIXED_FRAMES = "/odom", "/tf", "/tf_static"
ACTION, GOAL = "/vsnbench/action", "/vsnbench/goal"
KINDS = {
    COLOR: "sensor_msgs/msg/CompressedImage",
    COLOR_INFO: "sensor_msgs/msg/CameraInfo",
    DEPTH: "sensor_msgs/msg/Image",
    DEPTH_INFO: "sensor_msgs/msg/CameraInfo",
    ODOMETRY: "nav_msgs/msg/Odometry",
    FRAMES: TF,
    FIXED_FRAMES: TF,
    ACTION: "std_msgs/msg/String",
    GOAL: "std_msgs/msg/String",
}
"""Topics of every episode, with the types of their messages."""
_OF_CAMERA = (COLOR, COLOR_INFO, DEPTH, DEPTH_INFO)


def kinds_of(episode: EpisodeRecord) -> dict[str, str]:
    """Return the topics of an episode, also of further cameras such as `/camera_left`, and types of messages."""
    further = [role for role in cameras_of(episode.provenance.robot_profile) if role is not CameraRole.FRONT]
    return KINDS | {_topic(topic, role): KINDS[topic] for role in further for topic in _OF_CAMERA}


def _topic(topic: str, role: CameraRole) -> str:
    return topic if role is CameraRole.FRONT else topic.replace("/camera/", f"/camera_{role}/", 1)


def _frame(role: CameraRole) -> str:
    return CAMERA_FRAME if role is CameraRole.FRONT else f"{role}_camera_optical_frame"


def recorded_messages(
    episode: EpisodeRecord, steps: Iterable[StepRecord], results_directory: Path, make: Messages
) -> Iterator[tuple[str, int, Any]]:
    """Yield topic, time in nanoseconds since 1970, and message.

    Raises:
        RecordError: the record contains a path outside its directory, or a depth image cannot be decoded.
    """
    directory = confined(results_directory, episode.images_directory) if episode.images_directory else None
    cameras: dict[CameraRole, Camera | None] = {CameraRole.FRONT: None}
    cameras |= cameras_of(episode.provenance.robot_profile)
    began_ns = _nanoseconds(episode.started_at.timestamp())
    yield GOAL, began_ns, make.text(episode.goal)
    for role, camera in cameras.items():
        if camera is not None:
            yield FIXED_FRAMES, began_ns, make.camera_on_base(began_ns, camera, _frame(role))
    if episode.placement is not None:
        yield FIXED_FRAMES, began_ns, make.odometry_in_site(began_ns, episode.placement.pose)
    for step in steps:
        number, taken_ns = step.number, _nanoseconds(taken_s(episode, step))
        if directory is not None:
            for role, camera in cameras.items():
                for topic, time_ns, message in _images(directory, number, taken_ns, role, camera, make):
                    yield _topic(topic, role), time_ns, message
        yield ACTION, taken_ns, make.text("BLOCKED" if step.blocked else step.action)
        moved_ns = _nanoseconds(moved_s(episode, step))
        for time_ns, pose in ((taken_ns, step.observed), (moved_ns, step.after)):
            if pose is not None:
                yield ODOMETRY, time_ns, make.odometry(number, time_ns, pose)
                yield FRAMES, time_ns, make.base_in_odometry(number, time_ns, pose)


def _images(
    directory: Path, number: int, taken_ns: int, role: CameraRole, camera: Camera | None, make: Messages
) -> Iterator[tuple[str, int, Any]]:
    """Yield the images of a step from one camera, on the topics of the main one, each with its calibration if known."""
    suffix, frame = "" if role is CameraRole.FRONT else role.value, _frame(role)
    images = []
    if color := read_confined(directory, rgb_path(Path(), number, suffix)):
        images.append((COLOR, COLOR_INFO, make.jpeg(number, taken_ns, color, frame)))
    if png := read_confined(directory, depth_path(Path(), number, suffix)):
        depth_mm = _decoded_depth(png, depth_path(directory, number, suffix))
        images.append((DEPTH, DEPTH_INFO, make.depth(number, taken_ns, depth_mm, frame)))
    for topic, info, message in images:
        yield topic, taken_ns, message
        if camera is not None:
            yield info, taken_ns, make.camera_info(number, taken_ns, camera, frame)


def _nanoseconds(time_s: float) -> int:
    return round(time_s * 1_000_000) * 1000


def _decoded_depth(png: bytes, path: Path) -> Any:
    import cv2

    depth_mm = decode_picture(png, cv2.IMREAD_UNCHANGED)
    if depth_mm is None or depth_mm.ndim != 2:
        raise RecordError(f"{path} is not a depth image")
    return depth_mm
