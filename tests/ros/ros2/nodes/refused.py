"""Connects to robots and writes code and text of the errors as JSON: `refused.py CODES`.

CODES is JSON: the expected code by robot. Other errors are retried, because discovery is slow on a busy machine.
"""

import json
import sys
import time
from concurrent.futures import ThreadPoolExecutor

from vsnbench.errors import VsnbenchError
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros.robot import RosRobot
from vsnbench.ros.ros2.installation import require_ros2

PATIENCE_S = 4
GIVE_UP_S = 100


def error_of(robot: str, code: str) -> tuple[str, str]:
    give_up_s = time.monotonic() + GIVE_UP_S
    while True:
        try:
            with RosRobot(load_profile(robot), patience_s=PATIENCE_S):
                return "reached", ""
        except VsnbenchError as error:
            if code == error.code or time.monotonic() > give_up_s:
                return error.code, str(error)


require_ros2()
expected = json.loads(sys.argv[1])
with ThreadPoolExecutor(len(expected)) as pool:
    sys.stdout.write(json.dumps(list(pool.map(error_of, expected, expected.values()))) + "\n")
