"""The check-up of a robot over ROS before a session."""

import math
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from typing import Any

from vsnbench.errors import RobotError
from vsnbench.robots.checkup.checks import clock_results, frame_results, moment_results, rate_result, turn_result
from vsnbench.robots.checkup.commanded_turn import SteeredBase, motion_response_results
from vsnbench.robots.checkup.images import image_results, image_type, turned_results
from vsnbench.robots.checkup.odometry import (
    TfReadings,
    attitude_results,
    attitudes_in,
    frames_result,
    last_attitude,
    odometry_results,
)
from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.robots.ros.image_timing import rate_needed_hz
from vsnbench.ros.common.hazard_topics import WRONG_TYPE
from vsnbench.ros.common.interface import RosInterface
from vsnbench.ros.common.messages import planar
from vsnbench.ros.common.odometry import OdometryReader
from vsnbench.ros.common.topic_listener import TopicListener
from vsnbench.sensing.hazards import Hazard
from vsnbench.sensing.odometry.odometry import PlanarReading
from vsnbench.sensing.topic_monitor import TopicMessages
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Move
from vsnbench.values.pose import Attitude
from vsnbench.values.robot_profile import RobotProfile

LISTEN_S = 2.0
_LISTEN_ON_S = 3.0
"""Additional time for the first two messages of a sensor, which may be slow, or lost by a busy network."""
DOCTOR = "vsnbench_doctor"
"""Name of the node of a check-up."""
_TURN_DEG = 30
_DEFAULT_ADVICE = "check the log of discrete_move"


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

    @property
    def text(self) -> str:
        """The active sensors, or an empty string."""
        with self._lock:
            active = sorted(f"{hazard.value} ({where})" for (hazard, _), where in self._active.items())
        return ", ".join(active)

    def results(self) -> Iterator[CheckResult]:
        """Report the active sensors; nothing if there are none."""
        if active := self.text:
            advice = "free the robot, and put it flat on its wheels"
            yield CheckResult("hazards", Health.FAILED, f"the base reports: {active}", advice)


class TurnTest(SteeredBase):
    """Turns the robot on the spot."""

    @abstractmethod
    def turn(self, movement: Move) -> MotionResult | None:
        """Turn the robot; return what the mover answered and what the odometry turned, or None without odometry.

        Raises:
            RobotError: the mover does not answer.
        """

    @abstractmethod
    def newest_images(self) -> Mapping[str, Any]:
        """Return the newest images of `image_topics` that arrive from now on, without those that do not."""

    def further_results(self) -> Iterator[CheckResult]:
        """Perform the checks that follow successful turns: none by default."""
        return iter(())


class RosCheckup(ABC):
    """Checks every part of a robot; subclasses connect to a middleware.

    Attributes:
        topics: type of the messages by topic, of all topics that the robot should publish but those of hazard sensors.
        messages: received messages by topic.
        image_turns: number of clockwise quarter turns that set an image upright.
        closing: closes what `connect` opened.
    """

    names: RosInterface
    topics: dict[str, str]
    image_turns = 0

    def __init__(self, profile: RobotProfile) -> None:
        self.profile = profile
        self.hazards = ActiveHazards()
        self.transforms = TfReadings()
        self.messages: dict[str, TopicMessages] = {}
        self.closing = ExitStack()
        self._tf: OdometryReader[Any] | None = None

    def results(self, *, move: bool) -> Iterator[CheckResult]:
        """Perform all checks; end early without a connection.

        Args:
            move: whether the robot may turn on the spot to check its odometry.
        """
        with self.closing:
            if not (yield from self._connect()):
                return
            yield from self._command_results()
            yield from self._topic_results()
            readable = {
                topic: self.messages[topic] if self._has_type(topic, kind) else TopicMessages()
                for topic, kind in self.topics.items()
            }
            attitudes = self._attitudes(readable)
            yield from image_results(self.profile, readable, self._read, self.image_turns, last_attitude(attitudes))
            yield from frame_results(self.names, readable)
            yield from moment_results(self.names, readable)
            yield from self._odometry_results(readable)
            yield from attitude_results(attitudes)
            yield from self._hazard_results()
            yield from self._base_results(readable)
            yield from clock_results(self.names, self.messages, self._remote_nodes())
            yield from self._mover_results(move=move)
            if move:
                yield from self._motion_results()

    @abstractmethod
    def _connect(self) -> Generator[CheckResult, None, bool]:
        """Check the installation and the network and call `listen`. Returns whether the check-up can continue."""

    @abstractmethod
    def _command_results(self) -> Iterator[CheckResult]:
        """Check the subscribers of the velocities and other publishers."""

    @abstractmethod
    def _base_results(self, readable: dict[str, TopicMessages]) -> Iterator[CheckResult]:
        """Check the battery and other parts of the base."""

    @abstractmethod
    def _mover_results(self, *, move: bool) -> Iterator[CheckResult]:
        """Check what executes movements; `move` tells whether the turns follow."""

    @abstractmethod
    def _turn_test(self) -> AbstractContextManager[TurnTest]:
        """Return the test of turns.

        Raises:
            RobotError: the mover cannot be reached.
        """

    @abstractmethod
    def _publishers(self, topic: str) -> Sequence[str]:
        """Return the publishers of a topic."""

    @abstractmethod
    def _types_of(self, topic: str) -> frozenset[str]:
        """Return the types of the publishers of a topic; empty if no node publishes it."""

    @abstractmethod
    def _has_type(self, topic: str, kind: str) -> bool:
        """Return whether a topic has a message type."""

    @abstractmethod
    def _topic_fault(self, topic: str, kind: str, bad: Health) -> CheckResult | None:
        """Return the fault of a published topic, such as another type.

        Args:
            topic: name of the topic.
            kind: type of its messages in the profile.
            bad: health of a topic that cannot be used.
        """

    @abstractmethod
    def _described(self, topic: str, kind: str) -> str:
        """Return the description of a topic in its result."""

    @abstractmethod
    def _unpublished_advice(self, *, required: bool) -> str:
        """Return the advice for a topic without a publisher."""

    @abstractmethod
    def _silent_advice(self, topic: str) -> str:
        """Return the advice for a topic without messages."""

    @abstractmethod
    def _read(self, kind: str, data: bytes) -> Any:
        """Return a serialized message of a type such as `sensor_msgs/Image`."""

    @abstractmethod
    def _seconds(self, stamp: Any) -> float:
        """Return the stamp of a message in seconds."""

    @abstractmethod
    def _remote_nodes(self) -> frozenset[str]:
        """Return the nodes that may run on other machines."""

    def listen(self, listener: TopicListener) -> None:
        """Receive messages for LISTEN_S, and until two of each sensor are there, if it has a publisher.

        Raises:
            RobotError: the odometry is from TF, and the type of its messages is not installed.
        """
        if self.names.tf:
            self._tf = listener.follow_odometry(self.names, self.transforms.take)
        self.messages = listener.listen(LISTEN_S)
        published = [topic for topic in self._rates if topic in self.messages and self._publishers(topic)]
        until_s = time.monotonic() + _LISTEN_ON_S
        while time.monotonic() < until_s and any(len(self.messages[topic].arrivals) < 2 for topic in published):
            time.sleep(0.1)
        if self.names.tf:
            self.messages[self.names.odometry_topic] = self.transforms.messages

    @property
    def raw_topics(self) -> dict[str, str]:
        """The topics that `listen` receives as bytes: all but TF.

        No topic may be here that this process also subscribes to as messages: rospy gives all subscribers of a topic
        in a process what the first one asked for. This is why `topics` has no hazard sensors.
        """
        tf_topic = self.names.odometry_topic if self.names.tf else ""
        return {topic: kind for topic, kind in self.topics.items() if topic != tf_topic}

    @property
    def _rates(self) -> dict[str, float]:
        """The rates of the sensors' topics in the profile, Hz."""
        names = self.names
        rates = {names.odometry_topic: self.profile.base.odometry_rate_hz, names.color: names.camera_rate_hz}
        return rates | dict.fromkeys(filter(None, (names.depth, *names.further_images)), names.camera_rate_hz)

    def _topic_results(self) -> Iterator[CheckResult]:
        names, rates = self.names, self._rates
        for topic, kind in self.topics.items():
            bad, messages = Health.FAILED if topic in rates else Health.WARNING, self.messages[topic]
            if not self._publishers(topic):
                advice = self._unpublished_advice(required=topic in rates)
                yield CheckResult(topic, bad, "no node publishes it", advice)
            elif (fault := self._topic_fault(topic, kind, bad)) is not None:
                yield fault
            elif topic in rates and messages.arrivals:
                needed_hz = 0.0 if topic == names.odometry_topic else rate_needed_hz(names, topic)
                yield rate_result(topic, self._described(topic, kind), messages, rates[topic], needed_hz)
            elif messages.arrivals:
                yield CheckResult(topic, Health.OK, kind)
            else:
                seen = f"{self._described(topic, kind)}, silent for {LISTEN_S + _LISTEN_ON_S:g} s"
                yield CheckResult(topic, bad, seen, self._silent_advice(topic))

    def _hazard_results(self) -> Iterator[CheckResult]:
        """Check the topics of the hazard sensors, and report the active sensors."""
        for part in self.names.hazard_topics:
            fault = part.fault(self._types_of(part.topic))
            if fault is None:
                publishers = ", ".join(sorted(set(self._publishers(part.topic))))
                yield CheckResult(part.topic, Health.OK, f"{part.kind}, published by {publishers}")
            else:
                health = Health.FAILED if fault.code == WRONG_TYPE else Health.WARNING
                yield CheckResult(part.topic, health, fault.statement, fault.advice)
        yield from self.hazards.results()

    def _odometry_results(self, readable: dict[str, TopicMessages]) -> Iterator[CheckResult]:
        names, topic = self.names, self.names.odometry_topic
        if not self._has_type(topic, self.topics[topic]):
            return
        if names.tf and self._tf is not None:
            yield frames_result(names.tf, self._tf.fault, self.transforms.messages.senders)
            yield from odometry_results(self.profile, self.transforms.readings)
        else:
            messages = [self._read("nav_msgs/Odometry", data) for data in readable[topic].messages]
            readings = [PlanarReading(*planar(message), self._seconds(message.header.stamp)) for message in messages]
            yield from odometry_results(self.profile, readings)

    def _attitudes(self, readable: dict[str, TopicMessages]) -> list[Attitude | str]:
        """Return the attitudes of the base; nothing from TF, which is checked as odometry."""
        names, kind = self.names, "sensor_msgs/Imu" if self.names.imu else "nav_msgs/Odometry"
        if names.attitude is None or (names.tf and not names.imu):
            return []
        topic = names.attitude.topic
        heard = readable[topic].messages if self._has_type(topic, names.type_name(kind)) else []
        return attitudes_in(names, [self._read(kind, data) for data in heard], self._seconds)

    def _motion_results(self) -> Iterator[CheckResult]:
        """Measure the response to commands; turn to the left and back, and compare with odometry and images."""
        try:
            with self._turn_test() as test:
                if self.names.command:
                    yield from motion_response_results(test, self.profile)
                yield from _turn_results(test, self.profile, self.image_turns)
        except RobotError as error:
            yield CheckResult("turn", Health.FAILED, error.statement, error.advice)


def expected_topics(names: RosInterface, others: dict[str, str]) -> dict[str, str]:
    """Return the type of every topic that the robot should publish; `others` are the types of further topics."""
    kinds = {
        names.odometry_topic: names.odometry_type,
        names.color: image_type(names.color),
        names.depth: image_type(names.depth),
        names.color_info: "sensor_msgs/CameraInfo",
        names.depth_info: "sensor_msgs/CameraInfo",
        names.imu: "sensor_msgs/Imu",
        **{topic: image_type(topic) for topic in names.further_images},
        **dict.fromkeys(names.further_infos, "sensor_msgs/CameraInfo"),
        **others,
    }
    return {topic: names.type_name(kind) for topic, kind in kinds.items() if topic}


def _turn_results(test: TurnTest, profile: RobotProfile, image_turns: int) -> Iterator[CheckResult]:
    before = test.newest_images()
    for side, sign in (("Left", 1), ("Right", -1)):
        what, turn_rad = f"{side} {_TURN_DEG}°", sign * math.radians(_TURN_DEG)
        try:
            turn = test.turn(Move(turn_rad=turn_rad, holds_heading=True))
        except RobotError as error:
            yield CheckResult(what, Health.FAILED, error.statement, error.advice or _DEFAULT_ADVICE)
            return
        if turn is None:
            yield CheckResult(what, Health.FAILED, "no odometry", "start the driver of the base")
            return
        result = turn_result(what, turn_rad, turn.turn_rad, answered=turn.completed)
        yield replace(result, advice=turn.failure) if turn.failure and not turn.completed else result
        if result.health is Health.FAILED:
            return
        if sign > 0:
            yield from turned_results(profile, before, test.newest_images(), image_turns)
    yield from test.further_results()
