"""A colour and depth camera in front of a noisy wall, with faults commanded on /camera/fault.

`silent` sends nothing, `blind` no depth, `small` half the size, `yuv` another encoding, `past` stamps from yesterday,
`holes` a depth image with a different tenth of its pixels invalid each time, `frozen` the same colours with new stamps,
`half` no depth in the left half, `slow` one image per second, `late` 0.3 s after its stamp; `frozen+half` is both, and
`good` is back to normal. With `apart S`, every camera sends five images a second, the left one's are stamped S earlier.
"""

import time

import numpy as np
import rospy
from sensor_msgs.msg import Image
from std_msgs.msg import String

WIDTH, HEIGHT, RATE_HZ = 64, 48, 30.0
rospy.init_node("camera")
fault = "good"


def on_fault(message: String) -> None:
    global fault
    fault = message.data


rospy.Subscriber("/camera/fault", String, on_fault, queue_size=10)
color = rospy.Publisher("/camera/color/image_raw", Image, queue_size=1)
depth = rospy.Publisher("/camera/depth/image_raw", Image, queue_size=1)
left_color = rospy.Publisher("/camera_left/color/image_raw", Image, queue_size=1)
left_depth = rospy.Publisher("/camera_left/depth/image_raw", Image, queue_size=1)


def image(pixels: np.ndarray, encoding: str, stamp: rospy.Time) -> Image:
    message = Image(height=pixels.shape[0], width=pixels.shape[1], encoding=encoding, step=pixels[0].nbytes)
    message.header.stamp = stamp
    message.data = pixels.tobytes()
    return message


rng = np.random.default_rng(0)
due = time.monotonic()
colors = None
while not rospy.is_shutdown():
    due += 1.0 if "slow" in fault else 0.2 if "apart" in fault else 1 / RATE_HZ
    time.sleep(max(due - time.monotonic(), 0))
    if fault == "silent":
        continue
    stamp = rospy.Time.now() - rospy.Duration(86400 if fault == "past" else 0.3 if "late" in fault else 0)
    size = (HEIGHT // 2, WIDTH // 2) if fault == "small" else (HEIGHT, WIDTH)
    if colors is None or "frozen" not in fault:
        colors = rng.integers(88, 93, (*size, 3), np.uint8)
    color.publish(image(colors, "yuv422" if fault == "yuv" else "rgb8", stamp))
    wall = rng.integers(1999, 2002, size, np.uint16)
    if fault == "holes":
        wall[rng.random(size) < 0.1] = 0
    if "half" in fault:
        wall[:, : WIDTH // 2] = 0
    if fault != "blind":
        depth.publish(image(wall, "16UC1", stamp))
    if "apart" in fault:
        before = stamp - rospy.Duration(float(fault.split()[1]))
        left_color.publish(image(colors, "rgb8", before))
        left_depth.publish(image(wall, "16UC1", before))
