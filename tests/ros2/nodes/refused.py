"""Tries to reach robots, `refused.py WORDS`: in one line each, why it cannot, in JSON.

WORDS is JSON: for each robot words of the refusal. A robot is tried again until they come, as a machine that does much
else may hear too little of it at first; one that is reached is not.
"""

import json
import sys
import time
from concurrent.futures import ThreadPoolExecutor

from vsnbench.errors import VsnbenchError
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros_robot import RosRobot
from vsnbench.ros2.installation import require_ros2

PATIENCE_S = 4
GIVE_UP_S = 100


def said_of(robot: str, words: str) -> str:
    give_up_s = time.monotonic() + GIVE_UP_S
    while True:
        try:
            with RosRobot(load_profile(robot), patience_s=PATIENCE_S):
                return "reached"
        except VsnbenchError as error:
            if words in str(error) or time.monotonic() > give_up_s:
                return str(error)


require_ros2()
wanted = json.loads(sys.argv[1])
with ThreadPoolExecutor(len(wanted)) as pool:
    sys.stdout.write(json.dumps(list(pool.map(said_of, wanted, wanted.values()))) + "\n")
