"""The check-up of a motion adapter over ROS 2: its deadline, and whether it misses its client."""

import math
import time
from collections.abc import Iterator
from dataclasses import replace

from vsnbench.robots.checkup.commanded_turn import turn_timeout_s
from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.ros.common.robot_link import RobotLink
from vsnbench.ros.ros2.topic_service import ANSWER_S, GONE_S
from vsnbench.values.movement import Move
from vsnbench.values.robot_profile import RobotProfile

_TURN = Move(turn_rad=math.radians(30), holds_heading=True)
_TURNING_RAD = math.radians(3)
"""A turn has begun."""
_DEADLINE_S, _REACTION_S = 0.4, 0.5
"""Deadline of a turn that takes longer, and the time for it, or for a lost client, to take effect."""
_SETTLE_S, _REST_S = 0.3, 4.0


class _LeftError(Exception):
    """The check of a lost client leaves its movement."""


def service_results(link: RobotLink, profile: RobotProfile) -> Iterator[CheckResult]:
    """Turn to the left beyond a deadline, and to the right without a client.

    Raises:
        NoAnswerError: the adapter does not answer.
    """
    yield _deadline_result(link)
    yield _lost_client_result(link, profile)


def _deadline_result(link: RobotLink) -> CheckResult:
    due_s = time.monotonic() + _DEADLINE_S
    answered = link.drive(_TURN, _DEADLINE_S + ANSWER_S)
    seen, is_late = _rest_after(link, due_s, f"its deadline of {_DEADLINE_S:g} s")
    outcome = link.snapshot().outcome
    seen = f"answered: {'completed' if answered or outcome is None else outcome.failure}; {seen}"
    if answered or is_late:
        advice = "stop the robot at `deadline_s`, and answer `refusal: deadline` (docs/motion-adapter.md)"
        return CheckResult("deadline", Health.FAILED, seen, advice)
    return CheckResult("deadline", Health.OK, seen)


def _lost_client_result(link: RobotLink, profile: RobotProfile) -> CheckResult:
    before = link.snapshot().latest

    def leave() -> None:
        now = link.snapshot().latest
        if before and now and abs(now.pose.heading_rad - before.pose.heading_rad) > _TURNING_RAD:
            raise _LeftError

    try:
        link.drive(replace(_TURN, turn_rad=-_TURN.turn_rad), turn_timeout_s(_TURN, profile), leave)
    except _LeftError:
        seen, is_late = _rest_after(link, time.monotonic() + GONE_S, f"{GONE_S:g} s without a question")
        advice = "stop the robot when the question is not repeated (docs/motion-adapter.md)"
        if is_late:
            return CheckResult("lost client", Health.FAILED, seen, advice)
        return CheckResult("lost client", Health.OK, seen)
    return CheckResult("lost client", Health.WARNING, "not checked: the turn ended before")


def _rest_after(link: RobotLink, due_s: float, what: str) -> tuple[str, bool]:
    """Wait for rest; return when it came after `due_s` on the monotonic clock, and whether that was too late."""
    rests = link.wait_for(lambda now: now.at_rest(_SETTLE_S, 0.001, math.radians(0.05)), _REST_S)
    after_s = time.monotonic() - _SETTLE_S - due_s
    if not rests:
        return f"not at rest {after_s:.1f} s after {what}", True
    return f"at rest {max(after_s, 0.0):.1f} s after {what}", after_s > _REACTION_S
