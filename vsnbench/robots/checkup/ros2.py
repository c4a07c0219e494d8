"""The check-up of a robot over ROS 2."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from vsnbench.control.command import Command
from vsnbench.errors import RobotError
from vsnbench.robots.checkup.adapters.service import service_results
from vsnbench.robots.checkup.base import DOCTOR, RosCheckup, TurnTest, expected_topics
from vsnbench.robots.checkup.checks import battery_result
from vsnbench.robots.checkup.commanded_turn import turn_timeout_s
from vsnbench.robots.checkup.images import image_topics
from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.robots.ros.link import connect
from vsnbench.robots.ros.start import Patience, wait_until_ready
from vsnbench.robots.ros.watchdog import (
    WatchdogMeasurement,
    measure_watchdog,
    store_measurement,
    stored_measurement,
    watchdog_advice,
)
from vsnbench.ros.common.robot_link import RobotLink
from vsnbench.ros.ros2.docking import Dock, subscribe_dock
from vsnbench.ros.ros2.graph import bases_of, command_fault, hash_fault, incompatibility, type_fault
from vsnbench.ros.ros2.installation import discovery, require_ros2
from vsnbench.ros.ros2.interface import VELOCITIES, Ros2Interface, ros2_interface
from vsnbench.ros.ros2.readiness import card_of_mover
from vsnbench.ros.ros2.topic_service import TopicServiceClient
from vsnbench.sensing.odometry.odometry import OdometryReading
from vsnbench.sensing.robot_reports import RobotSnapshot
from vsnbench.sensing.simulation import ACCOUNT
from vsnbench.sensing.topic_monitor import TopicMessages
from vsnbench.values.battery import Battery
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Move
from vsnbench.values.robot_profile import RobotProfile

if TYPE_CHECKING:
    from vsnbench.ros.ros2.subscriptions import Ros2Listener

_IMAGES_S = 2.0
"""Time for images before and after a turn."""


class Ros2Checkup(RosCheckup):
    """Checks every part of a robot over ROS 2."""

    names: Ros2Interface
    listener: Ros2Listener

    def __init__(self, profile: RobotProfile) -> None:
        super().__init__(profile)
        self.names = ros2_interface(profile)
        self.image_turns = self.names.image_turns
        self.topics = expected_topics(self.names, {self.names.battery: "sensor_msgs/BatteryState"})
        self.dock = Dock(profile, self.names)
        self._others: list[str] = []

    def _connect(self) -> Generator[CheckResult, None, bool]:
        try:
            require_ros2()
        except RobotError as error:
            yield CheckResult("ROS 2", Health.FAILED, error.statement, error.advice)
            return False
        distribution = os.environ.get("ROS_DISTRO", "")
        yield CheckResult("ROS 2", Health.OK, f"installed{f', {distribution}' if distribution else ''}")
        from vsnbench.ros.ros2.subscriptions import Ros2Listener

        try:
            self.listener = Ros2Listener(DOCTOR, self.names.root, self.raw_topics)
            self.closing.callback(self.listener.close)
        except RobotError as error:
            yield CheckResult("node", Health.FAILED, error.statement, error.advice)
            return False
        try:
            self._receive()
        except RobotError as error:
            yield CheckResult("topics", Health.FAILED, error.statement, error.advice)
            return False
        self._others = sorted(set(self.listener.graph.nodes()) - {self.listener.node.full_name})
        yield graph_result(self._others)
        return bool(self._others or any(self._publishers(topic) for topic in self.topics))

    def _receive(self) -> None:
        from vsnbench.ros.ros2.hazard_events import subscribe_hazards

        subscribe_dock(self.listener.node, self.names, self.dock)
        subscribe_hazards(self.listener.node, self.names, self.hazards.take)
        self.listen(self.listener)

    def _command_results(self) -> Iterator[CheckResult]:
        names, graph = self.names, self.listener.graph
        if not names.command:
            return
        subscribers = graph.subscribers(names.command)
        bases = bases_of(subscribers)
        fault = command_fault(names.command, names.command_type, subscribers, VELOCITIES)
        fault = fault or incompatibility(self.listener.node.velocity_quality, bases)
        if fault is not None:
            yield CheckResult(names.command, Health.FAILED, fault.statement, fault.advice)
            return
        described = ", ".join(f"{base.node} ({base.qos_text})" for base in bases)
        yield CheckResult(names.command, Health.OK, f"{bases[0].type_name}, subscribed by {described}")
        rivals = sorted({publisher.node for publisher in graph.publishers(names.command) if not publisher.is_own})
        if rivals:
            advice = "end that node, unless it only relays commands"
            yield CheckResult(names.command, Health.WARNING, f"{', '.join(rivals)} can also steer the base", advice)

    def _battery_results(self, readable: dict[str, TopicMessages]) -> Iterator[CheckResult]:
        names, dock = self.names, self.dock
        if not names.battery or not readable[names.battery].messages:
            return
        state = self._read("sensor_msgs/BatteryState", readable[names.battery].messages[-1])
        battery = Battery.reported(state.percentage, state.voltage)
        if dock.is_charging and dock.is_docked is None:
            advice = f"a docked base does not turn: {dock.advice}"
            charge = f"{battery.text}, charging" if battery else "charging"
            yield CheckResult("battery", Health.WARNING, f"{charge}: the robot may be on its dock", advice)
        elif battery is not None:
            yield battery_result(battery)

    def _base_results(self, readable: dict[str, TopicMessages]) -> Iterator[CheckResult]:
        dock = self.dock
        yield from self._battery_results(readable)
        if dock.fault is not None:
            yield CheckResult("dock", Health.FAILED, dock.fault.statement, dock.advice)
        elif dock.is_docked is not None:
            yield CheckResult("dock", Health.OK, "the robot is off its dock")

    def _mover_results(self, *, move: bool) -> Iterator[CheckResult]:
        name, graph = self.names.discrete_move, self.listener.graph
        start = f"vsnbench robots serve {self.profile.argument}"
        if graph.subscribers(f"{name}/question"):
            yield self._server_result(name, f"restart it: {start}" if self.names.command else "restart the adapter")
            return
        if not self.names.command:
            seen = "no motion adapter serves it, and the profile names no topic for velocities"
            yield CheckResult(name, Health.FAILED, seen, "start the adapter in this domain, or name interface.command")
            return
        seen = "does not run on the robot: vsnbench run steers it over the network"
        yield CheckResult(name, Health.OK, seen, f"on a poor network, run on the robot: {start}")
        if not move:
            simulated = bool(graph.publishers(self.names.simulation_topic(ACCOUNT)))
            yield stored_watchdog_result(self.profile, simulated=simulated)

    def _server_result(self, name: str, advice: str) -> CheckResult:
        try:
            card = card_of_mover(TopicServiceClient(self.listener.node, name), 2.0)
        except RobotError as error:
            return CheckResult(name, Health.FAILED, error.statement, advice)
        if card is not None:
            seen = f"the motion adapter {card} answers; it executes {', '.join(sorted(card.movements))}"
            return CheckResult(name, Health.OK, seen)
        return CheckResult(name, Health.OK, "runs on the robot, and answers")

    @contextmanager
    def _turn_test(self) -> Iterator[TurnTest]:
        self.listener.close()
        link = connect(self.profile)
        try:
            wait_until_ready(link, Patience(10.0))
            yield _TurnTest(link, self.profile)
        finally:
            link.stand_still()
            link.close()

    def _publishers(self, topic: str) -> Sequence[str]:
        return [publisher.node for publisher in self.listener.graph.publishers(topic)]

    def _types_of(self, topic: str) -> frozenset[str]:
        return frozenset(publisher.type_name for publisher in self.listener.graph.publishers(topic))

    def _has_type(self, topic: str, kind: str) -> bool:
        return type_fault(topic, kind, self.listener.graph.publishers(topic)) is None

    def _topic_fault(self, topic: str, kind: str, bad: Health) -> CheckResult | None:
        graph = self.listener.graph
        publishers = graph.publishers(topic)
        # Without a sender per message (Jazzy): nodes that were killed stay in the graph for some seconds.
        senders = self.messages[topic].senders or {publisher.node for publisher in publishers}
        ours = next((node.type_hash for node in graph.subscribers(topic) if node.is_own), "")
        if (fault := type_fault(topic, kind, publishers)) is not None:
            return CheckResult(topic, bad, fault.statement, fault.advice)
        if len(senders) > 1:
            robot = self.profile.given_in("NAMESPACE")
            advice = f"end one of them, or set the robot's namespace (--robot {robot})"
            return CheckResult(topic, Health.FAILED, f"{' and '.join(sorted(senders))} both publish it", advice)
        if other := hash_fault(topic, ours, publishers):
            advice = "install the distribution of the robot: messages of others may not be readable"
            return CheckResult(topic, Health.WARNING, other, advice)
        return None

    def _described(self, topic: str, kind: str) -> str:
        return f"{kind} ({self.listener.graph.publishers(topic)[0].qos_text})"

    def _unpublished_advice(self, *, required: bool) -> str:  # noqa: ARG002
        return f"start its driver in {discovery()}, or correct the topic in the profile"

    def _silent_advice(self, topic: str) -> str:
        node = self._publishers(topic)[0]
        return f"check that {node} is alive; a slow network loses large images (docs/robot.md)"

    def _read(self, kind: str, data: bytes) -> Any:
        from vsnbench.ros.ros2.subscriptions import message_of

        return message_of(kind, data)

    def _seconds(self, stamp: Any) -> float:
        from vsnbench.ros.ros2.messages import seconds

        return seconds(stamp)

    def _remote_nodes(self) -> frozenset[str]:
        return frozenset(self._others)


class _TurnTest(TurnTest):
    """Turns the robot as a session does."""

    def __init__(self, link: RobotLink, profile: RobotProfile) -> None:
        self._link = link
        self._profile = profile

    @property
    def now_s(self) -> float:
        """Time on the monotonic clock."""
        return time.monotonic()

    def steer(self, command: Command) -> None:
        """Command a velocity."""
        self._link.command(command)

    def latest(self) -> Sequence[OdometryReading]:
        """Return the newest readings of the odometry, oldest first."""
        return self._link.snapshot().readings

    def hazard(self) -> str:
        """Return the active hazard sensors, or an empty string."""
        return ", ".join(sorted({hazard.value for hazard, _ in self._link.snapshot().active_hazards}))

    def turn(self, movement: Move) -> MotionResult | None:
        """Turn the robot; see `TurnTest.turn`.

        Raises:
            RobotError: the mover does not answer.
        """
        link = self._link
        before = link.snapshot().latest
        answered = link.drive(movement, turn_timeout_s(movement, self._profile))
        link.wait_for(lambda now: now.at_rest(0.3, 0.001, math.radians(0.05)), 2.0)
        now = link.snapshot()
        reason = now.outcome.failure if now.outcome is not None else ""
        if before is None or now.latest is None:
            return None
        return MotionResult(answered, turn_rad=now.latest.pose.heading_rad - before.pose.heading_rad, failure=reason)

    def newest_images(self) -> Mapping[str, Any]:
        """Return the newest images of `image_topics` that arrive from now on, without those that do not."""
        began_s, topics = time.monotonic(), image_topics(self._link.names)

        def arrived(now: RobotSnapshot) -> dict[str, Any]:
            newest = {what: now.further.get(topic, ()) for what, topic in topics.items()}
            newest |= {"colour": now.colors, "depth": now.depths}
            return {what: images[-1] for what, images in newest.items() if images and images[-1].arrival_s > began_s}

        self._link.wait_for(lambda now: len(arrived(now)) == len(topics), _IMAGES_S)
        return {what: self._link.image(image.payload) for what, image in arrived(self._link.snapshot()).items()}

    def further_results(self) -> Iterator[CheckResult]:
        """Measure and store the watchdog of a base that this process steers, or check its motion adapter."""
        if self._link.adapter:
            yield from service_results(self._link, self._profile)
        if self._link.steer is not None:
            measured = measure_watchdog(self._link, self._profile)
            store_measurement(measured, self._profile, simulated=self._link.snapshot().simulation is not None)
            yield watchdog_result(measured, self._profile)


def watchdog_result(measurement: WatchdogMeasurement, profile: RobotProfile) -> CheckResult:
    """Return whether a measurement passed."""
    if measurement.passed:
        return CheckResult("watchdog", Health.OK, measurement.seen)
    return CheckResult("watchdog", Health.FAILED, measurement.seen, watchdog_advice(profile))


def stored_watchdog_result(profile: RobotProfile, *, simulated: bool) -> CheckResult:
    """Return whether the stored measurement of a base passed."""
    measurement = stored_measurement(profile, simulated=simulated)
    if measurement is None:
        seen = "not measured on this machine: vsnbench run will not steer the base"
        return CheckResult("watchdog", Health.WARNING, seen, f"vsnbench doctor --robot {profile.argument} --move")
    result = watchdog_result(measurement, profile)
    seen = f"{result.seen} ({measurement.measured_at:%Y-%m-%d})"
    return CheckResult(result.what, result.health, seen, result.advice)


def graph_result(others: list[str]) -> CheckResult:
    """Return whether there are other nodes on the graph."""
    if not others:
        advice = (
            "set ROS_DOMAIN_ID to that of the robot, and ROS_AUTOMATIC_DISCOVERY_RANGE to SUBNET for a remote robot"
        )
        return CheckResult("graph", Health.FAILED, f"{discovery()}: no other nodes", advice)
    return CheckResult("graph", Health.OK, f"{discovery()}: {len(others)} other nodes")
