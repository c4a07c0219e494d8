"""A simulated robot over ROS with the camera fault that a line on stdin names: `faulty_robot.py ros1|ros2 ROBOT`.

`right`, `nan`, `frozen` (one depth image with new stamps), `frozen colour`, `left half` (without depth), `millimetres`
(32FC1), `holes` (half of the pixels), `minimum range` (nothing nearer than 0.6 m), `ahead` (stamps 10 s in the future).
"""

import sys
import threading
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from vsnbench.robots.profiles import load_profile
from vsnbench.simulator.robot_player import CameraImages, SimulationOptions
from vsnbench.sites.site import load_site
from vsnbench.values.camera import CameraRole

MINIMUM_RANGE_MM = 600
AHEAD_S = 10.0
generation, robot = sys.argv[1:3]
if generation == "ros2":
    from vsnbench.ros.ros2.installation import require_ros2

    require_ros2()
    from vsnbench.ros.ros2.node import run_node
    from vsnbench.ros.ros2.simulated_robot_node import Ros2SimulatedRobot as SimulatedRobot
else:
    from vsnbench.ros.ros1.installation import require_ros1

    require_ros1()
    from vsnbench.ros.ros1.node import run_node
    from vsnbench.ros.ros1.simulated_robot_node import Ros1SimulatedRobot as SimulatedRobot


class FaultyRobotNode(SimulatedRobot):
    """Simulates a robot with a faulty camera."""

    fault = "right"

    def __init__(self, *arguments: Any) -> None:
        self._rng = np.random.default_rng(0)
        self._frozen: Any = None
        super().__init__(*arguments)

    def publish_images(self, images: Mapping[CameraRole, CameraImages]) -> None:
        """Publish the main camera's images with the current fault."""
        picture = images[CameraRole.FRONT]
        fault, depth_mm, rgb = self.fault, picture.depth_mm, picture.rgb
        if not fault.startswith("frozen"):
            self._frozen = None
        if fault == "nan":
            depth_mm = np.zeros_like(depth_mm)
        elif fault == "frozen":
            self._frozen = depth_mm.copy() if self._frozen is None else self._frozen
            depth_mm = self._frozen
        elif fault == "frozen colour":
            self._frozen = rgb.copy() if self._frozen is None else self._frozen
            rgb = self._frozen
        elif fault == "left half":
            depth_mm = depth_mm.copy()
            depth_mm[:, : depth_mm.shape[1] // 2] = 0
        elif fault == "millimetres":
            depth_mm = np.where(depth_mm == 0, np.nan, depth_mm).astype(np.float32)
        elif fault == "holes":
            depth_mm = np.where(self._rng.random(depth_mm.shape) < 0.5, 0, depth_mm).astype(np.uint16)
        elif fault == "minimum range":
            depth_mm = np.where(depth_mm < MINIMUM_RANGE_MM, 0, depth_mm).astype(np.uint16)
        stamp_s = picture.stamp_s + (AHEAD_S if fault == "ahead" else 0)
        super().publish_images({CameraRole.FRONT: replace(picture, depth_mm=depth_mm, rgb=rgb, stamp_s=stamp_s)})

    def _image_message(self, pixels: Any, encoding: str, *others: Any) -> Any:
        return super()._image_message(pixels, "32FC1" if pixels.dtype == np.float32 else encoding, *others)


def obey(node: FaultyRobotNode) -> None:
    """Read faults from stdin."""
    for line in sys.stdin:
        node.fault = line.strip()
        sys.stdout.write(f"now {node.fault}\n")
        sys.stdout.flush()


def play(communication: Any) -> FaultyRobotNode:
    """Return the node that simulates the robot."""
    played = (load_site("apartment"), load_profile(robot), SimulationOptions())
    node = FaultyRobotNode(*((communication, *played) if generation == "ros2" else (*played, communication)))
    threading.Thread(target=obey, args=(node,), daemon=True).start()
    return node


if generation == "ros2":
    from vsnbench.ros.ros2.interface import ros2_interface

    run_node("simulated_robot", ros2_interface(load_profile(robot)).root, play, f"playing {robot}")
else:
    run_node("simulated_robot", [], play, f"playing {robot}")
