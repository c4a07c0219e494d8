"""A tilted camera with lens distortion over a bare floor, on raw and compressed topics; another to the left."""

import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from tests.robots.floor_images import FISHEYE_K, HEIGHT, LENS, WIDTH, K, compressed, depth_mm

rospy.init_node("floor_camera")
names = [f"/{camera}/{part}" for camera in ("camera", "camera_left") for part in ("color", "depth")]
images = {name: rospy.Publisher(f"{name}/image_raw", Image, queue_size=1) for name in names}
infos = [rospy.Publisher(f"{name}/camera_info", CameraInfo, queue_size=1) for name in names]
fisheye = rospy.Publisher("/camera/fisheye/camera_info", CameraInfo, queue_size=1)
packed = {topic: rospy.Publisher(topic, CompressedImage, queue_size=1) for topic in compressed()}
contents, measured, seen = compressed(), depth_mm(), np.full((HEIGHT, WIDTH, 3), 90, np.uint8)


def image(pixels: np.ndarray, encoding: str, stamp: rospy.Time) -> Image:
    message = Image(height=HEIGHT, width=WIDTH, encoding=encoding, step=pixels[0].nbytes, data=pixels.tobytes())
    message.header.stamp = stamp
    return message


while not rospy.is_shutdown():
    stamp = rospy.Time.now()
    for publisher in infos:
        info = CameraInfo(width=WIDTH, height=HEIGHT, distortion_model="plumb_bob", D=LENS.distortion, K=K)
        info.header.stamp = stamp
        publisher.publish(info)
    info = CameraInfo(width=WIDTH, height=HEIGHT, distortion_model="equidistant", D=[0.0] * 4, K=FISHEYE_K)
    info.header.stamp = stamp
    fisheye.publish(info)
    for name, publisher in images.items():
        pixels, encoding = (seen, "rgb8") if "color" in name else (measured, "16UC1")
        publisher.publish(image(pixels, encoding, stamp))
    for topic, content in contents.items():
        message = CompressedImage(format=content.format, data=content.data)
        message.header.stamp = stamp
        packed[topic].publish(message)
    rospy.sleep(0.05)
