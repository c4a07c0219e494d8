"""Checks of a movement that an adapter reports while it runs."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.robots.adapter.images import in_range
from vsnbench.robots.adapter.messages import AdapterState
from vsnbench.robots.contract import DrivingView, Watch
from vsnbench.sensing.movement_check import MovementAlarmError, overshoot, remaining_m
from vsnbench.values.camera import Camera
from vsnbench.values.movement import Drive
from vsnbench.values.pose import Pose

_DRIVING_M_S = 0.015
"""A slower robot stands, or turns on the spot, and needs no free way."""
_LONGEST_AGE_S = 0.3
"""No movement forward goes on if the last depth image was captured longer ago."""


class MovementWatch:
    """Takes every progress of one movement.

    Attributes:
        movement: the movement.
        before: odometry at its begin, relative to the episode's start; `pose` is the newest.
        path_m: length of the driven path so far.
        alarm: why the movement was stopped, or None.
    """

    def __init__(
        self, movement: Drive, before: Pose, camera: Camera, look: Watch | None, read: Callable[[AdapterState], Pose]
    ) -> None:
        self.movement = movement
        self.before = self.pose = before
        self.path_m = 0.0
        self.alarm: MovementAlarmError | None = None
        self._camera = camera
        self._look = look if movement.ahead > 0 else None
        self._read = read
        self._began_s = self._stamp_s = math.nan
        self._depth_m: npt.NDArray[np.float32] | None = None
        self._depth_stamp_s = -math.inf

    def prepare(self, depth_m: npt.NDArray[np.float32] | None) -> None:
        """Look once while the robot is at rest: loading the compiled code of a look takes longer than one may take.

        Args:
            depth_m: (H, W) depth of the last observation; None if there is none.
        """
        if self._look is not None:
            camera = self._camera
            seen_m = in_range(np.full((camera.height, camera.width), np.nan, np.float32), camera)
            seen_m = seen_m if depth_m is None else depth_m
            self._look(DrivingView(seen_m, camera.without_roll, self.before, 0.0, 0.0, 0.0, 0.0, math.inf))

    @property
    def lasted_s(self) -> float:
        """Duration so far on the robot's clock."""
        lasted_s = self._stamp_s - self._began_s
        return lasted_s if math.isfinite(lasted_s) else 0.0

    def take(self, message: Mapping[str, Any]) -> str:
        """Take a `progress`; return why the robot must stop, or an empty string.

        Raises:
            RobotError: the message breaks the protocol, or its odometry is not sound.
        """
        state = AdapterState.of(message)
        try:
            self._check(state, *self._moved(state))
        except MovementAlarmError as alarm:
            self.alarm = alarm
            return str(alarm)
        return ""

    def end(self, message: Mapping[str, Any]) -> None:
        """Take the `done` message."""
        self._moved(AdapterState.of(message))

    def _moved(self, state: AdapterState) -> tuple[float, float]:
        """Take the odometry; return the velocity, m/s forward and rad/s."""
        pose, passed_s = self._read(state), state.stamp_s - self._stamp_s
        motion = pose.relative_to(self.pose)
        self.path_m += math.hypot(motion.x_m, motion.y_m)
        self.pose, self._stamp_s = pose, state.stamp_s
        if math.isnan(self._began_s):
            self._began_s = state.stamp_s
        if state.velocity is not None:
            return state.velocity
        if not passed_s > 0:
            return 0.0, 0.0
        return math.copysign(math.hypot(motion.x_m, motion.y_m), motion.x_m) / passed_s, motion.heading_rad / passed_s

    def _check(self, state: AdapterState, linear_m_s: float, angular_rad_s: float) -> None:
        if state.hazards:
            raise MovementAlarmError(", ".join(sorted(hazard.value for hazard in state.hazards)))
        if state.rival:
            raise MovementAlarmError(f"{state.rival} is driving the robot too: end that program")
        if overshot := overshoot(self.movement, self.before, self.pose):
            raise MovementAlarmError(f"the adapter was stopped: {overshot}")
        if self._look is None:
            return
        if state.depth_m is not None:
            self._depth_m, self._depth_stamp_s = in_range(state.depth_m, self._camera), state.depth_stamp_s
        age_s = max(state.stamp_s - self._depth_stamp_s, 0.0)
        if self._depth_m is None or age_s > _LONGEST_AGE_S:
            since = "" if self._depth_m is None else f" for {age_s:.1f} s"
            raise MovementAlarmError(f"no depth image{since}", blocked=True)
        if linear_m_s < _DRIVING_M_S:
            return
        left_m = remaining_m(self.movement, self.before, self.pose)
        camera, stamp_s = self._camera.without_roll, self._depth_stamp_s
        view = DrivingView(self._depth_m, camera, self.pose, stamp_s, age_s, linear_m_s, angular_rad_s, left_m)
        if reason := self._look(view):
            raise MovementAlarmError(reason, blocked=True)
