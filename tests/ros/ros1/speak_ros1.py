"""Runs a Python file in a process that uses ROS 1: `speak_ros1.py FILE ARGUMENTS`."""

import runpy
import sys

from vsnbench.ros.ros1.installation import require_ros1

require_ros1()
del sys.argv[0]
runpy.run_path(sys.argv[0], run_name="__main__")
