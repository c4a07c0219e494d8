"""Before an episode over ROS, 1 or 2: every part answers, the robot stands at its start, its odometry is fresh.

All of it, but for the person's time, shares one patience: parts that come up late, or come back, are waited for.
"""

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from vsnbench.errors import NoAnswerError, NotPlacedError, RobotError, SensorLostError
from vsnbench.protocol.site import StartingPosition
from vsnbench.robots.ros_link import RobotLink
from vsnbench.sensing.camera_images import MotionEnd
from vsnbench.sensing.discrete_mover import Hazard
from vsnbench.sensing.robot_reports import RobotSnapshot

logger = logging.getLogger(__name__)

_RETRY_S = 0.25
_CONNECTING_S = 1.0
"""Parts that answer take this long to connect, of which nothing need be said."""


@dataclass
class Patience:
    """How long the parts of a robot may still take to answer; says once what is waited for."""

    allowed_s: float
    _give_up_s: float = field(init=False)
    _said: str = field(init=False, default="")

    def __post_init__(self) -> None:
        self._give_up_s = time.monotonic() + self.allowed_s

    @property
    def left_s(self) -> float:
        """Seconds that are left; not less than one period of trying again."""
        return max(self._give_up_s - time.monotonic(), _RETRY_S)

    def wait(self, missing: RobotError) -> None:
        """Pause before another try.

        Raises:
            RobotError: there is no patience left.
        """
        if time.monotonic() >= self._give_up_s:
            raise RobotError(f"{missing.statement} (waited {self.allowed_s:.0f} s)", advice=missing.advice) from missing
        if (said := str(missing)) != self._said and self.allowed_s - self.left_s > _CONNECTING_S:
            logger.warning("waiting: %s", said)
            self._said = said
        time.sleep(_RETRY_S)

    def insist_on(self, step: Callable[[], None]) -> None:
        """Do `step`, again and again while a part of the robot does not answer.

        Raises:
            RobotError: there is no patience left, or it fails for another reason.
        """
        while True:
            try:
                return step()
            except (NoAnswerError, SensorLostError) as error:
                self.wait(error)


def wait_until_ready(link: RobotLink, patience: Patience) -> None:
    """Wait until every part of the robot answers; say what is waited for.

    Raises:
        RobotError: a part does not answer within the patience, or never will; the message says what to start.
    """
    warned: set[str] = set()
    while (missing := link.missing_part(warned)) is not None:
        patience.wait(missing)


def have_it_placed_by_the_simulator(link: RobotLink, start: StartingPosition, seed: int, patience: Patience) -> None:
    """Have the simulator put the robot at `start`.

    Raises:
        RobotError: it cannot stand there, or the simulator does not answer.
    """

    def is_there(now: RobotSnapshot) -> bool:
        return now.truth is not None and now.truth.payload.distance_to(start.pose) < 0.02

    def place() -> None:
        _put(link, start, seed, patience)
        _wait(link, is_there, 2.0, "the simulator's ground truth")

    patience.insist_on(place)


def have_it_carried(link: RobotLink, start: StartingPosition, seed: int, patience: Patience) -> None:
    """Have a simulator that pretends to be real put the robot down near `start`, as a person would.

    Raises:
        RobotError: it cannot stand there, or the simulator does not answer.
    """

    def carry() -> None:
        link.clear_events()
        _put(link, start, seed, patience)
        # The base tells of the lifting beside the answer: what came late would end the next movement, or forbid it.
        if link.tells_of_lifting and not link.wait_for(_was_put_down, 2.0):
            logger.warning("the base has said nothing of its wheels while it was carried")

    patience.insist_on(carry)


def _was_put_down(now: RobotSnapshot) -> bool:
    lifted = any(hazard is Hazard.WHEEL_DROP for hazard, _ in now.hazard_events)
    return lifted and not any(hazard is Hazard.WHEEL_DROP for hazard, _ in now.pressed)


def _put(link: RobotLink, start: StartingPosition, seed: int, patience: Patience) -> None:
    if problem := link.place(start.pose, seed, patience.left_s):
        raise RobotError(f"the robot cannot stand at starting position {start.number}: {problem}")


def require_it_stands(link: RobotLink) -> None:
    """See that the robot stands on its wheels and nothing is pressed.

    Raises:
        NotPlacedError: it does not.
    """
    if pressed := sorted({hazard.value for hazard, _ in link.snapshot().pressed}):
        raise NotPlacedError(
            f"the base still reports: {', '.join(pressed)}",
            advice="set it flat on its wheels, away from what it touches",
        )


def await_fresh_odometry(link: RobotLink, patience: Patience) -> None:
    """Wait for a reading from after now, to call it the start of the episode.

    Raises:
        RobotError: no odometry comes.
    """
    asked_s = time.monotonic()

    def fresh(now: RobotSnapshot) -> bool:
        return now.latest is not None and now.latest.arrival_s > asked_s

    patience.insist_on(lambda: _wait(link, fresh, 2.0, f"odometry on {link.names.odometry}"))


def present(now: RobotSnapshot) -> MotionEnd:
    """Return the present on the robot's clock and on ours: images from now on show what is."""
    return MotionEnd(now.latest.stamp_s if now.latest else 0.0, time.monotonic())


def _wait(link: RobotLink, condition: Callable[[RobotSnapshot], bool], timeout_s: float, what: str) -> None:
    if not link.wait_for(condition, timeout_s):
        raise SensorLostError(
            f"waited {timeout_s:g} s in vain for {what}", advice="`vsnbench doctor` says what is silent"
        )
