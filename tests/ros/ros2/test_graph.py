"""Faults of types and quality of service on the ROS 2 graph are named before the robot moves."""

from types import SimpleNamespace
from typing import Any

import pytest

from tests.ros.ros2.wire import STAMPED, TWIST, base, qos
from vsnbench.ros.ros2 import graph
from vsnbench.ros.ros2.graph import Graph, bases_of, command_fault, hash_fault, incompatibility, type_fault


def test_only_the_simulated_robot_among_own_nodes_is_a_base() -> None:
    ours = [base(node) for node in ("/vsnbench_17", "/a/discrete_move", "/vsnbench_doctor")]
    theirs = [base(node) for node in ("/simulated_robot", "/vsnbench_lab", "/a/base")]
    assert bases_of(ours + theirs) == theirs


@pytest.mark.parametrize(
    ("wanted", "bases", "code"),
    [
        ("", [], "no-base"),
        ("", [base("/vsnbench_17")], "no-base"),
        (TWIST, [base(kind=STAMPED)], "wrong-command-type"),
        ("", [base(kind="std_msgs/msg/String")], "wrong-command-type"),
    ],
)
def test_a_base_that_cannot_be_steered_is_a_fault(wanted, bases, code) -> None:
    fault = command_fault("/cmd_vel", wanted, bases, [TWIST, STAMPED])
    assert fault is not None
    assert fault.code == code
    assert "/cmd_vel" in fault.statement


@pytest.mark.parametrize("wanted", ["", STAMPED])
def test_a_base_that_subscribes_to_a_known_type_is_not_a_fault(wanted) -> None:
    assert command_fault("/cmd_vel", wanted, [base(kind=STAMPED)], [TWIST, STAMPED]) is None


@pytest.mark.parametrize(
    ("asks", "unmet"),
    [
        ({"reliability": "RELIABLE"}, "requires reliable, but the publisher is best effort and volatile"),
        ({"durability": "TRANSIENT_LOCAL"}, "requires transient local"),
        ({"deadline_s": 1.0}, "requires a deadline"),
        ({"lease_s": 1.0}, "requires a liveliness lease"),
        ({"deadline_s": 9.2e9, "lease_s": 9.2e9}, ""),
        ({}, ""),
    ],
)
def test_a_subscriber_with_an_incompatible_quality_is_named(asks, unmet) -> None:
    fault = incompatibility(qos(), [base(), base("/other", **asks)])
    assert (fault is None) == (unmet == "")
    assert unmet in str(fault or "")
    assert fault is None or fault.statement.startswith("/other ")


def test_a_reliable_publisher_fits_every_reliability() -> None:
    assert incompatibility(qos(reliability="RELIABLE"), [base(reliability="RELIABLE"), base()]) is None


def test_a_topic_of_another_type_or_another_definition_is_named() -> None:
    publisher = base("/camera", "sensor_msgs/msg/CompressedImage", "RIHS01_ab")
    fault = type_fault("/image", "sensor_msgs/msg/Image", [publisher])
    assert fault is not None
    assert fault.code == "wrong-topic-type"
    assert type_fault("/image", "sensor_msgs/msg/Image", []) is None
    assert "/camera has another definition" in hash_fault("/image", "RIHS01_cd", [publisher])
    assert hash_fault("/image", "RIHS01_ab", [publisher]) == ""
    assert hash_fault("/image", "", [publisher]) == ""


def publisher(node: str) -> Any:
    """Return a publisher as rclpy reports it; its identifier is its name."""
    return SimpleNamespace(
        node_namespace="/", node_name=node, topic_type=TWIST, qos_profile=qos(), endpoint_gid=list(node.encode())
    )


def test_a_message_without_its_publisher_is_from_the_only_one(monkeypatch: pytest.MonkeyPatch) -> None:
    publishers = [publisher("base")]
    asked = SimpleNamespace(get_publishers_info_by_topic=lambda _: publishers)
    of_jazzy, of_kilted = {"source_timestamp": 1}, {"publisher_gid": {"data": b"rival"}}
    seen = Graph(SimpleNamespace(rclpy=asked))
    now_s = [100.0]
    monkeypatch.setattr(graph, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    assert seen.sender("/odom", of_jazzy) == "/base"
    publishers.append(publisher("rival"))
    assert seen.sender("/odom", of_kilted) == "/rival"
    now_s[0] += 1.0
    assert seen.sender("/odom", of_jazzy) == ""
