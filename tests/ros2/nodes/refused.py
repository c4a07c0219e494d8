"""Tries to reach the robot of a profile, `refused.py PROFILE PATIENCE_S`, and prints in one line why it cannot."""

import sys

from vsnbench.errors import VsnbenchError
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros_robot import RosRobot

try:
    with RosRobot(load_profile(sys.argv[1]), patience_s=float(sys.argv[2])):
        sys.stdout.write("reached\n")
except VsnbenchError as error:
    sys.stdout.write(f"{error}\n")
