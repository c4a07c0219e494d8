"""Messages and actions between a stack and vsnbench: two nodes of one process on a real graph."""

import threading
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from tests.processes import wait_until
from tests.ros.ros2.graph import Domain
from vsnbench.errors import ModelError, ModelLostError

pytestmark = pytest.mark.ros2

BOOL = "std_msgs/msg/Bool"


@pytest.fixture(scope="module")
def nodes() -> Iterator[SimpleNamespace]:
    """Our exchange, and the node of a stack."""
    from vsnbench.ros.ros2.exchange import Ros2Exchange
    from vsnbench.ros.ros2.graph import Graph
    from vsnbench.ros.ros2.node import Ros2Node

    domain = Domain()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(domain.number))
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        ours, theirs = Ros2Node("vsnbench_1", "/robot1"), Ros2Node("their_stack")
        others: list[Ros2Node] = []

        def another(name: str) -> Ros2Node:
            others.append(Ros2Node(name))
            return others[-1]

        yield SimpleNamespace(ours=Ros2Exchange(ours, Graph(ours)), node=ours, theirs=theirs, another=another)
    for node in (*others, theirs, ours):
        node.close()
    domain.close()


def test_a_message_reaches_the_node_that_takes_it(nodes: SimpleNamespace) -> None:
    taken: list[str] = []
    nodes.theirs.subscribe_text("/robot1/goal", taken.append)
    nodes.ours.publish("goal", "std_msgs/String", {"data": "chair"}, 20.0)
    wait_until(lambda: taken == ["chair"], "the goal is taken")
    with pytest.raises(ModelError) as caught:
        nodes.ours.publish("goal", BOOL, {}, 0.3)
    assert caught.value.code == "wrong-topic-type"
    with pytest.raises(ModelLostError, match=r"no node subscribes to /nowhere \(std_msgs/msg/String\)"):
        nodes.ours.publish("/nowhere", "std_msgs/String", {}, 0.3)


@pytest.mark.parametrize("is_lossy", [False, True], ids=["reliable", "best-effort"])
def test_messages_of_a_node_are_heard_whatever_its_quality(nodes: SimpleNamespace, is_lossy: bool) -> None:
    from std_msgs.msg import Bool

    from vsnbench.ros.ros2.node import RELIABLE, SENSOR_DATA

    topic = f"/arrived_{is_lossy}".lower()
    publisher = nodes.theirs.rclpy.create_publisher(Bool, topic, SENSOR_DATA if is_lossy else RELIABLE)
    nodes.ours.await_publisher(topic, BOOL, 20.0)
    heard: list[Any] = []
    nodes.ours.listen(topic, BOOL, heard.append)
    wait_until(lambda: publisher.get_subscription_count() == 1, "it is subscribed to")
    publisher.publish(Bool(data=True))
    wait_until(lambda: [message.data for message in heard] == [True], "it is heard")
    with pytest.raises(ModelError) as caught:
        nodes.ours.await_publisher(topic, "std_msgs/Int8", 0.3)
    assert caught.value.code == "wrong-topic-type"
    with pytest.raises(ModelLostError, match="no node publishes /silent"):
        nodes.ours.await_publisher("/silent", BOOL, 0.3)


def test_an_action_succeeds_aborts_is_refused_or_canceled(nodes: SimpleNamespace) -> None:
    from rclpy.action import ActionServer, CancelResponse, GoalResponse
    from test_msgs.action import Fibonacci

    kind, cancelled = "test_msgs/action/Fibonacci", []

    async def execute(handle: Any) -> Any:
        while handle.request.order == 3 and not handle.is_cancel_requested:
            await _pause(nodes.theirs.rclpy)
        {1: handle.succeed, 2: handle.abort, 3: handle.canceled}[handle.request.order]()
        return Fibonacci.Result()

    def cancel(_: Any) -> Any:
        cancelled.append(1)
        return CancelResponse.ACCEPT

    server = ActionServer(
        nodes.theirs.rclpy,
        Fibonacci,
        "/navigate",
        execute,
        goal_callback=lambda goal: GoalResponse.REJECT if goal.order == 0 else GoalResponse.ACCEPT,
        cancel_callback=cancel,
    )
    for order, outcome in ((1, "succeeded"), (2, "aborted"), (0, "refused")):
        goal = nodes.ours.send_goal("/navigate", kind, {"order": order}, 20.0)
        wait_until(lambda goal=goal, outcome=outcome: goal.outcome == outcome, f"it has {outcome}")
        goal.cancel(1.0)  # has ended
    assert not cancelled
    goal = nodes.ours.send_goal("/navigate", kind, {"order": 3}, 20.0)
    goal.cancel(20.0)
    wait_until(lambda: goal.outcome == "canceled", "it is canceled")
    with pytest.raises(ModelLostError, match="no node offers the action /other"):
        nodes.ours.send_goal("/other", kind, {}, 0.3)
    server.destroy()


def test_a_goal_that_is_accepted_too_late_is_canceled(nodes: SimpleNamespace) -> None:
    from rclpy.action import ActionServer, CancelResponse, GoalResponse
    from rclpy.callback_groups import ReentrantCallbackGroup
    from test_msgs.action import Fibonacci

    accepts, cancelled = threading.Event(), threading.Event()

    def accept(_: Any) -> Any:
        accepts.wait(60)
        return GoalResponse.ACCEPT

    def cancel(_: Any) -> Any:
        cancelled.set()
        return CancelResponse.ACCEPT

    async def execute(handle: Any) -> Any:
        while not handle.is_cancel_requested:
            await _pause(server_node.rclpy)
        handle.canceled()
        return Fibonacci.Result()

    server_node = nodes.another("late_stack")
    server = ActionServer(
        server_node.rclpy,
        Fibonacci,
        "/late",
        execute,
        goal_callback=accept,
        cancel_callback=cancel,
        callback_group=ReentrantCallbackGroup(),
    )
    client = nodes.node.action_client(Fibonacci, "/late")
    assert client.wait_for_server(60.0), "discovery may take longer than the limit"
    began_s = time.monotonic()
    with pytest.raises(ModelLostError, match="the action /late does not answer within 2 s"):
        nodes.ours.send_goal("/late", "test_msgs/action/Fibonacci", {"order": 1}, 2.0)
    assert time.monotonic() - began_s < 30
    assert not cancelled.is_set()
    accepts.set()
    assert cancelled.wait(60), "nobody would stop the stack"
    server.destroy()


async def _pause(node: Any) -> None:
    from rclpy.task import Future

    future = Future()
    timer = node.create_timer(0.02, lambda: future.set_result(None))
    await future
    timer.cancel()


@pytest.mark.parametrize(
    ("kind", "content", "code", "says"),
    [
        ("their_msgs/msg/Goal", {}, "unknown-message-type", "their_msgs/msg/Goal is not installed here"),
        ("std_msgs/msg/Goal", {}, "unknown-message-type", "std_msgs/msg/Goal is not installed here"),
        (BOOL, {"dat": True}, "unknown-message-field", "no field dat; it has data"),
        (BOOL, {"data": 1}, "unknown-message-field", "data is a boolean: got 1"),
        ("std_msgs/Int8", {"data": 400}, "unknown-message-field", "data is a int8"),
        ("geometry_msgs/PoseStamped", {"pose": 1}, "unknown-message-field", "pose is a geometry_msgs/Pose"),
        ("geometry_msgs/PoseStamped", {"pose": {"position": {"x": "a"}}}, "unknown-message-field", "pose.position.x"),
        ("std_msgs/String", {"data": {"a": 1}}, "unknown-message-field", "data is a string"),
    ],
)
def test_content_that_does_not_fit_its_type_is_an_error(
    nodes: SimpleNamespace, kind: str, content: dict[str, Any], code: str, says: str
) -> None:
    with pytest.raises(ModelError) as caught:
        nodes.ours.check(kind, content)
    assert (caught.value.code, says in str(caught.value)) == (code, True)


def test_whole_numbers_are_taken_where_a_field_has_a_fraction(nodes: SimpleNamespace) -> None:
    nodes.ours.check("geometry_msgs/PoseStamped", {"header": {"frame_id": "map"}, "pose": {"position": {"x": 1}}})


def test_an_action_client_is_made_in_the_thread_that_spins(
    nodes: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rclpy.action import ActionClient
    from test_msgs.action import Fibonacci

    from vsnbench.ros.ros2 import node

    threads: list[threading.Thread] = []

    class Recording(ActionClient):
        def __init__(self, *arguments: Any) -> None:
            threads.append(threading.current_thread())
            super().__init__(*arguments)

    monkeypatch.setattr(node, "ActionClient", Recording)
    nodes.node.action_client(Fibonacci, "/recorded")
    assert [thread.name for thread in threads] == ["ros2 vsnbench_1"]
    with pytest.raises(Exception, match="invalid"):
        nodes.node.action_client(Fibonacci, "not a name")
    assert threads[0].is_alive(), "what was wrong is raised to the caller"
