"""Another publisher of velocities: 0.2 m/s at 20 Hz on /cmd_vel until it is ended."""

import rospy
from geometry_msgs.msg import Twist

rospy.init_node("rival")
commands = rospy.Publisher("/cmd_vel", Twist, queue_size=10, tcp_nodelay=True)
forward = Twist()
forward.linear.x = 0.2
rate = rospy.Rate(20)
while not rospy.is_shutdown():
    commands.publish(forward)
    rate.sleep()
