"""A repeated request is executed once, and the server notices that a client stopped repeating it."""

import json
import threading

import pytest

from tests.processes import wait_until
from tests.ros.ros2.wire import Wire
from vsnbench.errors import NoAnswerError
from vsnbench.ros.ros2.topic_service import TopicServiceClient, TopicServiceServer


def test_a_lost_request_is_repeated_and_executed_once() -> None:
    wire, done = Wire(lost=3), []
    TopicServiceServer(wire, "/move", lambda question, _gone: done.append(question) or {"ok": len(done)})
    assert TopicServiceClient(wire, "/move").call({"movement": "Left"}, 30.0) == {"ok": 1}
    question = next(text for topic, text in wire.sent if topic == "/move/question")
    wire.text_publisher("/move/question")(question)
    assert done == [{"movement": "Left"}]
    assert len([topic for topic, _ in wire.sent if topic == "/move/answer"]) >= 2


def test_a_missing_server_is_an_error_in_time_unless_the_watch_ends_the_call() -> None:
    client = TopicServiceClient(Wire(), "/move")
    with pytest.raises(NoAnswerError):
        client.call({}, 0.1)

    def watch() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        client.call({}, 30.0, watch)


def test_the_handler_sees_that_the_client_is_gone() -> None:
    wire, gone = Wire(), threading.Event()

    def work(_question, caller_gone):
        wait_until(caller_gone, "the client is missed")
        gone.set()
        return {}

    TopicServiceServer(wire, "/move", work)
    with pytest.raises(NoAnswerError):
        TopicServiceClient(wire, "/move").call({}, 0.1)
    assert gone.wait(30.0)


def test_invalid_requests_are_ignored_and_concurrent_ones_are_limited() -> None:
    wire, begun, end = Wire(), [], threading.Event()
    TopicServiceServer(wire, "/move", lambda _question, _gone: begun.append(1) or {"ended": end.wait(30.0)})
    ask = wire.text_publisher("/move/question")
    for text in ("", "[]", "{", "[" * 9000, '{"asker": 1}', json.dumps({"asker": "a", "number": 1, "question": []})):
        ask(text)
    for number in range(40):
        ask(json.dumps({"asker": "a", "number": number, "question": {}}))
    wait_until(lambda: len(begun) == 16, "sixteen are executed")
    end.set()
    wait_until(lambda: len([1 for topic, _ in wire.sent if topic == "/move/answer"]) == 16, "they are answered")
    assert len(begun) == 16
