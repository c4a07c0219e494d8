"""Check that no hazard sensor of a base is active."""

import threading
from collections.abc import Iterator

from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.sensing.hazards import Hazard


class ActiveHazards:
    """The active hazard sensors of a base; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._active: dict[tuple[Hazard, int], str] = {}

    def take(self, hazard: Hazard, sensor: int, active: bool, where: str) -> None:
        """Take the state of one sensor."""
        with self._lock:
            self._active.pop((hazard, sensor), None)
            if active:
                self._active[hazard, sensor] = where

    def results(self) -> Iterator[CheckResult]:
        """Report the active sensors; nothing if there are none."""
        with self._lock:
            active = sorted(f"{hazard.value} ({where})" for (hazard, _), where in self._active.items())
        if active:
            advice = "free the robot, and put it flat on its wheels"
            yield CheckResult("hazards", Health.FAILED, f"the base reports: {', '.join(active)}", advice)
