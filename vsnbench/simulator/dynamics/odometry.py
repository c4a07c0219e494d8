"""Dead reckoning from wheel rotation."""

from vsnbench.simulator.dynamics.physics import WheelAngles
from vsnbench.values.pose import Pose, advanced


class WheelOdometry:
    """Integrates short arcs; the pose is relative to the last reset, and its heading is not wrapped.

    Args:
        radius_m: rolling radius of the wheels.
        track_m: distance between them.
        step_m: way of a wheel per count of its encoder; 0 for an exact encoder.
    """

    def __init__(self, radius_m: float, track_m: float, step_m: float = 0.0) -> None:
        self._radius_m, self._track_m = radius_m, track_m
        self._step_rad = step_m / radius_m
        self.zero(WheelAngles(0.0, 0.0))

    def zero(self, angles: WheelAngles) -> None:
        """Set the pose to zero."""
        self._last = self._counted(angles) if self._step_rad else angles
        self.pose = Pose(0.0, 0.0, 0.0)

    def update(self, angles: WheelAngles) -> Pose:
        """Return the pose at the newest wheel angles."""
        if self._step_rad:
            angles = self._counted(angles)
        left_m = (angles.left_rad - self._last.left_rad) * self._radius_m
        right_m = (angles.right_rad - self._last.right_rad) * self._radius_m
        self._last = angles
        self.pose = advanced(self.pose, (left_m + right_m) / 2, (right_m - left_m) / self._track_m)
        return self.pose

    def _counted(self, angles: WheelAngles) -> WheelAngles:
        """Return the angles as the encoders count them."""
        step_rad = self._step_rad
        return WheelAngles(round(angles.left_rad / step_rad) * step_rad, round(angles.right_rad / step_rad) * step_rad)
