"""Whether every part of a robot on a ROS 2 graph answers; imported only where ROS 2 is installed."""

import logging
import time
from typing import TYPE_CHECKING

from vsnbench.errors import RobotError
from vsnbench.ros2.graph_check import type_fault
from vsnbench.ros2.installation import discovery
from vsnbench.sensing.robot_reports import AGE_LIMIT_S
from vsnbench.sensing.simulation import ACCOUNT

if TYPE_CHECKING:
    from vsnbench.ros2.robot_link import RobotLink

logger = logging.getLogger(__name__)

_DISCOVERY_S = 3.5
"""Who is on the graph is found out within this time: what was lost at first comes again after 3 s (DDS's usual period
of announcements and of heartbeats). Before it is over, that a node was not seen says nothing."""


def missing_part(link: "RobotLink", warned: set[str]) -> RobotError | None:
    """Return the first part that does not answer and what to do about it; None when all do."""
    time.sleep(max(0.0, link.node.began_s + _DISCOVERY_S - time.monotonic()))
    names, now, now_s = link.names, link.snapshot(), time.monotonic()
    if earlier := _earlier_session(link):
        return RobotError(f"{earlier} drives this robot already", advice="wait until it has ended")
    for topic in (names.odometry, names.color, names.depth):
        # By the graph, which knows an endpoint before anything was heard; of a killed node for some seconds more.
        publishers = link.graph.publishers(topic)
        if len(publishers) > 1:
            nodes = " and ".join(sorted(one.node for one in publishers))
            apart = f"end one of them, or give each robot a namespace (--robot {link.profile_name}@NAMESPACE)"
            return RobotError(f"{nodes} both publish {topic}", advice=apart)
    if fault := link.velocities.connect():
        return fault
    if now_s - now.driven_s < AGE_LIMIT_S:
        return RobotError(f"{now.driven_by} is driving the base", advice="end it, or wait until it has")
    if now.odometry_age_s(now_s) > AGE_LIMIT_S:
        return _silence(link, "odometry", names.odometry, "nav_msgs/msg/Odometry", "the base's driver")
    for topic, images in ((names.color, now.colors), (names.depth, now.depths)):
        if topic and (not images or now_s - images[-1].arrival_s > AGE_LIMIT_S):
            return _silence(link, "image", topic, "sensor_msgs/msg/Image", "the camera's driver")
    if now.simulation is None and link.graph.publishers(names.resolve(ACCOUNT.lstrip("/"))):
        return RobotError("a simulator plays the robot and has not said yet what it plays")
    if fault := link.dock.fault:
        return fault
    if now.simulation is None:
        _say_once(warned, link)
    return link.choose_server()


def _say_once(warned: set[str], link: "RobotLink") -> None:
    if link.dock.doubt and "dock" not in warned:
        warned.add("dock")
        logger.warning("%s", link.dock.doubt)
    for topic in link.unheard:
        if topic not in warned:
            warned.add(topic)
            logger.warning(
                "%s cannot be heard without irobot_create_msgs: a collision is a person's word (space bar, and when "
                "asked after the episode)",
                topic,
            )


def _earlier_session(link: "RobotLink") -> str:
    """Return the client that drives this robot since before us; empty for none."""
    place, _, own = link.node.full_name.rpartition("/vsnbench_")
    for name in link.graph.nodes():
        elsewhere, _, number = name.rpartition("/vsnbench_")
        if elsewhere == place and number.isdigit() and int(number) < int(own):
            return name
    return ""


def _silence(link: "RobotLink", what: str, topic: str, kind: str, driver: str) -> RobotError:
    """Say why nothing comes on a topic, as far as the graph knows."""
    publishers = link.graph.publishers(topic)
    if fault := type_fault(topic, kind, publishers):
        return fault
    if publishers:
        nodes = " and ".join(sorted({one.node for one in publishers}))
        return RobotError(
            f"no {what} on {topic}, which {nodes} publishes", advice="is it alive, and the network fast enough?"
        )
    return RobotError(
        f"no {what} on {topic}",
        advice=f"start {driver}; if it runs, is it in {discovery()}, too, and in this namespace?",
    )
