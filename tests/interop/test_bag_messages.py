"""ROS tools can read the messages of a bag from its definitions, and frames follow REP-103."""

import math
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer

from vsnbench.interop.bag_messages import Messages, optical_turn, type_store
from vsnbench.interop.recorded_messages import KINDS
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose

CAMERA = Camera(width=64, height=48, horizontal_fov_deg=60, mount_height_m=0.6, mount_forward_m=-0.1, tilt_deg=-20)


def turned(turn: tuple[float, float, float, float], point: np.ndarray) -> np.ndarray:
    """Rotate a point by a quaternion x, y, z, w."""
    axis, w = np.array(turn[:3]), turn[3]
    return point + 2 * np.cross(axis, np.cross(axis, point) + w * point)


@pytest.mark.parametrize("tilt_deg", [0.0, -20.0, 35.0])
def test_a_point_of_the_optical_frame_lies_where_the_back_projection_puts_it(tilt_deg: float) -> None:
    camera = CAMERA.model_copy(update={"tilt_deg": tilt_deg})
    assert math.hypot(*optical_turn(tilt_deg)) == pytest.approx(1)
    depth_m = np.full((48, 64), 2.0, np.float32)
    (cx, cy), focal = camera.center_px, camera.focal_px
    for row, column in ((0, 0), (47, 63), (10, 50)):
        optical = np.array([(column - cx) / focal, (row - cy) / focal, 1.0]) * 2.0
        mount = np.array([camera.mount_forward_m, 0.0, camera.mount_height_m])
        in_base = turned(optical_turn(tilt_deg), optical) + mount
        assert in_base == pytest.approx(camera.points_in_base(depth_m)[row, column], abs=1e-5)


@pytest.mark.ros
def test_ros_itself_reads_every_topic_by_the_definitions_in_the_bag(tmp_path: Path) -> None:
    import rosbag

    store = type_store()
    make, path = Messages(store), tmp_path / "all.bag"
    of_kind = {
        "sensor_msgs/msg/CompressedImage": make.jpeg(1, 10**9, b"jpeg"),
        "sensor_msgs/msg/CameraInfo": make.camera_info(1, 10**9, CAMERA),
        "sensor_msgs/msg/Image": make.depth(1, 10**9, np.zeros((3, 4), np.uint16)),
        "nav_msgs/msg/Odometry": make.odometry(1, 10**9, Pose(1.0, 2.0, 0.5)),
        "tf2_msgs/msg/TFMessage": make.camera_on_base(10**9, CAMERA),
        "std_msgs/msg/String": make.text("chair"),
    }
    with Writer(path) as writer:
        for topic, kind in KINDS.items():
            channel = writer.add_connection(topic, kind, typestore=store)
            writer.write(channel, 10**9, store.serialize_ros1(of_kind[kind], kind))
    with rosbag.Bag(str(path)) as bag:
        read = {topic: message for topic, message, _ in bag.read_messages()}
        sums = {c.topic: c.md5sum for c in bag._get_connections()}
    assert set(read) == set(KINDS)
    assert read["/odom"].pose.pose.position.y == 2.0
    assert read["/camera/color/camera_info"].K[0] == pytest.approx(CAMERA.focal_px)
    assert read["/tf_static"].transforms[0].child_frame_id == "camera_color_optical_frame"
    # From `rosmsg md5`.
    assert sums["/tf"] == "94810edda583a504dfda3829e70d7eec"
    assert sums["/camera/color/camera_info"] == "c9a58c1b0b154e0e6da7578cb991d214"
    assert sums["/odom"] == "cd5e73d190d741a2f92e81eda573aca7"
