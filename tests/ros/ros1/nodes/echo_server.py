"""A plain rospy server of discrete_move with scripted answers, as a stand-in for third-party servers.

Movement `Sleep` waits `angle` milliseconds, `Raise` fails in the handler, `No` answers False, anything else True.
"""

import os
import time

import rospy

from vsnbench.ros.ros1.messages import DiscreteServer, DiscreteServerResponse


def handle(request) -> DiscreteServerResponse:
    if request.movement == "Sleep":
        time.sleep(request.angle / 1000)
    if request.movement == "Raise":
        raise RuntimeError("the wheels came off")
    if request.movement == "Die":
        os._exit(3)
    return DiscreteServerResponse(request.movement != "No")


rospy.init_node("echo_server")
rospy.Service("/discrete_move", DiscreteServer, handle)
rospy.spin()
