"""Before an episode over ROS: every part answers, the robot stands at its start, odometry counts from there."""

import logging
import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from vsnbench.errors import RobotError, SensorLostError
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import StartingPosition
from vsnbench.robots.contract import Attendant
from vsnbench.ros1.interface import ros1_interface

if TYPE_CHECKING:
    from vsnbench.ros1.robot_link import RobotLink

logger = logging.getLogger(__name__)

_AGE_LIMIT_S = 1.0
"""A part whose last message is older does not answer."""


def wait_until_ready(link: "RobotLink", profile: RobotProfile, patience_s: float) -> None:
    """Wait until every part of the robot answers; say what is waited for.

    Raises:
        RobotError: a part does not answer within the patience; the message says what to start.
    """
    give_up_s = time.monotonic() + patience_s
    told = ""
    while missing := _missing_part(link, profile):
        if time.monotonic() >= give_up_s:
            raise RobotError(f"{missing} (waited {patience_s:.0f} s)")
        if missing != told:
            logger.warning("waiting: %s", missing)
            told = missing
        time.sleep(0.25)


def have_it_placed_by_the_simulator(link: "RobotLink", start: StartingPosition, seed: int, timeout_s: float) -> None:
    """Have the simulator put the robot at `start`.

    Raises:
        RobotError: it cannot stand there, or the simulator does not answer.
    """
    if problem := link.place(start.pose, seed, timeout_s):
        raise RobotError(f"the robot cannot stand at starting position {start.number}: {problem}")

    def is_there() -> bool:
        return link.truth is not None and link.truth.payload.distance_to(start.pose) < 0.02

    _wait(link, is_there, 5.0, "the simulator's ground truth")


def have_it_placed_by_a_person(
    link: "RobotLink", start: StartingPosition, attendant: Attendant | None, profile: RobotProfile
) -> None:
    """Have a person put the robot at `start`; not before its wheels carry it and nothing is pressed.

    Raises:
        RobotError: there is nobody to do it.
    """
    if attendant is None:
        raise RobotError(
            f"nothing can put {profile.name} at starting position {start.number} but a person, and nobody was named: "
            "run in a terminal, or with --unattended"
        )
    problem = ""
    while True:
        attendant.put_at(start, problem)
        with link.news:
            pressed = [hazard.value for hazard, sensors in link.hazards.items() if sensors]
        if not pressed:
            return
        problem = f"the base still reports: {', '.join(pressed)}"


def await_zeroed_odometry(link: "RobotLink", profile: RobotProfile) -> None:
    """Wait until a base that can reset its position has done so, and for a reading from after that.

    Raises:
        SensorLostError: no odometry comes.
    """
    if ros1_interface(profile).reset_odometry:

        def zeroed() -> bool:
            latest = link.tracker.latest
            return latest is not None and math.hypot(*latest.pose.position) < 0.001

        link.wait_for(zeroed, 0.5)
    asked_s = time.monotonic()

    def fresh() -> bool:
        latest = link.tracker.latest
        return latest is not None and latest.arrival_s > asked_s

    _wait(link, fresh, 2.0, f"odometry on {ros1_interface(profile).odometry}")


def _missing_part(link: "RobotLink", profile: RobotProfile) -> str:
    """Return the first part that does not answer and what to do about it; empty when all do."""
    names, now_s = ros1_interface(profile), time.monotonic()
    with link.news:
        latest = link.tracker.latest
        if latest is None or now_s - latest.arrival_s > _AGE_LIMIT_S:
            return f"no odometry on {names.odometry}: start the base's driver"
        for topic, frames in ((names.color, link.colors), (names.depth, link.depths)):
            if topic and (not frames or now_s - frames[-1].arrival_s > _AGE_LIMIT_S):
                return f"no image on {topic}: start the camera's driver"
    try:
        link.discrete_move.probe()
    except RobotError as error:
        return f"{error} (vsnbench ros discrete-move --robot {profile.name})"
    return ""


def _wait(link: "RobotLink", condition: Callable[[], bool], timeout_s: float, what: str) -> None:
    if not link.wait_for(condition, timeout_s):
        raise SensorLostError(f"waited {timeout_s:g} s in vain for {what}")
