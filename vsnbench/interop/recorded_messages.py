"""The ROS messages of a recorded episode: images, calibration, odometry, frames, actions, goal.

Times are on the robot's clock: images when they were taken, odometry before and after each motion.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from vsnbench.errors import RecordError
from vsnbench.interop.bag_messages import TF, Messages
from vsnbench.interop.episodes import camera_of, moved_s, taken_s
from vsnbench.results.files.confined_paths import confined, read_confined
from vsnbench.results.files.images import depth_path, rgb_path
from vsnbench.results.model import EpisodeRecord
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


def recorded_messages(
    episode: EpisodeRecord, steps: Iterable[StepRecord], results_directory: Path, make: Messages
) -> Iterator[tuple[str, int, Any]]:
    """Yield topic, time in nanoseconds since 1970, and message.

    Raises:
        RecordError: the record contains a path outside its directory, or a depth image cannot be decoded.
    """
    directory = confined(results_directory, episode.images_directory) if episode.images_directory else None
    camera = camera_of(episode.provenance.robot_profile)
    began_ns = _nanoseconds(episode.started_at.timestamp())
    yield GOAL, began_ns, make.text(episode.goal)
    if camera is not None:
        yield FIXED_FRAMES, began_ns, make.camera_on_base(began_ns, camera)
    if episode.placement is not None:
        yield FIXED_FRAMES, began_ns, make.odometry_in_site(began_ns, episode.placement.pose)
    for step in steps:
        number, taken_ns = step.number, _nanoseconds(taken_s(episode, step))
        if directory and (color := read_confined(directory, rgb_path(Path(), number))):
            yield COLOR, taken_ns, make.jpeg(number, taken_ns, color)
            if camera is not None:
                yield COLOR_INFO, taken_ns, make.camera_info(number, taken_ns, camera)
        if directory and (png := read_confined(directory, depth_path(Path(), number))):
            depth_mm = _decoded_depth(png, depth_path(directory, number))
            yield DEPTH, taken_ns, make.depth(number, taken_ns, depth_mm)
            if camera is not None:
                yield DEPTH_INFO, taken_ns, make.camera_info(number, taken_ns, camera)
        yield ACTION, taken_ns, make.text("BLOCKED" if step.blocked else step.action)
        moved_ns = _nanoseconds(moved_s(episode, step))
        for time_ns, pose in ((taken_ns, step.observed), (moved_ns, step.after)):
            if pose is not None:
                yield ODOMETRY, time_ns, make.odometry(number, time_ns, pose)
                yield FRAMES, time_ns, make.base_in_odometry(number, time_ns, pose)


def _nanoseconds(time_s: float) -> int:
    return round(time_s * 1_000_000) * 1000


def _decoded_depth(png: bytes, path: Path) -> Any:
    import cv2

    depth_mm = decode_picture(png, cv2.IMREAD_UNCHANGED)
    if depth_mm is None or depth_mm.ndim != 2:
        raise RecordError(f"{path} is not a depth image")
    return depth_mm
