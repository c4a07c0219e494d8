"""IMUs at rest: `imu/level` as it should be, `imu/weightless` without gravity, `imu/tilted` in another frame."""

import rclpy
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Imu

rclpy.init()
node = rclpy.create_node("imus")
publishers = {
    name: node.create_publisher(Imu, f"imu/{name}", qos_profile_sensor_data)
    for name in ("level", "weightless", "tilted")
}


def publish() -> None:
    for name, publisher in publishers.items():
        message = Imu()
        message.header.stamp = node.get_clock().now().to_msg()
        message.header.frame_id = "camera_imu_optical_frame" if name == "tilted" else "imu_link"
        message.orientation.w = 1.0
        message.linear_acceleration.z = 0.0 if name == "weightless" else 9.81
        publisher.publish(message)


node.create_timer(0.02, publish)
print("up", flush=True)
rclpy.spin(node)
