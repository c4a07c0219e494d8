"""Checks of rates, clocks, frames, battery and turns."""

import math
import struct
from collections.abc import Iterator

from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.robots.ros.further_cameras import MAX_APART_S
from vsnbench.robots.ros.image_timing import LOW_RATE, MAX_SKEW_S, rate_needed_hz
from vsnbench.ros.common.interface import RosInterface
from vsnbench.sensing.topic_monitor import TopicMessages
from vsnbench.values.battery import Battery
from vsnbench.values.camera import CameraRole

"""Rates below this share of the profile's are a warning."""
_SINGLE_HZ = 0.5
"""Highest rate of a topic with a single message in the two seconds of the check-up."""
_SKEW_S = 0.1
_MAX_FRAME_ID = 200
_MAX_TURN_ERROR_RAD = 0.08
"""Tolerance of upstream's server (4.6°)."""
_PAPER_TURN_ERROR_RAD = math.radians(0.5)
"""The 0.1° of the paper with the noise of the odometry; upstream's server, or a base that slips, exceeds it."""


def rate_result(
    topic: str, described: str, messages: TopicMessages, expected_hz: float, needed_hz: float = 0.0
) -> CheckResult:
    """Return whether the rate of a topic is that of the profile.

    Args:
        topic: name of the topic.
        described: type of its messages.
        messages: received messages, at least one.
        expected_hz: rate of the profile.
        needed_hz: rate at which every observation comes too late, or 0.
    """
    rate = f"{messages.rate_hz:.1f} Hz" if len(messages.arrivals) > 1 else "one message"
    seen = f"{described}, {rate}, {messages.age_s * 1000:.0f} ms old"
    if max(messages.rate_hz, _SINGLE_HZ) < needed_hz:
        seen = f"{seen}; the camera is too slow: an observation needs {needed_hz:.1f} Hz"
        advice = "raise the rate of the camera's driver, or lower interface.depth_frames of the profile"
        return CheckResult(topic, Health.FAILED, seen, advice)
    if messages.rate_hz < LOW_RATE * expected_hz:
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
    """Report clocks of the senders that differ from that of this machine, and messages that arrive late.

    A clock shifts the stamps of all topics of its machine by the same time. A message cannot arrive before it is sent:
    a negative age is a clock, or a wrong stamp. A topic that arrives later than others of the same machine is late.
    """
    topics = (names.odometry_topic, names.color, names.depth, names.color_info, names.depth_info)
    ages_s = {topic: messages[topic].offset_s for topic in topics if topic in messages and messages[topic].arrivals}
    if not ages_s:
        return
    machines = {topic: min(messages[topic].senders & remote, default="") for topic in ages_s}
    clocks_s = {topic: _clock_s(topic, ages_s, machines) for topic in ages_s}
    delays_s = {topic: ages_s[topic] - clocks_s[topic] for topic in ages_s}
    shifted = max(clocks_s, key=lambda topic: abs(clocks_s[topic]))
    late = max(delays_s, key=lambda topic: delays_s[topic])
    if abs(clocks_s[shifted]) > _SKEW_S:
        yield _clock_result(shifted, clocks_s[shifted], machines, names)
    elif delays_s[late] <= _SKEW_S:
        yield CheckResult("clocks", Health.OK, f"within {max(map(abs, ages_s.values())) * 1000:.0f} ms")
    images = [topic for topic in (names.color, names.depth) if topic in ages_s]
    odometry_s = clocks_s.get(names.odometry_topic, 0.0)
    too_late = [topic for topic in images if _is_too_late(names, topic, messages[topic], ages_s[topic] - odometry_s)]
    if delays_s[late] > _SKEW_S or too_late:
        worst = too_late[0] if too_late else late
        yield _delay_result(worst, ages_s, machines[worst], Health.FAILED if too_late else Health.WARNING)
    ahead_s = max((odometry_s - clocks_s[topic] for topic in images), default=0.0)
    if ahead_s > _SKEW_S:
        yield CheckResult(
            "stamps",
            Health.FAILED,
            f"stamps of odometry and camera differ by {ahead_s:.2f} s: the images are ahead",
            "stamp both on one machine, because images from before a motion cannot be detected otherwise",
        )
    yield from _pair_results(names, messages)


def _clock_s(topic: str, ages_s: dict[str, float], machines: dict[str, str]) -> float:
    """Return how far the clock of a topic's stamps is behind that of this machine: the least age of its machine."""
    if ages_s[topic] < -_SKEW_S:
        return ages_s[topic]
    if not machines[topic]:
        return min(ages_s[topic], 0.0)
    return min(age_s for other, age_s in ages_s.items() if machines[other] == machines[topic] and age_s >= -_SKEW_S)


def _clock_result(topic: str, clock_s: float, machines: dict[str, str], names: RosInterface) -> CheckResult:
    """Return the result of a clock, or of stamps, that differ from this machine's clock."""
    if not machines[topic]:
        seen = f"{topic} is stamped {-clock_s:.2f} s ahead of the clock of this machine"
        return CheckResult("clocks", Health.WARNING, seen, "its driver sets wrong stamps: check its settings")
    same = [other for other, machine in machines.items() if machine == machines[topic]]
    advice = "synchronize the machines' clocks (chrony or ntpd)"
    if clock_s > 0 and names.odometry_topic in machines and len({other == names.odometry_topic for other in same}) == 1:
        # Without another part of the same machine, a slow driver looks like a clock.
        seen = f"all of {', '.join(same)} arrive {clock_s:.2f} s after their stamps: late, or by a clock that is behind"
        return CheckResult("clocks", Health.WARNING, seen, f"{advice}, and check the driver")
    seen = f"the clock of the sender of {topic} is {abs(clock_s):.2f} s {'behind' if clock_s > 0 else 'ahead'}"
    return CheckResult("clocks", Health.WARNING, seen, advice)


def _is_too_late(names: RosInterface, topic: str, messages: TopicMessages, delay_s: float) -> bool:
    """Whether every observation waits in vain for images that arrive so late, by the clock of the odometry."""
    rate_hz = max(messages.rate_hz, _SINGLE_HZ)
    return delay_s > _SKEW_S and rate_needed_hz(names, topic) <= rate_hz < rate_needed_hz(names, topic, delay_s)


def _delay_result(topic: str, ages_s: dict[str, float], machine: str, health: Health) -> CheckResult:
    """Return the result of a topic that arrives late."""
    others = {other: age_s for other, age_s in ages_s.items() if age_s <= ages_s[topic] - _SKEW_S}
    seen = f"{topic} arrives {ages_s[topic]:.2f} s after its stamps"
    if others:
        first = min(others, key=lambda other: others[other])
        seen += f", {first} {others[first]:.2f} s after its own"
    advice = "lower the size or rate of the images, or use compressed topics"
    if health is Health.FAILED:
        seen += ": too late for every observation"
    if not machine:
        seen, advice = f"{seen}, on one machine", "this machine or the driver is busy: end other programs"
    return CheckResult("delay", health, seen, advice)


def _pair_results(names: RosInterface, messages: dict[str, TopicMessages]) -> Iterator[CheckResult]:
    """Report colour and depth whose stamps are never close enough for one observation."""
    if not names.depth or not all(messages[topic].stamps for topic in (names.color, names.depth)):
        return
    colors, depths = messages[names.color].stamps, messages[names.depth].stamps
    apart_s = min(abs(color_s - depth_s) for color_s in colors for depth_s in depths)
    if apart_s > MAX_SKEW_S:
        seen = f"stamps of colour and depth differ by at least {apart_s:.2f} s"
        yield CheckResult(
            "image pairs", Health.FAILED, seen, "synchronize colour and depth in the driver of the camera"
        )


def moment_results(names: RosInterface, messages: dict[str, TopicMessages]) -> Iterator[CheckResult]:
    """Report how many images of the front camera have one of each further camera of the same moment."""
    front = messages[names.color]
    if not front.stamps:
        return
    for role, topics in names.cameras.items():
        for what, topic in ((f"{role} pairs", topics.color), (f"{role} depth pairs", topics.depth)):
            if not topic or not (stamps := messages[topic].stamps):
                continue
            first_s, last_s = min(stamps) - MAX_APART_S, max(stamps) + MAX_APART_S
            together = [at for at in front.stamps if first_s <= at <= last_s] or front.stamps
            apart_s = [min(abs(at - other) for other in stamps) for at in together]
            paired = sum(seconds <= MAX_APART_S for seconds in apart_s)
            seen = f"{paired} of {len(apart_s)} images of the front camera have one within {1000 * MAX_APART_S:.0f} ms"
            if paired == len(apart_s):
                yield CheckResult(what, Health.OK, seen)
                continue
            seen += f"; the front camera has {front.rate_hz:.1f} Hz, this one {messages[topic].rate_hz:.1f} Hz"
            advice = "let the cameras take their images together, or at least as often as the front camera"
            yield CheckResult(what, Health.WARNING if paired else Health.FAILED, seen, advice)


def frame_results(names: RosInterface, messages: dict[str, TopicMessages]) -> Iterator[CheckResult]:
    """Warn if colour and depth of a camera are in different frames: such depth belongs to other pixels."""
    for role, topics in names.camera_topics.items():
        color, depth = (
            frame_id(messages[topic].messages[-1]) if topic in messages and messages[topic].messages else ""
            for topic in (topics.color, topics.depth)
        )
        if color and depth and color != depth:
            yield CheckResult(
                "camera frames" if role is CameraRole.FRONT else f"{role} camera frames",
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
