"""Attitude of a base from its odometry or an IMU: checks, and the attitude at the time of an image."""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from vsnbench.sensing.images.camera_images import Stamped
from vsnbench.sensing.odometry.transform_chain import Quaternion, Vector
from vsnbench.values.pose import Attitude

GRAVITY_M_S2 = 9.81
_MOST_LEAN_RAD = math.radians(45)
"""A base that leans more has fallen, or the attitude is that of another frame."""
_MOST_DIFFERENCE_RAD = math.radians(10)
"""Largest angle between the vertical by the orientation and by the mean acceleration of an IMU."""
_GRAVITY_SHARE = 0.1
"""Largest relative error of the mean acceleration; accelerometers are accurate to 1 %, and steps average out."""
_MEAN_S = 1.0
_FEW = 5
_FARTHEST_S = 0.1
"""Largest time between an image and the nearest attitude."""
FROM_ODOMETRY = "or take the attitude from the odometry (interface.attitude.topic)"


class AttitudeReader:
    """Checks the messages of one source; not thread-safe.

    Args:
        topic: its topic, for errors.
        frame: frame whose axes are those of the base, for an IMU.
    """

    def __init__(self, topic: str, frame: str) -> None:
        self._topic = topic
        self._frame = frame
        self._accelerations: deque[tuple[float, Vector]] = deque()

    def read(self, turned: Quaternion) -> Attitude | str:
        """Return the attitude of an orientation x, y, z, w, or why it is none."""
        try:
            attitude = Attitude.of_quaternion(*turned)
        except ValueError as error:
            return f"{self._topic} has no attitude: its orientation {error}"
        if (lean_rad := attitude.lean_rad) > _MOST_LEAN_RAD:
            return (
                f"by {self._topic} the base leans by {math.degrees(lean_rad):.0f}°: it has fallen, or the attitude is "
                "that of another frame than the base's"
            )
        return attitude

    def read_imu(
        self, turned: Quaternion, acceleration_m_s2: Vector, stamp_s: float, frame: str, *, has_orientation: bool = True
    ) -> Attitude | str:
        """Return the attitude in a sensor_msgs/Imu, or why it is none.

        Args:
            turned: orientation x, y, z, w.
            acceleration_m_s2: acceleration with gravity, in the frame of the IMU: near 9.81 along z at rest.
            stamp_s: stamp of the message.
            frame: frame of the message.
            has_orientation: whether the first element of the orientation's covariance is not -1.
        """
        if frame != self._frame:
            return (
                f"{self._topic} is in the frame {frame or 'without a name'}, not in {self._frame}: if its axes are "
                "those of the base, set interface.attitude.frame to it"
            )
        if not has_orientation:
            return f"{self._topic} has no orientation: start a filter that computes it, {FROM_ODOMETRY}"
        mean = self._mean(acceleration_m_s2, stamp_s)
        size, is_known = float(np.linalg.norm(mean)), len(self._accelerations) >= _FEW
        if is_known and not abs(size - GRAVITY_M_S2) <= _GRAVITY_SHARE * GRAVITY_M_S2:
            return (
                f"the acceleration of {self._topic} is {size:.2f} m/s², not {GRAVITY_M_S2:g}: without gravity its "
                f"attitude cannot be checked. Have its driver publish m/s² with gravity, {FROM_ODOMETRY}"
            )
        attitude = self.read(turned)
        if isinstance(attitude, str):
            return attitude
        apart_rad = math.acos(max(-1.0, min(1.0, float(mean @ attitude.rotation[2]) / max(size, 1e-9))))
        if is_known and apart_rad > _MOST_DIFFERENCE_RAD:
            return (
                f"the vertical of {self._topic} is {math.degrees(apart_rad):.0f}° apart by its orientation and by its "
                f"acceleration: they are in different frames. Correct its driver, {FROM_ODOMETRY}"
            )
        return attitude

    def _mean(self, acceleration_m_s2: Vector, stamp_s: float) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
        """Return the mean of the last second."""
        if self._accelerations and stamp_s < self._accelerations[-1][0]:
            self._accelerations.clear()
        self._accelerations.append((stamp_s, acceleration_m_s2))
        while self._accelerations[0][0] < stamp_s - _MEAN_S:
            self._accelerations.popleft()
        return np.asarray(np.mean([vector for _, vector in self._accelerations], axis=0))


def attitude_at(attitudes: Sequence[Stamped[Attitude]], stamp_s: float) -> Attitude | None:
    """Return the attitude at a time, interpolated; None if no attitude was measured within 0.1 s of it.

    Args:
        attitudes: oldest first.
        stamp_s: time on the clock of their stamps.
    """
    if not attitudes or min(abs(measured.stamp_s - stamp_s) for measured in attitudes) > _FARTHEST_S:
        return None
    stamps = [measured.stamp_s for measured in attitudes]
    rolls = [measured.payload.roll_rad for measured in attitudes]
    pitches = [measured.payload.pitch_rad for measured in attitudes]
    return Attitude(float(np.interp(stamp_s, stamps, rolls)), float(np.interp(stamp_s, stamps, pitches)))
