"""Publishes the odometry of /odom as TF: odom to base_footprint, moving, and base_footprint to base_link, fixed.

Parameters: ~fixed false leaves the fixed link out; ~base is the name of the moving frame.
"""

import rospy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry

from vsnbench.ros.common.interface import OdometryFrames
from vsnbench.ros.ros1.messages import TFMessage, tf_message

rospy.init_node("tf_broadcaster")
base_frame = rospy.get_param("~base", "base_footprint")
frames = OdometryFrames(odom_frame="odom", base_frame=base_frame)
moving = rospy.Publisher("/tf", TFMessage, queue_size=100, tcp_nodelay=True)
fixed = rospy.Publisher("/tf_static", TFMessage, queue_size=100, latch=True)
if rospy.get_param("~fixed", True):
    link = TransformStamped()
    link.header.frame_id, link.child_frame_id = "/base_footprint", "/base_link"
    link.transform.translation.z, link.transform.rotation.w = 0.04, 1.0
    fixed.publish(TFMessage([link]))
rospy.Subscriber("/odom", Odometry, lambda message: moving.publish(tf_message(message, frames)), queue_size=100)
rospy.spin()
