"""A tilted camera with lens distortion over a bare floor, on raw and compressed ROS 2 topics; another to the left."""

import array
import sys
import time

import numpy as np

from vsnbench.ros.ros2.installation import require_ros2

require_ros2()
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from tests.robots.floor_images import FISHEYE_K, HEIGHT, LENS, WIDTH, K, compressed, depth_mm
from vsnbench.ros.ros2.messages import image_message, time_of
from vsnbench.ros.ros2.node import SENSOR_DATA, Ros2Node

node = Ros2Node("floor_camera")
make = node.rclpy.create_publisher
names = [f"/{camera}/{part}" for camera in ("camera", "camera_left") for part in ("color", "depth")]
images = {name: make(Image, f"{name}/image_raw", SENSOR_DATA) for name in names}
infos = [make(CameraInfo, f"{name}/camera_info", SENSOR_DATA) for name in names]
fisheye = make(CameraInfo, "/camera/fisheye/camera_info", SENSOR_DATA)
packed = {topic: make(CompressedImage, topic, SENSOR_DATA) for topic in compressed()}
contents, measured, seen = compressed(), depth_mm(), np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
sys.stdout.write("up\n")
sys.stdout.flush()
while True:
    stamp_s = time.time()
    for publisher in infos:
        info = CameraInfo(width=WIDTH, height=HEIGHT, distortion_model="plumb_bob", d=list(LENS.distortion), k=K)
        info.header.stamp = time_of(stamp_s)
        publisher.publish(info)
    info = CameraInfo(width=WIDTH, height=HEIGHT, distortion_model="equidistant", d=[0.0] * 4, k=FISHEYE_K)
    info.header.stamp = time_of(stamp_s)
    fisheye.publish(info)
    for name, publisher in images.items():
        pixels, encoding = (seen, "rgb8") if "color" in name else (measured, "16UC1")
        publisher.publish(image_message(pixels, encoding, stamp_s))
    for topic, content in contents.items():
        message = CompressedImage(format=content.format, data=array.array("B", content.data))
        message.header.stamp = time_of(stamp_s)
        packed[topic].publish(message)
    time.sleep(0.05)
