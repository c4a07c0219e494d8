"""Listens to a base's commands and odometry: a line `seconds command|odometry speed` for each, by this machine's clock.

usage: python velocity_listener.py ros1|ros2 PROFILE

The speed is |m/s| + |rad/s|; that of the odometry is by its poses, for not every base fills in the twist. A node of its
own that has nothing else to do, so that the times are those of the network.
"""

import math
import sys
import time
from typing import Any


def listen(kind: str, profile_name: str) -> None:
    """Write until the process is ended."""
    from vsnbench.robots.profiles import load_profile

    profile = load_profile(profile_name)
    if kind == "ros1":
        from vsnbench.ros1.installation import require_ros1
        from vsnbench.ros1.interface import ros1_interface

        require_ros1()
        import rospy
        from geometry_msgs.msg import Twist
        from nav_msgs.msg import Odometry

        names, speedometer = ros1_interface(profile), Speedometer()
        rospy.init_node("velocity_listener", disable_signals=True)
        rospy.Subscriber(names.command, Twist, tell_command, queue_size=100, tcp_nodelay=True)
        rospy.Subscriber(names.odometry, Odometry, speedometer.tell, queue_size=100, tcp_nodelay=True)
        rospy.spin()
        return
    from vsnbench.ros2.installation import require_ros2

    require_ros2()
    import rclpy
    from geometry_msgs.msg import Twist, TwistStamped
    from nav_msgs.msg import Odometry
    from rclpy.qos import qos_profile_sensor_data

    from vsnbench.ros2.interface import TWIST_STAMPED, ros2_interface

    names, speedometer = ros2_interface(profile), Speedometer()
    rclpy.init()
    node = rclpy.create_node("velocity_listener")
    kind = TwistStamped if names.command_type == TWIST_STAMPED else Twist
    # Asks for no more than a sensor's quality, which every sender has.
    node.create_subscription(kind, names.command, tell_command, qos_profile_sensor_data)
    node.create_subscription(Odometry, names.odometry, speedometer.tell, qos_profile_sensor_data)
    rclpy.spin(node)


class Speedometer:
    """How fast a base goes, by the poses of its odometry."""

    def __init__(self) -> None:
        self._before: tuple[float, float, float, float] | None = None

    def tell(self, odometry: Any) -> None:
        """Write the speed since the message before."""
        at, stamp = odometry.pose.pose, odometry.header.stamp
        stamp_s = stamp.to_sec() if hasattr(stamp, "to_sec") else stamp.sec + stamp.nanosec * 1e-9
        heading = 2 * math.atan2(at.orientation.z, at.orientation.w)
        now = (stamp_s, at.position.x, at.position.y, heading)
        if self._before is not None and now[0] > self._before[0]:
            seconds, x, y, turned = (a - b for a, b in zip(now, self._before, strict=True))
            write("odometry", (math.hypot(x, y) + abs(math.remainder(turned, math.tau))) / seconds)
        self._before = now


def tell_command(said: Any) -> None:
    """Write the speed that is commanded."""
    twist = getattr(said, "twist", said)
    write("command", abs(twist.linear.x) + abs(twist.angular.z))


def write(what: str, speed: float) -> None:
    """Write one line, at once."""
    sys.stdout.write(f"{time.time():.6f} {what} {speed:.5f}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    listen(*sys.argv[1:])
