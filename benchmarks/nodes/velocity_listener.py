"""Prints the arrival time and speed of a base's commands and odometry messages.

usage: python velocity_listener.py ros1|ros2 PROFILE

Each message gives a line `seconds command|odometry speed`, with this machine's clock. The speed is |m/s| + |rad/s|. The
odometry's speed is computed from its poses, because not every base fills in the twist. This is a separate node without
other work, so that no processing delays the timestamps.
"""

import math
import sys
import time
from typing import Any


def listen(kind: str, profile_name: str) -> None:
    """Print messages until the process is terminated."""
    from vsnbench.robots.profiles import load_profile

    profile = load_profile(profile_name)
    if kind == "ros1":
        from vsnbench.ros.ros1.installation import require_ros1
        from vsnbench.ros.ros1.interface import ros1_interface

        require_ros1()
        import rospy
        from geometry_msgs.msg import Twist
        from nav_msgs.msg import Odometry

        names, speedometer = ros1_interface(profile), Speedometer()
        rospy.init_node("velocity_listener", disable_signals=True)
        rospy.Subscriber(names.command, Twist, print_command, queue_size=100, tcp_nodelay=True)
        rospy.Subscriber(names.odometry, Odometry, speedometer.print_speed, queue_size=100, tcp_nodelay=True)
        rospy.spin()
        return
    from vsnbench.ros.ros2.installation import require_ros2

    require_ros2()
    import rclpy
    from geometry_msgs.msg import Twist, TwistStamped
    from nav_msgs.msg import Odometry
    from rclpy.qos import qos_profile_sensor_data

    from vsnbench.ros.ros2.interface import TWIST_STAMPED, ros2_interface

    names, speedometer = ros2_interface(profile), Speedometer()
    rclpy.init()
    node = rclpy.create_node("velocity_listener")
    kind = TwistStamped if names.command_type == TWIST_STAMPED else Twist
    # Request only sensor-data quality of service, which is compatible with every publisher.
    node.create_subscription(kind, names.command, print_command, qos_profile_sensor_data)
    node.create_subscription(Odometry, names.odometry, speedometer.print_speed, qos_profile_sensor_data)
    rclpy.spin(node)


class Speedometer:
    """Computes a base's speed from the poses of its odometry."""

    def __init__(self) -> None:
        self._before: tuple[float, float, float, float] | None = None

    def print_speed(self, odometry: Any) -> None:
        """Print the speed since the previous message."""
        at, stamp = odometry.pose.pose, odometry.header.stamp
        stamp_s = stamp.to_sec() if hasattr(stamp, "to_sec") else stamp.sec + stamp.nanosec * 1e-9
        heading = 2 * math.atan2(at.orientation.z, at.orientation.w)
        now = (stamp_s, at.position.x, at.position.y, heading)
        if self._before is not None and now[0] > self._before[0]:
            seconds, x, y, turned = (a - b for a, b in zip(now, self._before, strict=True))
            write("odometry", (math.hypot(x, y) + abs(math.remainder(turned, math.tau))) / seconds)
        self._before = now


def print_command(message: Any) -> None:
    """Print the commanded speed."""
    twist = getattr(message, "twist", message)
    write("command", abs(twist.linear.x) + abs(twist.angular.z))


def write(what: str, speed: float) -> None:
    """Print a line and flush it."""
    sys.stdout.write(f"{time.time():.6f} {what} {speed:.5f}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    listen(*sys.argv[1:])
