"""A discrete_move server that behaves like upstream's, written from its description.

It turns to an absolute target that assumes heading 0 at start-up, stops at 0.08 rad, drives until the way is covered,
has no time-out, and answers True whatever happened. $FORWARD_M is how far it drives, right or wrong.
"""

import math
import os
import time

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from vsnbench.ros.ros1.messages import DiscreteServer, DiscreteServerResponse
from vsnbench.sensing.odometry.odometry import heading_of_quaternion

rospy.init_node("discrete_move")
here = None
target = 0.0
forward_m = float(os.environ.get("FORWARD_M", "0.25"))


def on_odometry(message: Odometry) -> None:
    global here
    pose = message.pose.pose
    turn = pose.orientation
    here = (pose.position.x, pose.position.y, heading_of_quaternion(turn.x, turn.y, turn.z, turn.w))


def send(linear: float, angular: float) -> None:
    twist = Twist()
    twist.linear.x, twist.angular.z = linear, angular
    commands.publish(twist)
    time.sleep(0.02)


def handle(request) -> DiscreteServerResponse:
    global target
    if request.movement in ("Left", "Right"):
        target += math.radians(request.angle) * (1 if request.movement == "Left" else -1)
        while abs(error := math.remainder(target - here[2], math.tau)) > 0.08:
            send(0.0, math.copysign(0.5, error))
    elif request.movement in ("Forward", "Backward"):
        x, y, _ = here
        while math.hypot(here[0] - x, here[1] - y) < forward_m:
            send(0.3 if request.movement == "Forward" else -0.3, 0.0)
    send(0.0, 0.0)
    return DiscreteServerResponse(True)


commands = rospy.Publisher("/cmd_vel", Twist, queue_size=10)
rospy.Subscriber("/odom", Odometry, on_odometry, queue_size=1)
while here is None:
    time.sleep(0.01)
rospy.Service("/discrete_move", DiscreteServer, handle)
rospy.spin()
