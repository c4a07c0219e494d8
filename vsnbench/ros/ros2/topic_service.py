"""A service over two topics of std_msgs/String, whose type every ROS 2 installation has.

The client repeats a request until it receives the answer: a lost message costs a tenth of a second, and the server
notices within GONE_S that the client is gone. A repeated request is executed once.
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
    from vsnbench.ros.ros2.node import Ros2Node

logger = logging.getLogger(__name__)

GONE_S = 0.6
"""A client that has not repeated its request for this long is gone."""
ANSWER_S = 2.0
"""Time for an answer after the deadline of a movement."""
_REPEAT_S = 0.1
_MAX_LENGTH = 20_000
_REMEMBERED = 64
_MAX_CONCURRENT = 16
"""Number of requests executed at a time; others are accepted when they are repeated."""

Handler = Callable[[Mapping[str, Any], Callable[[], bool]], Mapping[str, Any]]
"""Executes a request in its own thread: takes the request and `caller_gone`, and returns the answer."""


class TopicServiceClient:
    """Calls one service; one call at a time."""

    def __init__(self, node: "Ros2Node", name: str) -> None:
        self.name = name
        self._id = uuid.uuid4().hex
        self._number = 0
        self._changed = threading.Condition()
        self._answer: Mapping[str, Any] | None = None
        self._publish = node.text_publisher(f"{name}/question")
        node.subscribe_text(f"{name}/answer", self._on_answer)

    def call(
        self, request: Mapping[str, Any], timeout_s: float, watch: Callable[[], None] | None = None
    ) -> Mapping[str, Any]:
        """Send a request and return the answer.

        Args:
            request: JSON object.
            timeout_s: longest duration of the call.
            watch: called while waiting; its exceptions end the call.

        Raises:
            NoAnswerError: no answer in time.
        """
        with self._changed:
            self._number += 1
            self._answer = None
        text = json.dumps({"asker": self._id, "number": self._number, "question": dict(request)})
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
                raise NoAnswerError(
                    f"{self.name} has not answered for {timeout_s:.1f} s", advice="check that its node is alive"
                )

    def _on_answer(self, text: str) -> None:
        message = _read(text)
        with self._changed:
            if message.get("asker") == self._id and message.get("number") == self._number:
                answer = message.get("answer")
                self._answer = answer if isinstance(answer, dict) else {}
                self._changed.notify_all()


class TopicServiceServer:
    """Offers one service; executes each request in its own thread."""

    def __init__(self, node: "Ros2Node", name: str, handler: Handler) -> None:
        self._handler = handler
        self._lock = threading.Lock()
        self._repeated_s: dict[tuple[str, int], float] = {}
        """Time of the last repetition by request."""
        self._done: dict[tuple[str, int], str] = {}
        self._publish = node.text_publisher(f"{name}/answer")
        node.subscribe_text(f"{name}/question", self._on_request)

    def _on_request(self, text: str) -> None:
        message = _read(text)
        client, number, request = message.get("asker"), message.get("number"), message.get("question")
        if not (isinstance(client, str) and isinstance(number, int) and isinstance(request, dict)):
            logger.warning("ignored an invalid request: %.80s", text)
            return
        key = (client[:64], number)
        with self._lock:
            known = key in self._repeated_s
            if not known and len(self._repeated_s) - len(self._done) >= _MAX_CONCURRENT:
                logger.warning("ignored a request: %d others are being executed", _MAX_CONCURRENT)
                return
            self._repeated_s[key] = time.monotonic()
            done = self._done.get(key)
        if done is not None:
            self._publish(done)
        elif not known:
            threading.Thread(target=self._execute, args=(key, request), daemon=True).start()

    def _execute(self, key: tuple[str, int], request: Mapping[str, Any]) -> None:
        def gone() -> bool:
            with self._lock:
                return time.monotonic() - self._repeated_s[key] > GONE_S

        try:
            answer = self._handler(request, gone)
        except BaseException:
            with self._lock:
                self._repeated_s.pop(key, None)
            raise
        text = json.dumps({"asker": key[0], "number": key[1], "answer": dict(answer)})
        with self._lock:
            self._done[key] = text
            while len(self._done) > _REMEMBERED:
                oldest = next(iter(self._done))
                del self._done[oldest]
                self._repeated_s.pop(oldest, None)
        self._publish(text)


def _read(text: str) -> dict[str, Any]:
    """Return the JSON object in a message, or an empty dict if it is invalid."""
    if len(text) > _MAX_LENGTH:
        return {}
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return message if isinstance(message, dict) else {}
