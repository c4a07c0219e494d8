"""One episode as a ROS 1 bag: images, odometry and actions on the topics of ROS4VSN, readable by rosbag and rviz."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from vsnbench.errors import RecordError, UsageError
from vsnbench.exchange.episodes import ExportedEpisode, ExportedStep
from vsnbench.protocol.pictures import decode_picture
from vsnbench.protocol.pose import Pose
from vsnbench.record.confined import confined, read_confined
from vsnbench.record.images import depth_path, rgb_path
from vsnbench.whole_files import whole_file

COLOR, DEPTH = "/camera/color/image_raw/compressed", "/camera/depth/image_raw"
ODOMETRY, ACTION, GOAL = "/odom", "/vsnbench/action", "/vsnbench/goal"


def write_bag(
    episode: ExportedEpisode, steps: Iterable[ExportedStep], results_directory: Path, path: Path
) -> dict[str, int]:
    """Write the bag and return how many messages each topic has.

    Raises:
        UsageError: the library is not installed.
        RecordError: the bag cannot be written, or the record leads out of its directory.
    """
    import numpy as np

    try:
        from rosbags.rosbag1 import Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise UsageError("bags need the library rosbags: pip install 'vsnbench[bags]'") from error
    store = get_typestore(Stores.ROS1_NOETIC)
    directory = confined(results_directory, episode.images_directory) if episode.images_directory else None
    messages = {COLOR: 0, DEPTH: 0, ODOMETRY: 0, ACTION: 0, GOAL: 0}
    kinds = {
        COLOR: "sensor_msgs/msg/CompressedImage",
        DEPTH: "sensor_msgs/msg/Image",
        ODOMETRY: "nav_msgs/msg/Odometry",
        ACTION: "std_msgs/msg/String",
        GOAL: "std_msgs/msg/String",
    }
    with whole_file(path) as part, Writer(part) as writer:
        channels = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}

        def put(topic: str, time_ns: int, message: Any) -> None:
            writer.write(channels[topic], time_ns, store.serialize_ros1(message, kinds[topic]))
            messages[topic] += 1

        types = store.types
        put(GOAL, _nanoseconds(episode.started_at.timestamp()), types[kinds[GOAL]](episode.goal))
        for step in steps:
            time_ns = _nanoseconds(step.time_s)
            header = _header(types, step.number, time_ns, "camera_color_optical_frame")
            if directory and (color := read_confined(directory, rgb_path(Path(), step.number))):
                put(COLOR, time_ns, types[kinds[COLOR]](header, "jpeg", np.frombuffer(color, np.uint8)))
            if directory and (depth := read_confined(directory, depth_path(Path(), step.number))):
                put(DEPTH, time_ns, _depth_image(types, header, depth, depth_path(directory, step.number)))
            put(ACTION, time_ns, types[kinds[ACTION]]("BLOCKED" if step.blocked else step.action))
            if step.odometry:
                put(ODOMETRY, time_ns, _odometry(types, step, time_ns))
    return messages


def _nanoseconds(time_s: float) -> int:
    return round(time_s * 1_000_000) * 1000


def _header(types: Any, sequence: int, time_ns: int, frame: str) -> Any:
    stamp = types["builtin_interfaces/msg/Time"](time_ns // 10**9, time_ns % 10**9)
    return types["std_msgs/msg/Header"](sequence, stamp, frame)


def _depth_image(types: Any, header: Any, png: bytes, path: Path) -> Any:
    import cv2
    import numpy as np

    depth_mm = decode_picture(png, cv2.IMREAD_UNCHANGED)
    if depth_mm is None or depth_mm.ndim != 2:
        raise RecordError(f"{path} is not a depth image")
    height, width = depth_mm.shape
    data = np.ascontiguousarray(depth_mm, dtype="<u2").view(np.uint8).ravel()
    return types["sensor_msgs/msg/Image"](header, height, width, "16UC1", 0, width * 2, data)


def _odometry(types: Any, step: ExportedStep, time_ns: int) -> Any:
    import numpy as np

    pose = step.odometry or Pose(0.0, 0.0)
    point = types["geometry_msgs/msg/Point"](pose.x_m, pose.y_m, 0.0)
    turned = types["geometry_msgs/msg/Quaternion"](
        0.0, 0.0, math.sin(pose.heading_rad / 2), math.cos(pose.heading_rad / 2)
    )
    nothing = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    unknown = np.zeros(36)
    return types["nav_msgs/msg/Odometry"](
        _header(types, step.number, time_ns, "odom"),
        "base_footprint",
        types["geometry_msgs/msg/PoseWithCovariance"](types["geometry_msgs/msg/Pose"](point, turned), unknown),
        types["geometry_msgs/msg/TwistWithCovariance"](types["geometry_msgs/msg/Twist"](nothing, nothing), unknown),
    )
