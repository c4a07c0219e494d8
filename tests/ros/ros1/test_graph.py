"""Faults in the registrations of a ROS master: duplicate publishers, a server of another topic, other nodes."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from vsnbench.robots.profiles import load_profile
from vsnbench.ros.ros1.graph import GraphFault, graph_faults, steering_nodes, unregistered_publisher
from vsnbench.ros.ros1.interface import ros1_interface
from vsnbench.ros.ros1.master import SystemState
from vsnbench.ros.ros1.readiness import Ros1Readiness
from vsnbench.sensing.robot_reports import RobotSnapshot

NAMES = ros1_interface(load_profile("turtlebot2"))
TYPES = {NAMES.command: "geometry_msgs/Twist", "/cmd_vel": "geometry_msgs/Twist", "/odom": "nav_msgs/Odometry"}
CLIENT = frozenset({"/vsnbench"})


def state(**changes: list[str]) -> SystemState:
    """A healthy robot: base, camera, vsnbench's server and client; `changes` are publishers by topic."""
    publishers = {
        NAMES.odometry: ["/base"],
        NAMES.color: ["/camera"],
        NAMES.depth: ["/camera"],
        NAMES.command: ["/discrete_move", "/vsnbench"],
    }
    subscribers = {NAMES.command: ["/base"], "/cmd_vel": ["/cmd_vel_mux"]}
    return SystemState(publishers | changes, subscribers, {NAMES.discrete_move: ["/discrete_move"]})


def faults(found: SystemState) -> list[GraphFault]:
    return graph_faults(NAMES, found, TYPES, CLIENT)


def test_a_healthy_robot_has_no_fault() -> None:
    assert faults(state()) == []


@pytest.mark.parametrize("topic", [NAMES.odometry, NAMES.color, NAMES.depth, NAMES.bumper])
def test_two_publishers_of_one_topic_are_named(topic: str) -> None:
    (fault,) = faults(state(**{topic: ["/second", "/first"]}))
    assert (fault.code, fault.name, fault.fatal) == ("two-publishers", topic, True)
    assert "/first and /second" in fault.seen


def test_a_server_that_steers_another_topic_is_named_with_both_topics() -> None:
    elsewhere = state(**{NAMES.command: ["/vsnbench"], "/cmd_vel": ["/discrete_move"]})
    (fault,) = faults(elsewhere)
    assert (fault.code, fault.fatal) == ("steers-another-topic", True)
    assert {"/discrete_move", "/cmd_vel,", NAMES.command} <= set(fault.seen.split())


def test_a_server_may_steer_through_a_relay() -> None:
    relayed = state(**{NAMES.command: ["/cmd_vel_mux", "/vsnbench"], "/cmd_vel": ["/discrete_move"]})
    (fault,) = faults(relayed)
    assert (fault.code, fault.fatal) == ("other-steering-node", False)
    assert "/cmd_vel_mux" in fault.seen


def test_the_server_or_its_relay_steers_for_the_session() -> None:
    assert steering_nodes(NAMES, state(**{NAMES.command: ["/discrete_move", "/teleop"]}), TYPES) == {"/discrete_move"}
    relayed = state(**{NAMES.command: ["/cmd_vel_mux", "/teleop"], "/cmd_vel": ["/discrete_move"]})
    assert steering_nodes(NAMES, relayed, TYPES) == {"/cmd_vel_mux"}


def test_another_node_on_the_command_topic_is_a_warning() -> None:
    (fault,) = faults(state(**{NAMES.command: ["/discrete_move", "/teleop"]}))
    assert (fault.code, fault.fatal) == ("other-steering-node", False)


def test_a_publisher_that_is_not_registered_at_the_master_is_named() -> None:
    fault = unregistered_publisher(NAMES.odometry, ["/base", "/ghost"], state())
    assert fault is not None
    assert fault.error.code == "unregistered-publisher"
    assert "/ghost" in fault.seen
    assert unregistered_publisher(NAMES.odometry, ["/base"], state()) is None


def test_a_server_that_registers_while_the_parts_are_checked_steers_for_the_session() -> None:
    """Its velocities were those of another publisher, when the master was asked just before it was registered."""
    registered = replace(state(), subscribers={**state().subscribers, NAMES.odometry: ["/vsnbench"]})
    states = [replace(registered, services={}), registered]
    readiness = Ros1Readiness(
        NAMES,
        RobotSnapshot,
        lambda: "",
        load_profile("turtlebot2"),
        master=SimpleNamespace(caller="/vsnbench", state=lambda: states.pop(0), topic_types=lambda: TYPES),  # type: ignore[arg-type]
        discrete_move=SimpleNamespace(probe=lambda: None),  # type: ignore[arg-type]
    )
    assert readiness._network_fault() is None
    assert readiness._server_fault(RobotSnapshot()) is None
    assert readiness.steering == {"/discrete_move"}
