"""Whether every part of a robot on a ROS 1 network answers; imported only where ROS is installed."""

import logging
import time
from typing import TYPE_CHECKING

from vsnbench.errors import RobotError
from vsnbench.ros1.graph_check import GraphFault, graph_faults, unknown_to_master
from vsnbench.ros1.master import MasterError, SystemState
from vsnbench.sensing.robot_reports import AGE_LIMIT_S, RobotSnapshot

if TYPE_CHECKING:
    from vsnbench.ros1.robot_link import RobotLink

logger = logging.getLogger(__name__)


def missing_part(link: "RobotLink", profile_name: str, warned: set[str]) -> RobotError | None:
    """Return the first part that does not answer and what to do about it; None when all do.

    Raises:
        RobotError: the master was restarted, which no patience heals.
    """
    names, now, now_s = link.names, link.snapshot(), time.monotonic()
    try:
        state, types = link.master.state(), link.master.topic_types()
    except MasterError as error:
        return error
    if link.master.caller not in state.subscribers.get(names.odometry, []):
        raise RobotError(
            f"the master at {link.master.uri} was restarted and knows nothing of this session",
            advice="restart all nodes (driver, camera, discrete_move), then the same command goes on",
        )
    for fault in graph_faults(names, state, types, frozenset({link.master.caller})):
        if fault.fatal:
            return fault.error
        if (said := str(fault.error)) not in warned:
            warned.add(said)
            logger.warning("%s", said)
    if now_s - now.driven_s < AGE_LIMIT_S:
        return RobotError(f"{now.driven_by} is driving the base", advice="end it, or wait until it has")
    if now.odometry_age_s(now_s) > AGE_LIMIT_S:
        return _silence("odometry", names.odometry, state, "the base's driver")
    for topic, images in ((names.color, now.colors), (names.depth, now.depths)):
        if topic and (not images or now_s - images[-1].arrival_s > AGE_LIMIT_S):
            return _silence("image", topic, state, "the camera's driver")
    if (unknown := _unknown_node(link, now, state)) is not None:
        return unknown.error
    try:
        link.discrete_move.probe()
    except RobotError as error:
        start = f"(vsnbench ros1 discrete-move --robot {profile_name})"
        return RobotError(error.statement, advice=f"{error.advice} {start}".strip())
    return None


def _unknown_node(link: "RobotLink", now: RobotSnapshot, state: SystemState) -> GraphFault | None:
    now_s = time.monotonic()
    topics = [topic for topic in (link.names.odometry, link.names.color, link.names.depth) if topic]
    faults = (unknown_to_master(topic, now.nodes_heard_on(topic, now_s), state) for topic in topics)
    return next((fault for fault in faults if fault is not None), None)


def _silence(what: str, topic: str, state: SystemState, driver: str) -> RobotError:
    """Say why nothing comes on a topic, as far as the master knows."""
    if publishers := state.publishers.get(topic):
        nodes = " and ".join(publishers)
        return RobotError(
            f"no {what} on {topic}, which {nodes} publishes", advice="is it alive, and are ROS_IP and cables right?"
        )
    return RobotError(
        f"no {what} on {topic}",
        advice=f"start {driver}; if it runs, the master was restarted after it: restart all nodes",
    )
