"""What the graph says of a robot's topics is put into one line with what to do, before the robot moves."""

import pytest

from tests.ros2.wire import STAMPED, TWIST, base, qos
from vsnbench.ros2.graph_check import command_fault, hash_fault, incompatibility, listeners, type_fault


def test_our_own_nodes_are_no_base_but_the_simulated_one_is() -> None:
    ours = [base(node) for node in ("/vsnbench_17", "/a/discrete_move", "/vsnbench_doctor")]
    theirs = [base(node) for node in ("/simulated_robot", "/vsnbench_lab", "/a/base")]
    assert listeners(ours + theirs) == theirs


@pytest.mark.parametrize(
    ("wanted", "bases", "says"),
    [
        ("", [], "nobody listens to velocities on /cmd_vel"),
        ("", [base("/vsnbench_17")], "nobody listens to velocities on /cmd_vel"),
        (TWIST, [base(kind=STAMPED)], f"/base listens to {STAMPED} on /cmd_vel, the profile says {TWIST}"),
        ("", [base(kind="std_msgs/msg/String")], "/base listens to std_msgs/msg/String on /cmd_vel: a velocity is"),
    ],
)
def test_a_base_that_cannot_be_steered_is_named(wanted, bases, says) -> None:
    assert says in str(command_fault("/cmd_vel", wanted, bases, [TWIST, STAMPED]))


@pytest.mark.parametrize("wanted", ["", STAMPED])
def test_a_base_that_hears_what_we_say_is_no_fault(wanted) -> None:
    assert command_fault("/cmd_vel", wanted, [base(kind=STAMPED)], [TWIST, STAMPED]) is None


@pytest.mark.parametrize(
    ("asks", "unmet"),
    [
        ({"reliability": "RELIABLE"}, "asks for reliable and would never hear what is sent best effort and volatile"),
        ({"durability": "TRANSIENT_LOCAL"}, "asks for transient local"),
        ({"deadline_s": 1.0}, "asks for a deadline"),
        ({"lease_s": 1.0}, "asks for a lease of liveliness"),
        ({"deadline_s": 9.2e9, "lease_s": 9.2e9}, ""),
        ({}, ""),
    ],
)
def test_a_listener_that_would_never_hear_is_named(asks, unmet) -> None:
    fault = incompatibility(qos(), [base(), base("/other", **asks)])
    assert (fault is None) == (unmet == "")
    assert unmet in str(fault or "")
    assert fault is None or fault.statement.startswith("/other ")


def test_a_reliable_sender_is_heard_by_whoever_asks_for_it() -> None:
    assert incompatibility(qos(reliability="RELIABLE"), [base(reliability="RELIABLE"), base()]) is None


def test_a_topic_of_another_type_or_another_definition_is_named() -> None:
    publisher = base("/camera", "sensor_msgs/msg/CompressedImage", "RIHS01_ab")
    assert "/image is a sensor_msgs/msg/CompressedImage, not a sensor_msgs/msg/Image" in str(
        type_fault("/image", "sensor_msgs/msg/Image", [publisher])
    )
    assert type_fault("/image", "sensor_msgs/msg/Image", []) is None
    assert "/camera has another definition" in hash_fault("/image", "RIHS01_cd", [publisher])
    assert hash_fault("/image", "RIHS01_ab", [publisher]) == ""
    assert hash_fault("/image", "", [publisher]) == ""
