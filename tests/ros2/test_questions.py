"""A question is answered once however often it is heard, and missed once nobody repeats it."""

import json
import threading

import pytest

from tests.processes import wait_until
from tests.ros2.wire import Wire
from vsnbench.errors import NoAnswerError
from vsnbench.ros2.questions import Answerer, Asker


def test_what_is_lost_is_asked_again_and_done_once() -> None:
    wire, done = Wire(lost=3), []
    Answerer(wire, "/move", lambda question, _gone: done.append(question) or {"ok": len(done)})
    assert Asker(wire, "/move").ask({"movement": "Left"}, 30.0) == {"ok": 1}
    question = next(text for topic, text in wire.sent if topic == "/move/question")
    wire.text_publisher("/move/question")(question)
    assert done == [{"movement": "Left"}]
    assert len([topic for topic, _ in wire.sent if topic == "/move/answer"]) >= 2


def test_nobody_there_is_said_in_time_and_a_watch_may_give_up_before() -> None:
    asker = Asker(Wire(), "/move")
    with pytest.raises(NoAnswerError, match=r"/move has not answered for 0\.1 s"):
        asker.ask({}, 0.1)

    def watch() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        asker.ask({}, 30.0, watch)


def test_whoever_works_on_it_sees_that_nobody_waits_any_more() -> None:
    wire, gone = Wire(), threading.Event()

    def work(_question, asker_gone):
        wait_until(asker_gone, "the asker is missed")
        gone.set()
        return {}

    Answerer(wire, "/move", work)
    with pytest.raises(NoAnswerError):
        Asker(wire, "/move").ask({}, 0.1)
    assert gone.wait(30.0)


def test_texts_that_are_no_questions_are_left_alone_and_many_at_once_are_bounded() -> None:
    wire, begun, end = Wire(), [], threading.Event()
    Answerer(wire, "/move", lambda _question, _gone: begun.append(1) or {"ended": end.wait(30.0)})
    ask = wire.text_publisher("/move/question")
    for text in ("", "[]", "{", "[" * 9000, '{"asker": 1}', json.dumps({"asker": "a", "number": 1, "question": []})):
        ask(text)
    for number in range(40):
        ask(json.dumps({"asker": "a", "number": number, "question": {}}))
    wait_until(lambda: len(begun) == 16, "sixteen are worked on")
    end.set()
    wait_until(lambda: len([1 for topic, _ in wire.sent if topic == "/move/answer"]) == 16, "they are answered")
    assert len(begun) == 16
