"""Types and content of the messages that a stack is told over ROS 1; live, in tests/robots/test_ros1_stack.py."""

from typing import Any

import pytest

from vsnbench.errors import ModelError

pytestmark = pytest.mark.ros


def check(kind: str, content: dict[str, Any]) -> None:
    from vsnbench.ros.ros1.exchange import Ros1Exchange
    from vsnbench.ros.ros1.master import Master

    Ros1Exchange(Master("http://127.0.0.1:1")).check(kind, content)


@pytest.mark.parametrize(
    ("kind", "content", "code", "says"),
    [
        ("their_msgs/Goal", {}, "unknown-message-type", "their_msgs/Goal is not installed here"),
        ("std_msgs/Goal", {}, "unknown-message-type", "std_msgs/Goal is not installed here"),
        ("std_msgs/Bool", {"dat": True}, "unknown-message-field", "No field name [dat]"),
        ("std_msgs/msg/Bool", {"data": "yes"}, "unknown-message-field", "field data is not a bool"),
        ("std_msgs/Int8", {"data": 400}, "unknown-message-field", "exceeds specified width [int8]"),
        ("geometry_msgs/PoseStamped", {"pose": {"position": {"x": "a"}}}, "unknown-message-field", ""),
        ("std_msgs/String", {"data": {"a": 1}}, "unknown-message-field", ""),
        ("nav2_msgs/action/NavigateToPose", {}, "no-ros1-action", "an action needs ROS 2"),
    ],
)
def test_content_that_does_not_fit_its_type_is_an_error(
    kind: str, content: dict[str, Any], code: str, says: str
) -> None:
    with pytest.raises(ModelError) as caught:
        check(kind, content)
    assert (caught.value.code, says in str(caught.value)) == (code, True)


def test_types_of_both_generations_and_of_a_kobuki_are_known() -> None:
    check("std_msgs/msg/Empty", {})
    check("kobuki_msgs/BumperEvent", {"state": 1})
    check("geometry_msgs/PoseStamped", {"header": {"frame_id": "map"}, "pose": {"position": {"x": 1}}})
