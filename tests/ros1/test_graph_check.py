"""What the master's registrations tell about a robot: two of a kind, a server that steers elsewhere, strangers."""

import pytest

from vsnbench.robots.profiles import load_profile
from vsnbench.ros1.graph_check import graph_faults, unknown_to_master
from vsnbench.ros1.interface import ros1_interface
from vsnbench.ros1.master import SystemState

NAMES = ros1_interface(load_profile("turtlebot2"))
TYPES = {NAMES.command: "geometry_msgs/Twist", "/cmd_vel": "geometry_msgs/Twist", "/odom": "nav_msgs/Odometry"}
CLIENT = frozenset({"/vsnbench"})


def state(**changes: list[str]) -> SystemState:
    """A healthy robot: base, camera, our server and our client; `changes` are publishers by topic."""
    publishers = {
        NAMES.odometry: ["/base"],
        NAMES.color: ["/camera"],
        NAMES.depth: ["/camera"],
        NAMES.command: ["/discrete_move", "/vsnbench"],
    }
    subscribers = {NAMES.command: ["/base"], "/cmd_vel": ["/cmd_vel_mux"]}
    return SystemState(publishers | changes, subscribers, {NAMES.discrete_move: ["/discrete_move"]})


def lines(found: SystemState) -> list[str]:
    return [str(fault.error) for fault in graph_faults(NAMES, found, TYPES, CLIENT)]


def test_a_healthy_robot_has_no_fault() -> None:
    assert lines(state()) == []


@pytest.mark.parametrize("topic", [NAMES.odometry, NAMES.color, NAMES.depth, NAMES.bumper])
def test_two_publishers_of_one_topic_are_named(topic: str) -> None:
    (line,) = lines(state(**{topic: ["/second", "/first"]}))
    assert line == f"{topic}: /first and /second both publish it; end one of them"


def test_a_server_that_steers_another_topic_is_named_with_both_topics() -> None:
    elsewhere = state(**{NAMES.command: ["/vsnbench"], "/cmd_vel": ["/discrete_move"]})
    (fault,) = graph_faults(NAMES, elsewhere, TYPES, CLIENT)
    assert fault.fatal
    assert "its server /discrete_move steers /cmd_vel, but the base listens on /mobile_base/commands/vel" in str(
        fault.error
    )


def test_a_server_may_steer_through_a_relay() -> None:
    relayed = state(**{NAMES.command: ["/cmd_vel_mux", "/vsnbench"], "/cmd_vel": ["/discrete_move"]})
    (fault,) = graph_faults(NAMES, relayed, TYPES, CLIENT)
    assert not fault.fatal
    assert "/cmd_vel_mux can steer the base, too" in str(fault.error)


def test_a_stranger_on_the_command_topic_is_a_warning() -> None:
    (fault,) = graph_faults(NAMES, state(**{NAMES.command: ["/discrete_move", "/teleop"]}), TYPES, CLIENT)
    assert not fault.fatal
    assert fault.seen == "/teleop can steer the base, too"


def test_a_node_that_publishes_to_us_and_that_the_master_does_not_know_is_named() -> None:
    fault = unknown_to_master(NAMES.odometry, ["/base", "/ghost"], state())
    assert fault is not None
    assert "/ghost publishes it, but the master does not know" in str(fault.error)
    assert unknown_to_master(NAMES.odometry, ["/base"], state()) is None
