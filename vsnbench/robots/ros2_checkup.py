"""The check-up of a ROS 2 robot before a session: every part looked at for real, each with a line of its own."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from vsnbench.errors import RobotError
from vsnbench.protocol.battery import Battery
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.robots.check_result import CheckResult, Health
from vsnbench.robots.image_checkup import image_results
from vsnbench.robots.interface_kinds import connect
from vsnbench.robots.ros1_checkup import battery_result, clock_results, judge_turn, rate_result
from vsnbench.robots.ros_start import Patience, wait_until_ready
from vsnbench.ros2.docking import Dock, subscribe_dock
from vsnbench.ros2.graph_check import command_fault, hash_fault, incompatibility, listeners, type_fault
from vsnbench.ros2.installation import INSTALL, discovery, irobot_type, missing_packages
from vsnbench.ros2.interface import VELOCITIES, Ros2Interface, ros2_interface
from vsnbench.ros2.questions import Asker

if TYPE_CHECKING:
    from vsnbench.ros2.topic_listener import TopicListener
    from vsnbench.sensing.heard import Heard

LISTEN_S = 2.0


def check_ros2_robot(profile: RobotProfile, *, move: bool = False) -> Iterator[CheckResult]:
    """Look at every part of a robot; ends early where nothing more can be looked at.

    Args:
        profile: the robot.
        move: whether the robot may turn a little on the spot, to see that its odometry follows.
    """
    if missing := missing_packages():
        yield CheckResult("ROS 2", Health.FAILED, f"no Python module {missing[0]}", INSTALL)
        return
    distribution = os.environ.get("ROS_DISTRO", "")
    yield CheckResult("ROS 2", Health.OK, f"installed{f', {distribution}' if distribution else ''}")
    from vsnbench.ros2.topic_listener import TopicListener, message_of

    names = ros2_interface(profile)
    wanted = _topics(names)
    try:
        listener = TopicListener("vsnbench_doctor", names.root, wanted)
    except RobotError as error:
        yield CheckResult("node", Health.FAILED, error.statement, error.advice)
        return
    try:
        dock = Dock(profile.name, names)
        subscribe_dock(listener.node, names, dock)
        heard = listener.listen(LISTEN_S)
        others = sorted(set(listener.graph.nodes()) - {listener.node.full_name})
        yield _graph_result(others)
        if not (others or any(listener.graph.publishers(topic) for topic in wanted)):
            return
        yield from _command_results(names, listener)
        yield from _topic_results(profile, names, listener, wanted, heard)
        yield from image_results(profile, heard, message_of, names.image_turns)
        yield from clock_results(profile, heard, frozenset(others))
        yield from _base_results(names, listener, heard, dock)
        yield _mover_result(profile, names, listener)
    finally:
        listener.close()
    if move:
        yield from _motion_results(profile)


def _topics(names: Ros2Interface) -> dict[str, str]:
    """Return every topic that the robot should publish and every ROS 2 has the type of, with that type."""
    wanted = {
        names.odometry: "nav_msgs/msg/Odometry",
        names.color: "sensor_msgs/msg/Image",
        names.depth: "sensor_msgs/msg/Image",
        names.color_info: "sensor_msgs/msg/CameraInfo",
        names.depth_info: "sensor_msgs/msg/CameraInfo",
        names.battery: "sensor_msgs/msg/BatteryState",
    }
    return {topic: kind for topic, kind in wanted.items() if topic}


def _graph_result(others: list[str]) -> CheckResult:
    if not others:
        advice = "is ROS_DOMAIN_ID the robot's, and ROS_AUTOMATIC_DISCOVERY_RANGE not LOCALHOST for a robot elsewhere?"
        return CheckResult("graph", Health.FAILED, f"{discovery()}: nobody else is there", advice)
    return CheckResult("graph", Health.OK, f"{discovery()}: {len(others)} other nodes")


def _command_results(names: Ros2Interface, listener: TopicListener) -> Iterator[CheckResult]:
    subscribers = listener.graph.subscribers(names.command)
    fault = command_fault(names.command, names.command_type, subscribers, VELOCITIES)
    fault = fault or incompatibility(listener.node.velocity_quality, listeners(subscribers))
    if fault is not None:
        yield CheckResult(names.command, Health.FAILED, fault.statement, fault.advice)
        return
    bases = listeners(subscribers)
    heard_by = ", ".join(f"{one.node} ({one.qos_words})" for one in bases)
    yield CheckResult(names.command, Health.OK, f"{bases[0].type_name}, heard by {heard_by}")
    rivals = sorted({one.node for one in listener.graph.publishers(names.command) if not one.steers_for_us})
    if rivals:
        advice = "end it, unless it only passes commands on"
        yield CheckResult(names.command, Health.WARNING, f"{', '.join(rivals)} can steer the base, too", advice)


def _topic_results(
    profile: RobotProfile,
    names: Ros2Interface,
    listener: TopicListener,
    wanted: dict[str, str],
    heard: dict[str, Heard],
) -> Iterator[CheckResult]:
    rates = {names.odometry: profile.base.odometry_rate_hz, names.color: names.camera_rate_hz}
    if names.depth:
        rates[names.depth] = names.camera_rate_hz
    for topic, kind in wanted.items():
        bad = Health.FAILED if topic in rates else Health.WARNING
        publishers = listener.graph.publishers(topic)
        ours = next((one.type_hash for one in listener.graph.subscribers(topic) if one.steers_for_us), "")
        if not publishers:
            advice = f"start its driver, or name the right topic in the profile; is it in {discovery()}?"
            yield CheckResult(topic, bad, "nobody publishes it", advice)
        elif (fault := type_fault(topic, kind, publishers)) is not None:
            yield CheckResult(topic, bad, fault.statement, fault.advice)
        elif len(heard[topic].senders) > 1:
            advice = "end one of them, or give each robot a namespace (--robot NAME@NAMESPACE)"
            seen = f"{' and '.join(sorted(heard[topic].senders))} both publish it"
            yield CheckResult(topic, Health.FAILED, seen, advice)
        elif other := hash_fault(topic, ours, publishers):
            advice = "the robot runs another distribution, whose messages may not be understood"
            yield CheckResult(topic, Health.WARNING, other, advice)
        elif not heard[topic].arrivals:
            sender = publishers[0]
            yield CheckResult(
                topic,
                bad,
                f"silent for {LISTEN_S:g} s; {sender.node} publishes {sender.qos_words}",
                "is it alive? large images are lost on a slow network: see docs/robot.md",
            )
        elif topic in rates:
            yield rate_result(topic, f"{kind} ({publishers[0].qos_words})", heard[topic], rates[topic])
        else:
            yield CheckResult(topic, Health.OK, kind)


def _base_results(
    names: Ros2Interface, listener: TopicListener, heard: dict[str, Heard], dock: Dock
) -> Iterator[CheckResult]:
    """Say what the base can say of contacts, its battery and its dock."""
    if names.hazards and irobot_type("msg", "HazardDetectionVector") is None:
        yield CheckResult(
            names.hazards,
            Health.WARNING,
            "irobot_create_msgs is not on this machine: a collision is a person's word",
            "press the space bar at a contact, or source a distribution that has ros-<distro>-irobot-create-msgs",
        )
    elif names.hazards and not listener.graph.publishers(names.hazards):
        advice = "uncomment hazard_detection in the robot's republisher.yaml"
        yield CheckResult(names.hazards, Health.WARNING, "nobody publishes it: a collision is a person's word", advice)
    if names.battery and heard[names.battery].messages:
        from vsnbench.ros2.topic_listener import message_of

        state = message_of("sensor_msgs/BatteryState", heard[names.battery].messages[-1])
        said = Battery.reported(state.percentage, state.voltage)
        if dock.is_charging and dock.is_docked is None:
            advice = f"a docked base does not turn: {dock.advice}"
            words = f"{said.words}, charging" if said else "charging"
            yield CheckResult("battery", Health.WARNING, f"{words}: is it on its dock?", advice)
        elif said is not None:
            yield battery_result(said)
    if dock.fault is not None:
        yield CheckResult("dock", Health.FAILED, dock.fault.statement, dock.advice)
    elif dock.is_docked is not None:
        yield CheckResult("dock", Health.OK, "the robot is off it")


def _mover_result(profile: RobotProfile, names: Ros2Interface, listener: TopicListener) -> CheckResult:
    name = names.discrete_move
    if not listener.graph.subscribers(f"{name}/question"):
        seen = "none beside the base: vsnbench run steers it over the network"
        return CheckResult(name, Health.OK, seen, f"on a poor network, on the robot: {_start(profile)}")
    try:
        Asker(listener.node, name).ask({"movement": "Ping"}, 2.0)
    except RobotError as error:
        return CheckResult(name, Health.FAILED, error.statement, f"restart it: {_start(profile)}")
    return CheckResult(name, Health.OK, "beside the base, and answers")


def _start(profile: RobotProfile) -> str:
    return f"vsnbench ros2 discrete-move --robot {profile.name}"


def _motion_results(profile: RobotProfile) -> Iterator[CheckResult]:
    """Turn a little to the left and back as a session does, and see that the odometry follows."""
    try:
        link = connect(profile, ProtocolParameters())
    except RobotError as error:
        yield CheckResult("turn", Health.FAILED, error.statement, error.advice)
        return
    try:
        wait_until_ready(link, Patience(10.0))
        for word, sign in (("Left", 1), ("Right", -1)):
            before = link.snapshot().latest
            answered = link.move(word, 30, 15.0)
            link.wait_for(lambda now: now.at_rest(0.3, 0.001, math.radians(0.05)), 2.0)
            after = link.snapshot().latest
            if before is None or after is None:
                yield CheckResult(f"{word} 30°", Health.FAILED, "no odometry", "start the base's driver")
                return
            turned_rad = after.pose.heading_rad - before.pose.heading_rad
            result = judge_turn(f"{word} 30°", sign * math.radians(30), turned_rad, answered=answered)
            outcome = link.snapshot().outcome
            yield result if answered or outcome is None else replace(result, advice=outcome.reason)
            if result.health is Health.FAILED:
                return
    except RobotError as error:
        yield CheckResult("turn", Health.FAILED, error.statement, error.advice)
    finally:
        link.stand_still()
        link.close()
