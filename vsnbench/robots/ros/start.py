"""Start of an episode over ROS: every part answers, the robot is at its start, its odometry is fresh.

All steps share one patience, except the operator's placement: parts that start late or restart are waited for.
"""

import logging
import math
import time
from collections.abc import Callable

from vsnbench.errors import NoAnswerError, NotPlacedError, RobotError, SensorLostError
from vsnbench.ros.common.robot_link import RobotLink
from vsnbench.sensing.hazards import Hazard
from vsnbench.sensing.images.camera_images import MotionEnd
from vsnbench.sensing.robot_reports import RobotSnapshot
from vsnbench.sites.site import StartingPosition
from vsnbench.values.pose import wrap_angle

logger = logging.getLogger(__name__)

_RETRY_S = 0.25
_CONNECTING_S = 1.0
"""Normal time of connection; no warning is logged before it is over."""
_PLACED_M, _PLACED_RAD = 0.02, math.radians(1)
"""A placed robot is this close to its start."""


class Patience:
    """Time in which the parts of a robot have to answer; logs once what is waited for."""

    def __init__(self, allowed_s: float) -> None:
        self.allowed_s = allowed_s
        self._give_up_s = time.monotonic() + allowed_s
        self._logged = ""

    @property
    def left_s(self) -> float:
        """Remaining seconds, at least one retry period."""
        return max(self._give_up_s - time.monotonic(), _RETRY_S)

    def wait(self, missing: RobotError) -> None:
        """Pause before the next attempt.

        Raises:
            RobotError: the time is over.
        """
        if time.monotonic() >= self._give_up_s:
            raise RobotError(
                f"{missing.statement} (waited {self.allowed_s:.0f} s)", advice=missing.advice, code=missing.code
            ) from missing
        if (text := str(missing)) != self._logged and self.allowed_s - self.left_s > _CONNECTING_S:
            logger.warning("waiting: %s", text)
            self._logged = text
        time.sleep(_RETRY_S)

    def retry(self, step: Callable[[], None]) -> None:
        """Repeat `step` while a part of the robot does not answer.

        Raises:
            RobotError: the time is over, or the step fails for another reason.
        """
        while True:
            try:
                return step()
            except (NoAnswerError, SensorLostError) as error:
                self.wait(error)


def wait_until_ready(link: RobotLink, patience: Patience) -> None:
    """Wait until every part of the robot answers.

    Raises:
        RobotError: a part does not answer in time, or waiting does not help.
    """
    warned: set[str] = set()
    while (missing := link.missing_part(warned)) is not None:
        patience.wait(missing)


def place_simulated_robot(link: RobotLink, start: StartingPosition, seed: int, patience: Patience) -> None:
    """Have the simulator put the robot exactly at a start.

    Raises:
        RobotError: the robot cannot be there, or the simulator does not answer.
    """

    def is_placed(now: RobotSnapshot) -> bool:
        if now.truth is None:
            return False
        there = now.truth.payload
        turned_rad = wrap_angle(there.heading_rad - start.pose.heading_rad)
        return there.distance_to(start.pose) < _PLACED_M and abs(turned_rad) < _PLACED_RAD

    def place() -> None:
        _place(link, start, seed, patience)
        _wait(link, is_placed, 2.0, "the simulator's ground truth")

    patience.retry(place)


def carry_rehearsed_robot(link: RobotLink, start: StartingPosition, seed: int, patience: Patience) -> None:
    """Have the simulator of a rehearsal put the robot down near a start, as an operator would.

    Raises:
        RobotError: the robot cannot be there, or the simulator does not answer.
    """

    def carry() -> None:
        link.clear_events()
        _place(link, start, seed, patience)
        # The base reports the lifting on another topic: a late report would end or forbid the next movement.
        if link.reports_lifting and not link.wait_for(_was_put_down, 2.0):
            logger.warning("the base has not reported its wheels while it was carried")

    patience.retry(carry)


def _was_put_down(now: RobotSnapshot) -> bool:
    lifted = any(hazard is Hazard.WHEEL_DROP for hazard, _ in now.hazard_events)
    return lifted and not any(hazard is Hazard.WHEEL_DROP for hazard, _ in now.active_hazards)


def _place(link: RobotLink, start: StartingPosition, seed: int, patience: Patience) -> None:
    if problem := link.place(start.pose, seed, patience.left_s):
        raise RobotError(f"the robot cannot be at starting position {start.number}: {problem}", code="cannot-be-placed")


def require_no_hazard(link: RobotLink) -> None:
    """Make sure that no hazard sensor is active.

    Raises:
        NotPlacedError: a sensor is active.
    """
    if active := sorted({hazard.value for hazard, _ in link.snapshot().active_hazards}):
        raise NotPlacedError(
            f"the base reports: {', '.join(active)}",
            advice="put the robot flat on its wheels, away from what it touches",
        )


def await_fresh_odometry(link: RobotLink, patience: Patience) -> None:
    """Wait for a new odometry reading, for the start of the episode.

    Raises:
        RobotError: no odometry arrives.
    """
    began_s = time.monotonic()

    def fresh(now: RobotSnapshot) -> bool:
        return now.latest is not None and now.latest.arrival_s > began_s

    patience.retry(lambda: _wait(link, fresh, 2.0, f"odometry on {link.names.odometry_topic}"))


def present(now: RobotSnapshot) -> MotionEnd:
    """Return the current time on the robot's clock and on that of this process."""
    return MotionEnd(now.latest.stamp_s if now.latest else 0.0, time.monotonic())


def _wait(link: RobotLink, condition: Callable[[RobotSnapshot], bool], timeout_s: float, what: str) -> None:
    if not link.wait_for(condition, timeout_s):
        raise SensorLostError(
            f"no message of {what} for {timeout_s:g} s",
            advice=f"find the silent part: vsnbench doctor --robot {link.profile.argument}",
        )
