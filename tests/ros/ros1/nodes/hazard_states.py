"""Hazard sensors that publish their state as std_msgs/Bool all the time.

Parameters `~bumper`, `~cliff` and `~wheel_drop`: whether the sensor is active.
"""

import rospy
from std_msgs.msg import Bool

rospy.init_node("hazard_states")
publishers = {
    name: rospy.Publisher(f"/{name}", Bool, queue_size=1, tcp_nodelay=True)
    for name in ("bumper", "cliff", "wheel_drop")
}
states = {name: bool(rospy.get_param(f"~{name}", False)) for name in publishers}
rate = rospy.Rate(20)
while not rospy.is_shutdown():
    for name, publisher in publishers.items():
        publisher.publish(Bool(states[name]))
    rate.sleep()
