"""Checks of rates, clocks, frames, battery and turns."""

import math
import struct
from collections.abc import Iterator

from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.ros_common.interface import RosInterface
from vsnbench.sensing.topic_monitor import TopicMessages
from vsnbench.values.battery import Battery

_LOW_RATE = 0.8
"""Rates below this share of the profile's are a warning."""
_SKEW_S = 0.1
_MAX_FRAME_ID = 200
_MAX_TURN_ERROR_RAD = 0.08
"""Tolerance of upstream's server (4.6°)."""
_PAPER_TURN_ERROR_RAD = math.radians(0.5)
"""The 0.1° of the paper with the noise of the odometry; upstream's server, or a base that slips, exceeds it."""


def rate_result(topic: str, described: str, messages: TopicMessages, expected_hz: float) -> CheckResult:
    """Return whether the rate of a topic is that of the profile."""
    seen = f"{described}, {messages.rate_hz:.1f} Hz, {messages.age_s * 1000:.0f} ms old"
    if messages.rate_hz < _LOW_RATE * expected_hz:
        seen = f"{seen}; the profile has {expected_hz:g} Hz"
        return CheckResult(topic, Health.WARNING, seen, "check the load of the network and of this machine")
    return CheckResult(topic, Health.OK, seen)


def battery_result(battery: Battery) -> CheckResult:
    """Return whether the battery has enough charge."""
    if battery.is_low:
        return CheckResult("battery", Health.WARNING, battery.text, "charge it before a session")
    return CheckResult("battery", Health.OK, battery.text)


def clock_results(
    names: RosInterface, messages: dict[str, TopicMessages], remote: frozenset[str]
) -> Iterator[CheckResult]:
    """Report the difference between the clocks of the senders and that of this machine."""
    offsets = {
        topic: messages[topic].offset_s
        for topic in (names.odometry_topic, names.color, names.depth)
        if topic and messages[topic].arrivals
    }
    if not offsets:
        return
    worst = max(offsets, key=lambda topic: abs(offsets[topic]))
    offset_s = offsets[worst]
    if abs(offset_s) <= _SKEW_S:
        yield CheckResult("clocks", Health.OK, f"within {abs(offset_s) * 1000:.0f} ms")
    elif messages[worst].senders & remote:
        seen = f"the clock of the sender of {worst} is {abs(offset_s):.2f} s {'behind' if offset_s > 0 else 'ahead'}"
        yield CheckResult("clocks", Health.WARNING, seen, "synchronize the machines' clocks (chrony or ntpd)")
    elif offset_s > 0:
        seen = f"{worst} arrives {offset_s:.2f} s after its stamps, on one machine"
        yield CheckResult("delay", Health.WARNING, seen, "this machine is busy: end other programs")
    else:
        seen = f"{worst} is stamped {-offset_s:.2f} s ahead of the clock of this machine"
        yield CheckResult("clocks", Health.WARNING, seen, "its driver sets wrong stamps: check its settings")
    between_s = max(offsets.values()) - min(offsets.values())
    if between_s > _SKEW_S:
        yield CheckResult(
            "stamps",
            Health.FAILED,
            f"stamps of odometry and camera differ by {between_s:.2f} s",
            "stamp both on one machine, because images from before a motion cannot be detected otherwise",
        )


def frame_results(names: RosInterface, messages: dict[str, TopicMessages]) -> Iterator[CheckResult]:
    """Warn if colour and depth are in different frames: such depth belongs to other pixels."""
    frames = {
        topic: frame_id(messages[topic].messages[-1])
        for topic in (names.color, names.depth)
        if topic and topic in messages and messages[topic].messages
    }
    color, depth = frames.get(names.color, ""), frames.get(names.depth, "")
    if color and depth and color != depth:
        yield CheckResult(
            "camera frames",
            Health.WARNING,
            f"colour is in frame {color}, depth in {depth}",
            "align the depth to the colour image in the driver of the camera (registration)",
        )


def frame_id(message: bytes) -> str:
    """Return the frame in the header of a serialized message of ROS 1 or ROS 2, or an empty string.

    Both have the length of the text at byte 12: after a counter and the stamp, or after the CDR header and the stamp.
    """
    if len(message) < 16:
        return ""
    (length,) = struct.unpack_from("<I", message, 12)
    if length > _MAX_FRAME_ID:
        return ""
    return message[16 : 16 + length].rstrip(b"\0").decode("ascii", "replace").lstrip("/")


def turn_result(what: str, requested_rad: float, turned_rad: float, *, answered: bool) -> CheckResult:
    """Return how well the odometry followed a turn."""
    seen = f"answered {bool(answered)}; the odometry turned {math.degrees(turned_rad):+.1f}°"
    error_rad = abs(turned_rad - requested_rad)
    if not answered or error_rad > _MAX_TURN_ERROR_RAD:
        advice = "check that the wheels turn, that this is the right robot, and the log of discrete_move"
        return CheckResult(what, Health.FAILED, seen, advice)
    if error_rad > _PAPER_TURN_ERROR_RAD:
        advice = "upstream's server is less accurate than the paper's 0.1°: use vsnbench robots serve"
        return CheckResult(what, Health.WARNING, seen, advice)
    return CheckResult(what, Health.OK, seen)
