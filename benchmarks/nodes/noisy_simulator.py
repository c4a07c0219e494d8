"""Runs `vsnbench robots simulate` with white noise on the odometry, also at rest.

    python benchmarks/nodes/noisy_simulator.py HEADING_DEG POSITION_MM ros1|ros2 simulate ROBOT ...

The true pose stays exact. The noise affects only the odometry and not the motion of the base.
"""

import math
import random
import sys

if "ros2" in sys.argv:
    from vsnbench.ros2.installation import require_ros2

    require_ros2()  # it may restart Python with this command line
from vsnbench.__main__ import main
from vsnbench.simulator import robot_player
from vsnbench.simulator.dynamics.simulated_base import SimulatedBase
from vsnbench.values.pose import Pose

heading_rad, position_m = math.radians(float(sys.argv[1])), float(sys.argv[2]) / 1000
rng = random.Random(1)


class NoisyBase(SimulatedBase):
    """A base with white noise on its odometry."""

    @property
    def odometry(self) -> Pose:
        """Current odometry with noise."""
        exact = super().odometry
        return Pose(
            exact.x_m + rng.gauss(0, position_m),
            exact.y_m + rng.gauss(0, position_m),
            exact.heading_rad + rng.gauss(0, heading_rad),
        )


robot_player.SimulatedBase = NoisyBase
sys.argv = ["vsnbench", "robots", *sys.argv[4:]]
main()
