"""A plain rospy client of discrete_move: `caller.py Left 30`; exit code 0 for True. `--push` turns the base by hand."""

import sys
import time

import rospy
from geometry_msgs.msg import Twist

from vsnbench.ros.ros1.messages import DiscreteServer

rospy.init_node("caller", anonymous=True)
if sys.argv[1] == "--push":
    commands = rospy.Publisher("/cmd_vel", Twist, queue_size=10)
    while not commands.get_num_connections():
        time.sleep(0.01)
    hand = Twist()
    hand.angular.z = 1.5
    for _ in range(20):
        commands.publish(hand)
        time.sleep(0.02)
    commands.publish(Twist())
    time.sleep(0.2)
    sys.exit(0)
rospy.wait_for_service("/discrete_move", 20)
answer = rospy.ServiceProxy("/discrete_move", DiscreteServer)(sys.argv[1], int(sys.argv[2]))
sys.exit(0 if answer.response else 1)
