"""Tries to reach robots all at once, `refused.py PATIENCE_S ROBOT...`: in one line each, why it cannot, in JSON."""

import json
import sys
from concurrent.futures import ThreadPoolExecutor

from vsnbench.errors import VsnbenchError
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros_robot import RosRobot
from vsnbench.ros2.installation import require_ros2


def said_of(robot: str) -> str:
    try:
        with RosRobot(load_profile(robot), patience_s=float(sys.argv[1])):
            return "reached"
    except VsnbenchError as error:
        return str(error)


require_ros2()
with ThreadPoolExecutor(len(sys.argv)) as pool:
    sys.stdout.write(json.dumps(list(pool.map(said_of, sys.argv[2:]))) + "\n")
