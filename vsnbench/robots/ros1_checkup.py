"""The check-up of a ROS robot before a session: every part looked at for real, each with a line of its own."""

from __future__ import annotations

import math
import os
import socket
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING
from urllib.parse import urlparse

from vsnbench.errors import RobotError
from vsnbench.motion.law import ideal_duration_s
from vsnbench.motion.settings import MotionSettings
from vsnbench.protocol.actions import Action
from vsnbench.protocol.battery import Battery
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.robots.check_result import CheckResult, Health
from vsnbench.robots.image_checkup import image_results
from vsnbench.robots.interface_kinds import interface_of
from vsnbench.ros1.graph_check import graph_faults, server_of
from vsnbench.ros1.installation import missing_packages
from vsnbench.ros1.interface import ros1_interface
from vsnbench.ros1.master import Master, MasterError, SystemState
from vsnbench.sensing.heard import Heard

if TYPE_CHECKING:
    from vsnbench.ros1.topic_listener import TopicListener

LISTEN_S = 2.0
_SLOW = 0.8
"""Less than this share of the profile's rate is worth a warning."""
_SKEW_S = 0.1
_BYSTANDERS = frozenset({"/vsnbench", "/vsnbench_doctor"})
_MOST_OFF_RAD = 0.08
"""Upstream's own tolerance of a turn (4.6°): a turn that is off by more is none."""
_PAPER_OFF_RAD = math.radians(0.5)
"""Well over the paper's 0.1°, with the odometry's own noise: upstream's server, or a base that slips."""


def check_ros_robot(profile: RobotProfile, *, move: bool = False) -> Iterator[CheckResult]:
    """Look at every part of a robot; ends early where nothing more can be looked at.

    Args:
        profile: the robot.
        move: whether the robot may turn a little on the spot, to see that its odometry follows.
    """
    if missing := missing_packages():
        yield CheckResult("ROS 1", Health.FAILED, f"no Python module {missing[0]}", "run scripts/install_ros.sh")
        return
    yield CheckResult("ROS 1", Health.OK, "installed")
    try:
        master = Master.from_environment()
        began_s = time.monotonic()
        master.pid()
        trip_ms = (time.monotonic() - began_s) * 1000
    except MasterError as error:
        yield CheckResult("master", Health.FAILED, error.statement, error.advice)
        return
    yield CheckResult("master", Health.OK, f"{master.uri} answers in {trip_ms:.0f} ms")
    yield _own_address(master)
    if (other := master.live_node("/vsnbench")) is not None:
        yield CheckResult("session", Health.WARNING, f"vsnbench is running at {other}", "wait until it has ended")
    from vsnbench.ros1.topic_listener import TopicListener, message_class

    listener = TopicListener("vsnbench_doctor", [topic for topic, _ in _topics(profile)])
    try:
        heard = listener.listen(LISTEN_S)
        state, types = master.state(), master.topic_types()
        yield from _topic_results(profile, state, types, heard)
        yield from image_results(profile, heard, lambda kind, data: message_class(kind)().deserialize(data))
        yield from _battery_results(profile, heard)
        yield from clock_results(profile, heard, _remote_nodes(master, state))
        yield from _service_results(profile, master)
        if move:
            yield from _motion_results(profile, master, listener)
    finally:
        listener.close()


def _topics(profile: RobotProfile) -> list[tuple[str, str]]:
    """Return every topic that the robot should publish, with its type."""
    names = ros1_interface(profile)
    wanted = [
        (names.odometry, "nav_msgs/Odometry"),
        (names.color, "sensor_msgs/Image"),
        (names.depth, "sensor_msgs/Image"),
        (names.color_info, "sensor_msgs/CameraInfo"),
        (names.depth_info, "sensor_msgs/CameraInfo"),
        (names.bumper, names.bumper_type),
        (names.cliff, names.cliff_type),
        (names.wheel_drop, names.wheel_drop_type),
        (names.battery, names.battery_type),
    ]
    return [(topic, kind) for topic, kind in wanted if topic]


def _own_address(master: Master) -> CheckResult:
    """Say under which address other machines are told to reach this one."""
    given = os.environ.get("ROS_IP") or os.environ.get("ROS_HOSTNAME")
    remote = urlparse(master.uri).hostname not in ("localhost", "127.0.0.1", socket.gethostname())
    if given:
        local = given.startswith("127.") or given == "localhost"
        if remote and local:
            return CheckResult(
                "own address",
                Health.FAILED,
                f"{given}, but the master is elsewhere",
                "set ROS_IP to this machine's own",
            )
        return CheckResult("own address", Health.OK, given)
    if remote:
        return CheckResult(
            "own address",
            Health.WARNING,
            f"neither ROS_IP nor ROS_HOSTNAME is set: {socket.gethostname()} must be known to the robot",
            "export ROS_IP=<this machine's address>",
        )
    return CheckResult("own address", Health.OK, "this machine only")


def _topic_results(
    profile: RobotProfile, state: SystemState, types: dict[str, str], heard: dict[str, Heard]
) -> Iterator[CheckResult]:
    names = ros1_interface(profile)
    listeners = [node for node in state.subscribers.get(names.command, []) if node != "/vsnbench_doctor"]
    server = server_of(names.discrete_move, state)
    if not set(listeners) - {server, "/vsnbench"}:
        yield CheckResult(
            names.command, Health.FAILED, "no base listens", "start the base's driver, or remap its topic"
        )
    elif types.get(names.command, "geometry_msgs/Twist") != "geometry_msgs/Twist":
        yield CheckResult(
            names.command, Health.FAILED, f"is a {types[names.command]}", "it must be a geometry_msgs/Twist"
        )
    else:
        yield CheckResult(names.command, Health.OK, f"heard by {', '.join(listeners)}")
    for fault in graph_faults(names, state, types, _BYSTANDERS):
        yield CheckResult(fault.name, Health.FAILED if fault.fatal else Health.WARNING, fault.seen, fault.advice)
    rates = {names.odometry: profile.base.odometry_rate_hz, names.color: names.camera_rate_hz}
    if names.depth:
        rates[names.depth] = names.camera_rate_hz
    needed = {names.odometry, names.color, names.depth}
    for topic, kind in _topics(profile):
        bad = Health.FAILED if topic in needed else Health.WARNING
        if not state.publishers.get(topic):
            advice = "start its driver, or name the right topic in the profile"
            if topic in needed:
                advice += "; if it runs, the master was restarted after it: restart all nodes"
            yield CheckResult(topic, bad, "nobody publishes it", advice)
        elif types.get(topic) != kind:
            yield CheckResult(topic, bad, f"is a {types.get(topic)}", f"the profile says {kind}")
        elif topic not in rates:
            yield CheckResult(topic, Health.OK, kind)
        elif not heard[topic].arrivals:
            publishers = ", ".join(state.publishers[topic])
            yield CheckResult(
                topic, bad, f"silent for {LISTEN_S:g} s", f"is {publishers} alive, and this machine known to it?"
            )
        else:
            yield rate_result(topic, kind, heard[topic], rates[topic])


def _battery_results(profile: RobotProfile, heard: dict[str, Heard]) -> Iterator[CheckResult]:
    """Say how full the battery is, where the base says so."""
    from vsnbench.ros1.battery import battery_in
    from vsnbench.ros1.topic_listener import message_class

    names = ros1_interface(profile)
    if names.battery and heard[names.battery].messages:
        said = battery_in(message_class(names.battery_type)().deserialize(heard[names.battery].messages[-1]))
        if said is not None:
            yield battery_result(said)


def battery_result(battery: Battery) -> CheckResult:
    """Say how full the battery is, and whether to charge it."""
    if battery.is_low:
        return CheckResult("battery", Health.WARNING, battery.words, "charge it before a session")
    return CheckResult("battery", Health.OK, battery.words)


def rate_result(topic: str, kind: str, heard: Heard, expected_hz: float) -> CheckResult:
    """Say how often something came, beside how often it should."""
    seen = f"{kind}, {heard.rate_hz:.1f} Hz, {heard.age_s * 1000:.0f} ms old"
    if heard.rate_hz < _SLOW * expected_hz:
        return CheckResult(
            topic, Health.WARNING, f"{seen}; the profile says {expected_hz:g} Hz", "a slow network, or a busy machine?"
        )
    return CheckResult(topic, Health.OK, seen)


def _remote_nodes(master: Master, state: SystemState) -> frozenset[str]:
    """Return the publishing nodes that run on another machine than this one, as far as they say where."""
    here = {"localhost", socket.gethostname(), os.environ.get("ROS_IP", ""), os.environ.get("ROS_HOSTNAME", "")}
    remote = set()
    for node in {node for nodes in state.publishers.values() for node in nodes}:
        try:
            host = urlparse(str(master.ask("lookupNode", node))).hostname or ""
        except (LookupError, MasterError):
            continue
        if host not in here and not host.startswith("127."):
            remote.add(node)
    return frozenset(remote)


def clock_results(profile: RobotProfile, heard: dict[str, Heard], remote: frozenset[str]) -> Iterator[CheckResult]:
    """The fastest message of each sender says how far its clock is from ours; on one machine there is one clock."""
    names = interface_of(profile)
    offsets = {t: heard[t].offset_s for t in (names.odometry, names.color, names.depth) if t and heard[t].arrivals}
    if not offsets:
        return
    worst = max(offsets, key=lambda topic: abs(offsets[topic]))
    off_s = offsets[worst]
    if abs(off_s) <= _SKEW_S:
        yield CheckResult("clocks", Health.OK, f"within {abs(off_s) * 1000:.0f} ms")
    elif heard[worst].senders & remote:
        seen = f"the clock behind {worst} is {abs(off_s):.2f} s {'behind' if off_s > 0 else 'ahead'}"
        yield CheckResult("clocks", Health.WARNING, seen, "synchronise the machines' clocks (chrony or ntpd)")
    elif off_s > 0:
        seen = f"one machine, one clock; {worst} comes {off_s:.2f} s after its stamps"
        yield CheckResult("delay", Health.WARNING, seen, "this machine is busy: end what else runs on it")
    else:
        seen = f"{worst} is stamped {-off_s:.2f} s ahead of this machine's own clock"
        yield CheckResult("clocks", Health.WARNING, seen, "its driver stamps wrongly: see how it takes its time")
    between_s = max(offsets.values()) - min(offsets.values())
    if between_s > _SKEW_S:
        yield CheckResult(
            "stamps",
            Health.FAILED,
            f"odometry and camera differ by {between_s:.2f} s",
            "images could not be told from those before a motion: have both stamped by one machine",
        )


def _service_results(profile: RobotProfile, master: Master) -> Iterator[CheckResult]:
    from vsnbench.ros1.messages import DiscreteServer
    from vsnbench.ros1.service_call import ServiceClient, ServiceRefusedError

    name = ros1_interface(profile).discrete_move
    client = ServiceClient(name, DiscreteServer, master, "/vsnbench_doctor")
    try:
        trip_s = client.probe()
    except ServiceRefusedError as error:
        advice = error.advice or "another version of discrete_move/DiscreteServer serves it"
        yield CheckResult(name, Health.FAILED, error.statement, advice)
    except RobotError as error:
        start = f"vsnbench ros1 discrete-move --robot {profile.name}"
        yield CheckResult(name, Health.FAILED, error.statement, f"start it: {start}")
    else:
        yield CheckResult(name, Health.OK, f"discrete_move/DiscreteServer, {trip_s * 1000:.0f} ms")


def _motion_results(profile: RobotProfile, master: Master, listener: TopicListener) -> Iterator[CheckResult]:
    """Turn a little to the left and back, and see that the odometry follows."""
    from vsnbench.ros1.messages import DiscreteServer, DiscreteServerRequest
    from vsnbench.ros1.service_call import ServiceClient

    client = ServiceClient(ros1_interface(profile).discrete_move, DiscreteServer, master, "/vsnbench_doctor")
    limit_s = 2 * ideal_duration_s(Action.TURN_LEFT, MotionSettings.for_robot(profile)) + 12.0
    for word, sign in (("Left", 1), ("Right", -1)):
        what = f"{word} 30°"
        before = listener.heading_rad(ros1_interface(profile).odometry)
        try:
            answered = client.call(DiscreteServerRequest(word, 30), limit_s).response
        except RobotError as error:
            yield CheckResult(what, Health.FAILED, error.statement, error.advice or "see the log of discrete_move")
            return
        after = listener.heading_rad(ros1_interface(profile).odometry)
        if before is None or after is None:
            yield CheckResult(what, Health.FAILED, "no odometry", "start the base's driver")
            return
        result = judge_turn(what, sign * math.radians(30), math.remainder(after - before, math.tau), answered=answered)
        yield result
        if result.health is Health.FAILED:
            return


def judge_turn(what: str, asked_rad: float, turned_rad: float, *, answered: bool) -> CheckResult:
    """Say how well the odometry followed a turn that was asked for."""
    seen = f"answered {bool(answered)}; the odometry turned {math.degrees(turned_rad):+.1f}°"
    off_rad = abs(turned_rad - asked_rad)
    if not answered or off_rad > _MOST_OFF_RAD:
        advice = "do the wheels turn? is it the same robot? see discrete_move's log"
        return CheckResult(what, Health.FAILED, seen, advice)
    if off_rad > _PAPER_OFF_RAD:
        advice = "coarser than the paper's 0.1°, as upstream's server is: vsnbench ros1 discrete-move is not"
        return CheckResult(what, Health.WARNING, seen, advice)
    return CheckResult(what, Health.OK, seen)
