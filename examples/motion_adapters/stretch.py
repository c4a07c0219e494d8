"""A Stretch without ROS as a `Base`, by stretch_body: `python socket_adapter.py stretch:Stretch` on the robot.

Needs stretch_body and pyrealsense2, which its image has, and a homed robot. With stretch_ros2 the base takes Twist in
navigation mode: vsnbench then needs no adapter (`--robot stretch`). Profile: that of `stretch`, with `kind: adapter`.
"""

import time

import numpy as np
from by_velocity import PERIOD_S, Base


class Stretch(Base):
    """Velocities by `base.set_velocity` and `push_command`; the wheels hold the last one until the next.

    Args:
        robot: a started stretch_body.robot.Robot; by default a new one.
        camera: returns (colours (H, W, 3) uint8, depth (H, W) uint16 in mm, stamp), upright and aligned.
    """

    card = {  # noqa: RUF012
        "name": "stretch-body",
        "version": "1",
        "movements": ["move", "waypoint", "trajectory", "velocity"],
        "sensors": ["rgb", "depth"],
    }
    near_m, near_rad = 0.008, 0.01

    def __init__(self, robot=None, camera=None) -> None:
        self._robot = robot or _started()
        self._camera = camera or _realsense()
        self._image = None

    @property
    def now_s(self) -> float:
        return time.time()

    @property
    def pose(self) -> tuple[float, float, float]:
        status = self._robot.base.status
        return status["x"], status["y"], status["theta"]

    def send(self, forward_m_s: float, turn_rad_s: float) -> str:
        if self._robot.pimu.status["runstop_event"]:
            return "fault"
        wheels = self._robot.base.left_wheel, self._robot.base.right_wheel
        if any(wheel.status["in_guarded_event"] for wheel in wheels):
            return "collision"  # the effort of a wheel has passed its contact threshold
        self._robot.base.set_velocity(forward_m_s, turn_rad_s)
        self._robot.push_command()
        self._wait()
        return ""

    def _wait(self) -> None:
        time.sleep(PERIOD_S)

    def stop(self) -> None:
        self._robot.base.set_velocity(0.0, 0.0)
        self._robot.push_command()

    def state(self, *, with_depth: bool = False) -> dict:
        status = self._robot.base.status
        state = {"pose": [status["x"], status["y"], status["theta"]], "stamp_s": status["timestamp_pc"]}
        state["battery"] = {"volts": self._robot.pimu.status["voltage"]}
        if with_depth:
            self._image = self._camera()
            _, depth, stamp_s = self._image
            state |= {"depth": _image("mm16", depth.astype("<u2")), "depth_stamp_s": stamp_s}
        return state

    def colours(self) -> dict:
        return _image("raw", (self._image or self._camera())[0])


def _image(encoding: str, pixels: np.ndarray) -> dict:
    return {"encoding": encoding, "height": pixels.shape[0], "width": pixels.shape[1], "data": pixels.tobytes()}


def _started():
    from stretch_body.robot import Robot

    robot = Robot()
    if not robot.startup():
        raise SystemExit("the robot does not start: another program may use it")
    return robot


def _realsense():
    import pyrealsense2 as rs

    pipeline, config = rs.pipeline(), rs.config()
    config.enable_stream(rs.stream.color, 640, 480, rs.format.rgb8, 15)
    config.enable_stream(rs.stream.depth, 640, 480, rs.format.z16, 15)
    pipeline.start(config)
    align = rs.align(rs.stream.color)

    def shoot() -> tuple:
        frames = align.process(pipeline.wait_for_frames())
        colours, depth = (
            np.asanyarray(frame.get_data()) for frame in (frames.get_color_frame(), frames.get_depth_frame())
        )
        return np.ascontiguousarray(np.rot90(colours, -1)), np.ascontiguousarray(np.rot90(depth, -1)), time.time()

    return shoot
