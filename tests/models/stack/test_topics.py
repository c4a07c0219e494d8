"""A stack's arrival on a topic, and the content that it is told."""

import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from vsnbench.errors import ModelError
from vsnbench.models.stack.file import FromTopic, Stack, ToTopic, load_stack
from vsnbench.models.stack.policy import StackPolicy
from vsnbench.models.stack.topics import ArrivalTopic
from vsnbench.sensing.exchange import Exchange, value_at


class OneProcess(Exchange):
    """Topics within this process."""

    def __init__(self) -> None:
        self.takers: list[Callable[[Any], None]] = []

    def check(self, kind: str, content: Mapping[str, Any]) -> None:
        if "Unknown" in kind:
            raise ModelError(f"{kind} is not installed", code="unknown-message-type")
        if content.keys() - {"data"}:
            raise ModelError("no such field", code="unknown-message-field")

    def publish(self, topic: str, kind: str, content: Mapping[str, Any], timeout_s: float) -> None:
        for take in self.takers:
            take(SimpleNamespace(**content))

    def listen(self, topic: str, kind: str, take: Callable[[Any], None]) -> None:
        self.takers.append(take)

    def await_publisher(self, topic: str, kind: str, timeout_s: float) -> None:
        pass

    def say(self, value: Any) -> None:
        self.publish("", "", {"data": value}, 0.0)


def arrival(**fields: Any) -> tuple[OneProcess, ArrivalTopic]:
    network = OneProcess()
    topic = ArrivalTopic(network, FromTopic(name="/arrived", type="std_msgs/Bool", **fields))
    topic.begin(1.0)
    return network, topic


def test_a_value_of_a_topic_is_the_arrival_or_the_failure() -> None:
    network, topic = arrival(equals="there", failed="lost")
    network.say("driving")
    assert not topic.has_arrived
    network.say("there")
    network.say("lost")  # of the next goal
    assert topic.has_arrived
    topic.begin(1.0)
    network.say("lost")
    with pytest.raises(ModelError, match="says that it failed: /arrived lost"):
        topic.has_arrived  # noqa: B018


def test_the_state_of_the_trial_before_counts_once_it_has_changed() -> None:
    network, topic = arrival()
    network.say(True)
    assert topic.has_arrived
    ended = threading.Event()

    def repeat() -> None:
        while not ended.is_set():
            network.say(True)
            time.sleep(0.05)

    thread = threading.Thread(target=repeat)
    thread.start()
    topic.begin(1.0)
    ended.set()
    thread.join()
    network.say(True)
    assert not topic.has_arrived
    network.say(False)
    network.say(True)
    assert topic.has_arrived


def test_an_arrival_that_is_said_once_counts_in_each_trial() -> None:
    network, topic = arrival()
    for _ in range(2):
        network.say(True)
        assert topic.has_arrived
        topic.begin(1.0)
        assert not topic.has_arrived


def test_a_field_that_messages_do_not_have_is_an_error() -> None:
    network, topic = arrival(field="status.status")
    network.say(3)
    with pytest.raises(ModelError, match=r"no field status of status\.status"):
        topic.has_arrived  # noqa: B018
    assert value_at(SimpleNamespace(list=[SimpleNamespace(status=3)]), "list.0.status") == 3


def test_content_has_the_goal_and_the_fields_of_its_category() -> None:
    message = ToTopic.model_validate(
        {
            "name": "goal_pose",
            "type": "geometry_msgs/PoseStamped",
            "content": {"header": {"frame_id": "map"}, "words": ["find {goal}"]},
            "by_goal": {"chair": {"header": {"seq": 2}, "pose": {"position": {"x": 1.5}}}},
        }
    )
    assert message.content_for("red chair", "chair") == {
        "header": {"frame_id": "map", "seq": 2},
        "words": ["find red chair"],
        "pose": {"position": {"x": 1.5}},
    }
    with pytest.raises(ModelError, match="no content of goal_pose for bed: it has chair"):
        message.content_for("bed", "bed")


def stack_with(tmp_path: Path, ways: str) -> Path:
    file = tmp_path / "stack.yaml"
    file.write_text(f'name: theirs\nversion: "1"\n{ways}\n')
    return file


@pytest.mark.parametrize(
    ("ways", "says"),
    [
        ("announce: {topic: {name: a b, type: std_msgs/String}}\narrived: {rest_s: 3}", "announce.topic.name"),
        ("announce: {topic: {name: /a, type: String}}\narrived: {rest_s: 3}", "announce.topic.type"),
        ("announce: {action: {name: /a, type: std_msgs/String}}\narrived: {rest_s: 3}", "announce.action.type"),
        ("announce: {operator: go}\narrived: {action: true}", "there is none"),
        (
            "announce: {operator: go}\narrived: {topic: {name: /a, type: std_msgs/Int8, equals: 1, failed: 1}}",
            "`equals` and `failed` are both 1",
        ),
    ],
)
def test_a_topic_or_action_that_cannot_be_is_an_error_with_its_field(tmp_path: Path, ways: str, says: str) -> None:
    with pytest.raises(ModelError) as caught:
        load_stack(stack_with(tmp_path, ways))
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("ways", "code"),
    [
        (
            "announce: {topic: {name: /a, type: std_msgs/Unknown}}\narrived: {rest_s: 3}",
            "unknown-message-type",
        ),
        (
            "announce: {operator: go}\narrived: {topic: {name: /a, type: their_msgs/Unknown}}",
            "unknown-message-type",
        ),
        (
            "announce: {topic: {name: /a, type: std_msgs/String, by_goal: {bed: {word: x}}}}\narrived: {rest_s: 3}",
            "unknown-message-field",
        ),
    ],
)
def test_types_and_fields_are_checked_before_the_first_trial(tmp_path: Path, ways: str, code: str) -> None:
    policy = StackPolicy(stack_with(tmp_path, ways))
    with pytest.raises(ModelError) as caught:
        policy.join(OneProcess())
    assert caught.value.code == code


def test_a_stack_knows_the_goals_that_it_has_messages_for(tmp_path: Path) -> None:
    ways = "announce: {topic: {name: /a, type: std_msgs/String, by_goal: {bed: {data: x}}}}\narrived: {rest_s: 3}"
    assert StackPolicy(stack_with(tmp_path, ways)).card.goals == frozenset({"bed"})
    assert isinstance(load_stack(stack_with(tmp_path, ways)), Stack)
