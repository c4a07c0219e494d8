"""Whether images arrive in time for an observation: rate, delay and clock of a camera."""

import logging
import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from vsnbench.errors import RobotError, SensorLostError
from vsnbench.ros.common.interface import RosInterface
from vsnbench.sensing.images.camera_images import Stamped
from vsnbench.sensing.robot_reports import RobotSnapshot

logger = logging.getLogger(__name__)

MAX_SKEW_S = 0.1
"""Largest difference of the stamps of colour and depth in one observation."""
MAX_AHEAD_S = 2.0
"""Images that are stamped farther ahead of the odometry have a wrong stamp."""
MAX_OFFSET_S = 0.5
"""Images of a robot that drives on arrive within this time of their stamps, by the clock of the odometry: as old as the
guard accepts one before a movement forward begins."""
_TIMEOUT_S = 3.0
_SILENT_S = 1.0
"""Time without an image after which a camera is silent, or three of its periods if it is slow."""
_LOST_S = 0.7
"""A robot that sends neither odometry nor images for this long is silent as a whole; less than a base's time-out."""
_LONGEST_DELAY_S = 10.0
"""Images that are older on arrival have a wrong stamp, because no driver or network queues images for this long."""


LOW_RATE = 0.8
"""A topic with less than this share of its rate in the profile is slow."""
_WINDOW_S, _SHORTEST_S = 10.0, 2.0
"""Time over which a session measures rates, and the shortest one that shows them."""


class _Tally(NamedTuple):
    at_s: float
    received: Mapping[str, int]


class RateWatch:
    """Measures the rates of camera and odometry during a session, and warns when one falls below the profile's.

    Args:
        names: interface of the profile.
        odometry_rate_hz: rate of the odometry in the profile.
    """

    def __init__(self, names: RosInterface, odometry_rate_hz: float) -> None:
        self._topics = {
            "readings": ("odometry_hz", names.odometry_topic, odometry_rate_hz),
            "colors": ("color_hz", names.color, names.camera_rate_hz),
        }
        if names.depth:
            self._topics["depths"] = ("depth_hz", names.depth, names.camera_rate_hz)
        self._marks: deque[_Tally] = deque()
        self._slow: set[str] = set()

    def look(self, now: RobotSnapshot, now_s: float) -> dict[str, float]:
        """Return the rates over the last 10 s (Hz) as numbers for the record; none in the first two seconds.

        Warns once of each topic that has become slow.

        Args:
            now: the newest reports.
            now_s: the time, monotonic.
        """
        self._marks.append(_Tally(now_s, now.received))
        while len(self._marks) > 2 and now_s - self._marks[1].at_s >= _WINDOW_S:
            self._marks.popleft()
        first = self._marks[0]
        if (passed_s := now_s - first.at_s) < _SHORTEST_S:
            return {}
        rates = {}
        for field, (name, topic, expected_hz) in self._topics.items():
            rate_hz = rates[name] = (now.received.get(field, 0) - first.received.get(field, 0)) / passed_s
            if rate_hz >= LOW_RATE * expected_hz:
                self._slow.discard(topic)
            elif topic not in self._slow:
                self._slow.add(topic)
                logger.warning(
                    "%s had %.1f Hz in the last %.0f s, the profile has %g Hz: check the load of the network and of "
                    "the machines at its ends (vsnbench doctor)",
                    *(topic, rate_hz, passed_s, expected_hz),
                )
        return rates


def frames_needed(names: RosInterface, topic: str) -> int:
    """Return how many images of a topic an observation needs after a motion."""
    return names.depth_frames if topic == names.depth else 1


def observation_timeout_s(names: RosInterface) -> float:
    """Return how long an observation waits for its images."""
    return _TIMEOUT_S + (names.depth_frames if names.depth else 0) / names.camera_rate_hz


def rate_needed_hz(names: RosInterface, topic: str, delay_s: float = 0.0) -> float:
    """Return the lowest rate at which an observation gets its images of a topic in time; infinite if no rate does.

    Args:
        names: interface of the profile.
        topic: topic of colour or depth.
        delay_s: time from the stamp of an image to its arrival.
    """
    left_s = observation_timeout_s(names) - max(delay_s, 0.0)
    return frames_needed(names, topic) / left_s if left_s > 0 else math.inf


def odometry_time_s(now: RobotSnapshot, arrival_s: float) -> float:
    """Return the time on the clock of the odometry at an arrival; infinite before the first odometry."""
    if now.latest is None:
        return math.inf
    return now.latest.stamp_s + arrival_s - now.latest.arrival_s


def not_ahead(images: Sequence[Stamped[Any]], now: RobotSnapshot) -> list[Stamped[Any]]:
    """Drop images stamped ahead of the odometry, which would count as taken after every motion."""
    return [image for image in images if image.stamp_s <= odometry_time_s(now, image.arrival_s) + MAX_AHEAD_S]


def unfit_while_driving(names: RosInterface, now: RobotSnapshot) -> RobotError | None:
    """Return why the pose of the robot at the capture of its images is not known while it drives; None if it is.

    Stamps have to be on the clock of the odometry. At rest, an offset does no harm.
    """
    for topic, images in _received(names, now).items():
        if not images:
            continue
        if images[-1].stamp_s <= 0:
            return RobotError(
                f"--continuous: images on {topic} have no stamp, so the pose of the robot at their capture is unknown",
                advice="have the camera driver stamp its images, or leave --continuous out",
                code="no-stamps",
            )
        delay_s = min(odometry_time_s(now, image.arrival_s) - image.stamp_s for image in images)
        if abs(delay_s) > MAX_OFFSET_S:
            side = "ahead of" if delay_s < 0 else "behind"
            return RobotError(
                f"--continuous: images on {topic} are stamped {abs(delay_s):.1f} s {side} the odometry, so the pose "
                "of the robot at their capture is unknown",
                advice="synchronize the clocks (vsnbench doctor), or leave --continuous out",
                code="clocks-apart",
            )
    return None


def missing_images(names: RosInterface, now: RobotSnapshot, now_s: float) -> SensorLostError:
    """Return why an observation did not get its images.

    Args:
        names: interface of the profile.
        now: the newest reports.
        now_s: the time, monotonic.
    """
    received, waited_s = _received(names, now), observation_timeout_s(names)
    for topic in received:
        if rivals := now.rivals(topic, now_s):
            return rivals
    if silent := silent_camera(names, now, now_s):
        return silent
    for topic, images in received.items():
        if fault := _timing_fault(names, topic, images, now, now_s):
            return fault
    return SensorLostError(
        f"no images on {' and '.join(received)} within {waited_s:.1f} s that are stamped after the motion, colour "
        f"within {MAX_SKEW_S:g} s of depth",
        advice="stamp colour and depth in one driver (vsnbench doctor)",
        code="no-matching-images",
    )


def silent_camera(names: RosInterface, now: RobotSnapshot, now_s: float) -> SensorLostError | None:
    """Return that no image arrives on a topic any more, or None; see `missing_images`."""
    received, waited_s = _received(names, now), observation_timeout_s(names)
    silent = [topic for topic, images in received.items() if _is_silent(images, now_s)]
    if not silent:
        return None
    if lost := silent_robot(names, now, now_s):
        return lost
    since_s = min(now_s - received[topic][-1].arrival_s if received[topic] else waited_s for topic in silent)
    return SensorLostError(
        f"no image on {' and '.join(silent)} for {since_s:.0f} s", advice="check the camera driver", code="no-image"
    )


def silent_robot(names: RosInterface, now: RobotSnapshot, now_s: float) -> SensorLostError | None:
    """Return that neither odometry nor images arrive any more, or None: the network is cut, or the robot is off."""
    received = _received(names, now)
    arrivals_s = [images[-1].arrival_s for images in received.values() if images]
    if now.latest is not None:
        arrivals_s.append(now.latest.arrival_s)
    silent_s = now_s - max(arrivals_s, default=now_s)
    if silent_s < _LOST_S:
        return None
    return SensorLostError(
        f"the robot is silent: nothing on {', '.join((names.odometry_topic, *received))} for {silent_s:.1f} s",
        advice="check that it is on, the network to it, and the load of this machine",
        code="silent-robot",
    )


def _received(names: RosInterface, now: RobotSnapshot) -> dict[str, tuple[Stamped[Any], ...]]:
    """Return the images by topic."""
    return {topic: images for topic, images in ((names.color, now.colors), (names.depth, now.depths)) if topic}


def _rate_hz(images: Sequence[Stamped[Any]]) -> float:
    """Return the rate of images; infinite if it is unknown."""
    if len(images) < 2 or images[-1].arrival_s <= images[0].arrival_s:
        return math.inf
    return (len(images) - 1) / (images[-1].arrival_s - images[0].arrival_s)


def _is_silent(images: Sequence[Stamped[Any]], now_s: float) -> bool:
    return not images or now_s - images[-1].arrival_s > max(_SILENT_S, 3 / _rate_hz(images))


def _timing_fault(
    names: RosInterface, topic: str, images: Sequence[Stamped[Any]], now: RobotSnapshot, now_s: float
) -> SensorLostError | None:
    """Return whether the stamps are of another clock, the images late, or the camera slow."""
    count, waited_s = frames_needed(names, topic), observation_timeout_s(names)
    recent = [image for image in images if now_s - image.arrival_s <= waited_s]
    rate_hz = _rate_hz(recent)
    if len(recent) < len(images):  # no recent one was dropped: their number limits the rate, too
        rate_hz = min(rate_hz, (len(recent) + 1) / waited_s)
    delay_s = min(odometry_time_s(now, image.arrival_s) - image.stamp_s for image in images)
    if not not_ahead(images[-1:], now) or _LONGEST_DELAY_S < delay_s < math.inf:
        side, code = ("ahead of", "images-ahead") if delay_s < 0 else ("behind", "no-matching-images")
        return SensorLostError(
            f"images on {topic} are stamped {abs(delay_s):.1f} s {side} the odometry",
            advice="synchronize the clocks (vsnbench doctor)",
            code=code,
        )
    if rate_hz < (needed_hz := rate_needed_hz(names, topic)):
        return SensorLostError(
            f"the camera is too slow: {topic} has {rate_hz:.1f} Hz, and {count} images within {waited_s:.1f} s after a "
            f"motion need {needed_hz:.1f} Hz",
            advice="raise the rate of the camera's driver, or lower interface.depth_frames of the profile",
            code="slow-camera",
        )
    if MAX_SKEW_S < delay_s < math.inf and rate_hz < rate_needed_hz(names, topic, delay_s):
        return SensorLostError(
            f"images arrive late: {topic} {delay_s:.1f} s after its stamps, by the clock of the odometry; {count} "
            f"images at {rate_hz:.1f} Hz must arrive within {waited_s:.1f} s after a motion",
            advice="lower the size or rate of the images, or use compressed topics (vsnbench doctor)",
            code="late-images",
        )
    return None
