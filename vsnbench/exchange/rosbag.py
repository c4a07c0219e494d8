"""One episode as a ROS 1 bag: images, calibration, odometry, frames and actions, readable by rosbag and rviz.

Times are the robot's: an image's when it was taken, odometry's before and after the motion that followed it.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from vsnbench.errors import RecordError, UsageError
from vsnbench.exchange.bag_messages import TF, Messages, type_store
from vsnbench.exchange.episodes import ExportedEpisode
from vsnbench.protocol.pictures import decode_picture
from vsnbench.protocol.step_record import StepRecord
from vsnbench.record.confined import confined, read_confined
from vsnbench.record.images import depth_path, rgb_path
from vsnbench.whole_files import whole_file

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


def write_bag(
    episode: ExportedEpisode, steps: Iterable[StepRecord], results_directory: Path, path: Path
) -> dict[str, int]:
    """Write the bag and return how many messages each topic has.

    Raises:
        UsageError: the library is not installed.
        RecordError: the bag cannot be written, or the record leads out of its directory.
    """
    try:
        from rosbags.rosbag1 import Writer
    except ImportError as error:
        raise UsageError("bags need the library rosbags", advice="pip install 'vsnbench[bags]'") from error
    store, make = type_store(), Messages()
    directory = confined(results_directory, episode.images_directory) if episode.images_directory else None
    messages = dict.fromkeys(KINDS, 0)
    with whole_file(path) as part, Writer(part) as writer:
        channels = {
            topic: writer.add_connection(topic, kind, typestore=store, latching=1 if topic == FIXED_FRAMES else None)
            for topic, kind in KINDS.items()
        }

        def put(topic: str, time_ns: int, message: Any) -> None:
            writer.write(channels[topic], time_ns, store.serialize_ros1(message, KINDS[topic]))
            messages[topic] += 1

        camera, began_ns = episode.camera, _nanoseconds(episode.started_at.timestamp())
        put(GOAL, began_ns, make.text(episode.goal))
        if camera is not None:
            put(FIXED_FRAMES, began_ns, make.camera_on_base(began_ns, camera))
        if episode.start_pose is not None:
            put(FIXED_FRAMES, began_ns, make.odometry_in_site(began_ns, episode.start_pose))
        for step in steps:
            number, taken_ns = step.number, _nanoseconds(episode.taken_s(step))
            if directory and (color := read_confined(directory, rgb_path(Path(), number))):
                put(COLOR, taken_ns, make.jpeg(number, taken_ns, color))
                if camera is not None:
                    put(COLOR_INFO, taken_ns, make.camera_info(number, taken_ns, camera))
            if directory and (png := read_confined(directory, depth_path(Path(), number))):
                depth_mm = _decoded_depth(png, depth_path(directory, number))
                put(DEPTH, taken_ns, make.depth(number, taken_ns, depth_mm))
                if camera is not None:
                    put(DEPTH_INFO, taken_ns, make.camera_info(number, taken_ns, camera))
            put(ACTION, taken_ns, make.text("BLOCKED" if step.blocked else step.action))
            moved_ns = _nanoseconds(episode.moved_s(step))
            for time_ns, pose in ((taken_ns, step.observed), (moved_ns, step.after)):
                if pose is not None:
                    put(ODOMETRY, time_ns, make.odometry(number, time_ns, pose))
                    put(FRAMES, time_ns, make.base_in_odometry(number, time_ns, pose))
    return messages


def _nanoseconds(time_s: float) -> int:
    return round(time_s * 1_000_000) * 1000


def _decoded_depth(png: bytes, path: Path) -> Any:
    import cv2

    depth_mm = decode_picture(png, cv2.IMREAD_UNCHANGED)
    if depth_mm is None or depth_mm.ndim != 2:
        raise RecordError(f"{path} is not a depth image")
    return depth_mm
