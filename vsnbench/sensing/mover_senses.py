"""What a mover has to know of its base besides the odometry: hazards, faults, and other publishers."""

from vsnbench.sensing.hazards import Hazard
from vsnbench.sensing.odometry.odometry import OdometryFault


class MoverSenses:
    """Reports of other threads; not thread-safe.

    Attributes:
        hazard_reason: hazard since the movement began, or an empty string.
        odometry_fault: fault of the odometry since the movement began, or None.
        rival: fault of another publisher that commanded the base since the movement began, or an empty string.
    """

    def __init__(self) -> None:
        self._active: dict[Hazard, set[int]] = {hazard: set() for hazard in Hazard}
        self.begin()

    def begin(self) -> None:
        """Forget what was reported before a movement; active hazard sensors stay active."""
        self.hazard_reason = ""
        self.odometry_fault: OdometryFault | None = None
        self.rival = ""

    def take_hazard(self, hazard: Hazard, sensor: int, active: bool, where: str) -> None:
        """Take the state of one hazard sensor."""
        if not active:
            self._active[hazard].discard(sensor)
            return
        self._active[hazard].add(sensor)
        self.hazard_reason = f"{hazard.value} ({where})"

    def forbidden(self, *, backs_off: bool) -> str:
        """Return the active hazard that forbids a leg, or an empty string; backing off is allowed."""
        if self._active[Hazard.WHEEL_DROP]:
            return "a wheel is dropped: put the robot down"
        for hazard in (Hazard.BUMPER, Hazard.CLIFF):
            if self._active[hazard] and not backs_off:
                return f"the {hazard.value} sensor is active: free the robot; only Backward is allowed"
        return ""

    def failure(self, silent_s: float, timeout_s: float) -> tuple[str, bool]:
        """Return why the running movement has to end, or an empty string; and whether the sensor is lost.

        Args:
            silent_s: time since the last odometry.
            timeout_s: time after which odometry is lost.
        """
        if self.hazard_reason:
            return self.hazard_reason, False
        if silent_s > timeout_s:
            return f"no odometry for {silent_s:.1f} s", True
        if self.odometry_fault:
            return self.odometry_fault.text, True
        return self.rival, False
