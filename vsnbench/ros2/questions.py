"""Questions and answers over two topics of std_msgs/String, with types that every ROS 2 has.

A question is repeated until its answer comes, so that a lost message costs a tenth of a second, and so that whoever
works on the answer notices within GONE_S that nobody waits for it any more. A repeated question is not done twice.
"""

import json
import logging
import threading
import time
import uuid
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from vsnbench.errors import NoAnswerError

if TYPE_CHECKING:
    from vsnbench.ros2.node import Ros2Node

logger = logging.getLogger(__name__)

GONE_S = 0.6
"""Whoever has not repeated a question for this long does not wait for its answer."""
_REPEAT_S = 0.1
_LONGEST = 20_000
_REMEMBERED = 64
_MOST_AT_ONCE = 16
"""Questions that are worked on; who repeats one is heard when others are done."""

Answer = Callable[[Mapping[str, Any], Callable[[], bool]], Mapping[str, Any]]
"""What works on a question: it gets the question and `asker_gone`, in a thread of its own, and returns the answer."""


class Asker:
    """Asks under one name; one question at a time."""

    def __init__(self, node: "Ros2Node", name: str) -> None:
        self.name = name
        self._me = uuid.uuid4().hex
        self._number = 0
        self._changed = threading.Condition()
        self._answer: Mapping[str, Any] | None = None
        self._publish = node.text_publisher(f"{name}/question")
        node.listen_to_texts(f"{name}/answer", self._on_answer)

    def ask(
        self, question: Mapping[str, Any], timeout_s: float, watch: Callable[[], None] | None = None
    ) -> Mapping[str, Any]:
        """Ask and return the answer; `watch` is called all the while and may raise to give up.

        Raises:
            NoAnswerError: none came in time.
        """
        with self._changed:
            self._number += 1
            self._answer = None
        text = json.dumps({"asker": self._me, "number": self._number, "question": dict(question)})
        give_up_s = time.monotonic() + timeout_s
        repeat_s = 0.0
        while True:
            if time.monotonic() >= repeat_s:
                self._publish(text)
                repeat_s = time.monotonic() + _REPEAT_S
            with self._changed:
                if self._changed.wait_for(lambda: self._answer is not None, 0.02) and self._answer is not None:
                    return self._answer
            if watch is not None:
                watch()
            if time.monotonic() > give_up_s:
                raise NoAnswerError(f"{self.name} has not answered for {timeout_s:.1f} s", advice="is its node alive?")

    def _on_answer(self, text: str) -> None:
        said = _read(text)
        with self._changed:
            if said.get("asker") == self._me and said.get("number") == self._number:
                answer = said.get("answer")
                self._answer = answer if isinstance(answer, dict) else {}
                self._changed.notify_all()


class Answerer:
    """Answers under one name; each question is worked on in a thread of its own."""

    def __init__(self, node: "Ros2Node", name: str, answer: Answer) -> None:
        self._work = answer
        self._lock = threading.Lock()
        self._heard_s: dict[tuple[str, int], float] = {}
        self._done: dict[tuple[str, int], str] = {}
        self._publish = node.text_publisher(f"{name}/answer")
        node.listen_to_texts(f"{name}/question", self._on_question)

    def _on_question(self, text: str) -> None:
        said = _read(text)
        asker, number, question = said.get("asker"), said.get("number"), said.get("question")
        if not (isinstance(asker, str) and isinstance(number, int) and isinstance(question, dict)):
            logger.warning("a question that is none: %.80s", text)
            return
        key = (asker[:64], number)
        with self._lock:
            known = key in self._heard_s
            if not known and len(self._heard_s) - len(self._done) >= _MOST_AT_ONCE:
                logger.warning("more than %d questions at once: one is not heard", _MOST_AT_ONCE)
                return
            self._heard_s[key] = time.monotonic()
            done = self._done.get(key)
        if done is not None:
            self._publish(done)
        elif not known:
            threading.Thread(target=self._answer, args=(key, question), daemon=True).start()

    def _answer(self, key: tuple[str, int], question: Mapping[str, Any]) -> None:
        def gone() -> bool:
            with self._lock:
                return time.monotonic() - self._heard_s[key] > GONE_S

        try:
            answer = self._work(question, gone)
        except BaseException:
            with self._lock:
                self._heard_s.pop(key, None)
            raise
        text = json.dumps({"asker": key[0], "number": key[1], "answer": dict(answer)})
        with self._lock:
            self._done[key] = text
            while len(self._done) > _REMEMBERED:
                oldest = next(iter(self._done))
                del self._done[oldest]
                self._heard_s.pop(oldest, None)
        self._publish(text)


def _read(text: str) -> dict[str, Any]:
    """Return a JSON object that somebody sent; empty where it is none."""
    if len(text) > _LONGEST:
        return {}
    try:
        said = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return said if isinstance(said, dict) else {}
