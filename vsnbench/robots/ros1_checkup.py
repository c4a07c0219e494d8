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
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.robots.finding import Finding, Health
from vsnbench.ros1.installation import missing_packages
from vsnbench.ros1.interface import ros1_interface
from vsnbench.ros1.master import Master, MasterError, SystemState
from vsnbench.sensing.depth_filter import DepthImage, median_depth_m, share_invalid
from vsnbench.sensing.image_decoding import ImageError, decode_color, decode_depth

if TYPE_CHECKING:
    from vsnbench.ros1.topic_listener import Heard, TopicListener

LISTEN_S = 2.0
_SLOW = 0.8
"""Less than this share of the profile's rate is worth a warning."""
_SKEW_S = 0.1
_FOV_SHARE = 0.03
_HOLES = 0.4


def check_ros_robot(profile: RobotProfile, *, move: bool = False) -> Iterator[Finding]:
    """Look at every part of a robot; ends early where nothing more can be looked at.

    Args:
        profile: the robot.
        move: whether the robot may turn a little on the spot, to see that its odometry follows.
    """
    if missing := missing_packages():
        yield Finding("ROS 1", Health.FAILED, f"no Python module {missing[0]}", "run scripts/install_ros.sh")
        return
    yield Finding("ROS 1", Health.OK, "installed")
    try:
        master = Master.from_environment()
        began_s = time.monotonic()
        master.pid()
        trip_ms = (time.monotonic() - began_s) * 1000
    except MasterError as error:
        reason, _, advice = str(error).partition(": ")
        yield Finding("master", Health.FAILED, reason, advice)
        return
    yield Finding("master", Health.OK, f"{master.uri} answers in {trip_ms:.0f} ms")
    yield _own_address(master)
    if (other := master.live_node("/vsnbench")) is not None:
        yield Finding("session", Health.WARNING, f"vsnbench is running at {other}", "wait until it has ended")
    from vsnbench.ros1.topic_listener import TopicListener

    listener = TopicListener("vsnbench_doctor", [topic for topic, _ in _topics(profile)])
    try:
        heard = listener.listen(LISTEN_S)
        state, types = master.state(), master.topic_types()
        yield from _topic_findings(profile, state, types, heard)
        yield from _image_findings(profile, heard)
        yield from _clock_findings(profile, heard)
        yield from _service_findings(profile, master)
        if move:
            yield from _motion_findings(profile, master, listener)
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
    ]
    return [(topic, kind) for topic, kind in wanted if topic]


def _own_address(master: Master) -> Finding:
    """Say under which address other machines are told to reach this one."""
    given = os.environ.get("ROS_IP") or os.environ.get("ROS_HOSTNAME")
    remote = urlparse(master.uri).hostname not in ("localhost", "127.0.0.1", socket.gethostname())
    if given:
        local = given.startswith("127.") or given == "localhost"
        if remote and local:
            return Finding(
                "own address",
                Health.FAILED,
                f"{given}, but the master is elsewhere",
                "set ROS_IP to this machine's own",
            )
        return Finding("own address", Health.OK, given)
    if remote:
        return Finding(
            "own address",
            Health.WARNING,
            f"neither ROS_IP nor ROS_HOSTNAME is set: {socket.gethostname()} must be known to the robot",
            "export ROS_IP=<this machine's address>",
        )
    return Finding("own address", Health.OK, "this machine only")


def _topic_findings(
    profile: RobotProfile, state: SystemState, types: dict[str, str], heard: dict[str, Heard]
) -> Iterator[Finding]:
    names = ros1_interface(profile)
    listeners = [node for node in state.subscribers.get(names.command, []) if node != "/vsnbench_doctor"]
    if not any("discrete_move" not in node and "vsnbench" not in node for node in listeners):
        yield Finding(names.command, Health.FAILED, "no base listens", "start the base's driver, or remap its topic")
    elif types.get(names.command, "geometry_msgs/Twist") != "geometry_msgs/Twist":
        yield Finding(names.command, Health.FAILED, f"is a {types[names.command]}", "it must be a geometry_msgs/Twist")
    else:
        yield Finding(names.command, Health.OK, f"heard by {', '.join(listeners)}")
    rates = {names.odometry: profile.base.odometry_rate_hz, names.color: names.camera_rate_hz}
    if names.depth:
        rates[names.depth] = names.camera_rate_hz
    needed = {names.odometry, names.color, names.depth}
    for topic, kind in _topics(profile):
        bad = Health.FAILED if topic in needed else Health.WARNING
        if not state.publishers.get(topic):
            yield Finding(topic, bad, "nobody publishes it", "start its driver, or name the right topic in the profile")
        elif types.get(topic) != kind:
            yield Finding(topic, bad, f"is a {types.get(topic)}", f"the profile says {kind}")
        elif topic not in rates:
            yield Finding(topic, Health.OK, kind)
        elif not heard[topic].arrivals:
            publishers = ", ".join(state.publishers[topic])
            yield Finding(
                topic, bad, f"silent for {LISTEN_S:g} s", f"is {publishers} alive, and this machine known to it?"
            )
        else:
            yield _rate_finding(topic, kind, heard[topic], rates[topic])


def _rate_finding(topic: str, kind: str, heard: Heard, expected_hz: float) -> Finding:
    seen = f"{kind}, {heard.rate_hz:.1f} Hz, {heard.age_s * 1000:.0f} ms old"
    if heard.rate_hz < _SLOW * expected_hz:
        return Finding(
            topic, Health.WARNING, f"{seen}; the profile says {expected_hz:g} Hz", "a slow network, or a busy machine?"
        )
    return Finding(topic, Health.OK, seen)


def _image_findings(profile: RobotProfile, heard: dict[str, Heard]) -> Iterator[Finding]:
    from vsnbench.ros1.messages_by_name import message_class

    names, camera = ros1_interface(profile), profile.camera
    frames: list[DepthImage] = []
    for what, topic in (("colour image", names.color), ("depth image", names.depth)):
        if not topic or not heard[topic].messages:
            continue
        images = [message_class("sensor_msgs/Image")().deserialize(data) for data in heard[topic].messages]
        try:
            if what == "depth image":
                frames = [decode_depth(image) for image in images[-names.depth_frames :]]
            else:
                decode_color(images[-1])
        except ImageError as error:
            yield Finding(what, Health.FAILED, str(error), "set the camera driver's format")
            continue
        size, wanted = (images[-1].width, images[-1].height), (camera.width, camera.height)
        seen = f"{images[-1].encoding}, {size[0]}x{size[1]}"
        if size != wanted:
            advice = "set the driver's mode, or the profile's camera"
            yield Finding(what, Health.FAILED, f"{seen}; the profile says {wanted[0]}x{wanted[1]}", advice)
        else:
            yield Finding(what, Health.OK, seen)
    if frames:
        before = share_invalid(median_depth_m(frames[-1:], camera.depth_min_m, camera.depth_max_m))
        after = share_invalid(median_depth_m(frames, camera.depth_min_m, camera.depth_max_m))
        seen = f"{before:.0%} of the pixels in one image, {after:.0%} after the median of {len(frames)}"
        worse = after > _HOLES
        advice = "something close before the camera, sunlight, or a dirty lens?" if worse else ""
        yield Finding("depth invalid", Health.WARNING if worse else Health.OK, seen, advice)
    for topic in (names.color_info, names.depth_info):
        if topic and heard[topic].messages:
            yield _camera_info_finding(profile, topic, heard[topic])


def _camera_info_finding(profile: RobotProfile, topic: str, heard: Heard) -> Finding:
    from vsnbench.ros1.messages_by_name import message_class

    info = message_class("sensor_msgs/CameraInfo")().deserialize(heard.messages[-1])
    if not info.K[0]:
        return Finding(topic, Health.WARNING, "not calibrated (K is zero)", "the profile's field of view is used")
    fov_deg = math.degrees(2 * math.atan(info.width / 2 / info.K[0]))
    wanted_deg = profile.camera.horizontal_fov_deg
    if abs(fov_deg - wanted_deg) > _FOV_SHARE * wanted_deg:
        return Finding(
            topic,
            Health.WARNING,
            f"field of view {fov_deg:.1f}°; the profile says {wanted_deg:g}°",
            f"set camera.horizontal_fov_deg: {fov_deg:.1f} in your profile",
        )
    return Finding(topic, Health.OK, f"field of view {fov_deg:.1f}°")


def _clock_findings(profile: RobotProfile, heard: dict[str, Heard]) -> Iterator[Finding]:
    """The fastest message of each sender says how far its clock is from ours."""
    names = ros1_interface(profile)
    offsets = {t: heard[t].offset_s for t in (names.odometry, names.color, names.depth) if t and heard[t].arrivals}
    if not offsets:
        return
    worst = max(offsets, key=lambda topic: abs(offsets[topic]))
    seen = f"the clock behind {worst} is {abs(offsets[worst]):.2f} s {'behind' if offsets[worst] > 0 else 'ahead'}"
    if abs(offsets[worst]) > _SKEW_S:
        yield Finding("clocks", Health.WARNING, seen, "synchronise the machines' clocks (chrony or ntpd)")
    else:
        yield Finding("clocks", Health.OK, f"within {abs(offsets[worst]) * 1000:.0f} ms")
    between_s = max(offsets.values()) - min(offsets.values())
    if between_s > _SKEW_S:
        yield Finding(
            "stamps",
            Health.FAILED,
            f"odometry and camera differ by {between_s:.2f} s",
            "images could not be told from those before a motion: have both stamped by one machine",
        )


def _service_findings(profile: RobotProfile, master: Master) -> Iterator[Finding]:
    from vsnbench.ros1.messages import DiscreteServer
    from vsnbench.ros1.service_call import ServiceClient, ServiceRefusedError

    name = ros1_interface(profile).discrete_move
    client = ServiceClient(name, DiscreteServer, master, "/vsnbench_doctor")
    try:
        trip_s = client.probe()
    except ServiceRefusedError as error:
        yield Finding(name, Health.FAILED, str(error), "another version of discrete_move/DiscreteServer serves it")
    except RobotError as error:
        start = f"vsnbench ros discrete-move --robot {profile.name}"
        yield Finding(name, Health.FAILED, str(error), f"start it: {start}")
    else:
        yield Finding(name, Health.OK, f"discrete_move/DiscreteServer, {trip_s * 1000:.0f} ms")


def _motion_findings(profile: RobotProfile, master: Master, listener: TopicListener) -> Iterator[Finding]:
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
            yield Finding(what, Health.FAILED, str(error), "see the log of discrete_move")
            return
        after = listener.heading_rad(ros1_interface(profile).odometry)
        if before is None or after is None:
            yield Finding(what, Health.FAILED, "no odometry", "start the base's driver")
            return
        turned_deg = math.degrees(math.remainder(after - before, math.tau))
        seen = f"answered {bool(answered)}; the odometry turned {turned_deg:+.1f}°"
        if not answered or abs(turned_deg - sign * 30) > 10:
            yield Finding(
                what, Health.FAILED, seen, "do the wheels turn? is it the same robot? see discrete_move's log"
            )
            return
        yield Finding(what, Health.OK, seen)
