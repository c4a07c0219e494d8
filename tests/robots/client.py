"""A RosRobot in another process, over ROS 1 or ROS 2; its errors are raised here."""

import json
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from tests.processes import Conversation, ProcessGroup

NODE = Path(__file__).parents[1] / "ros" / "ros1" / "nodes" / "client.py"


class ClientError(Exception):
    """An error of the robot in the client's process."""

    def __init__(self, message: str, code: str, end_reason: str) -> None:
        super().__init__(message)
        self.code = code
        self.end_reason = end_reason
        """Reason for which an episode ends with this error."""


class Client(Conversation):
    """Calls the methods of a robot."""

    _asking = False
    """Whether a request has no answer: it is in flight, or its test gave it up."""

    def __init__(
        self, network: ProcessGroup, python: tuple[str, ...], profile: Path, patience_s: float, **environment: str
    ) -> None:
        log = network.directory / "client.log"
        self._errors = log.open("ab")
        words = [*python, str(NODE), str(profile), str(patience_s)]
        super().__init__(words, network.environment | environment, self._errors)
        if self.line().strip() != '"ready"':
            self.close()
            raise AssertionError(log.read_text())

    @property
    def is_ready(self) -> bool:
        """Whether the process runs and has answered every request."""
        return self.popen.poll() is None and not self._asking

    def __call__(self, name: str, *arguments: Any) -> Any:
        self._asking = True
        answer = json.loads(self.tell(json.dumps([name, *arguments])))
        self._asking = False
        if "error" in answer:
            raise ClientError(f"{answer['error']}: {answer['message']}", answer["code"], answer["end_reason"])
        return answer["answer"]

    def later(self, name: str, *arguments: Any) -> "Future[Any]":
        pool = ThreadPoolExecutor(1)
        future = pool.submit(self, name, *arguments)
        pool.shutdown(wait=False)
        return future

    def close(self) -> None:
        super().close()
        self._errors.close()


def can(action: Callable[[], object]) -> bool:
    """Return whether a call succeeds."""
    return not error_code(action)


def error_code(action: Callable[[], object]) -> str:
    """Return the code of the error of a call, or an empty string."""
    try:
        action()
    except ClientError as error:
        return error.code
    return ""
