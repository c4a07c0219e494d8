"""A RosRobot in a process of its own, whichever ROS it speaks: asked by name, and what it raises is raised here."""

import json
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from tests.processes import Conversation, ProcessGroup

NODE = Path(__file__).parents[1] / "ros1" / "nodes" / "client.py"


class ClientError(Exception):
    """What the robot raised in the client's process."""


class Client(Conversation):
    """Calls the methods of a robot."""

    def __init__(
        self, network: ProcessGroup, python: tuple[str, ...], profile: Path, patience_s: float, **environment: str
    ) -> None:
        log = network.directory / "client.log"
        self._errors = log.open("ab")
        words = [*python, str(NODE), str(profile), str(patience_s)]
        super().__init__(words, network.environment | environment, self._errors)
        assert self.line().strip() == '"ready"', log.read_text()

    def __call__(self, name: str, *arguments: Any) -> Any:
        answer = json.loads(self.tell(json.dumps([name, *arguments])))
        if "error" in answer:
            raise ClientError(f"{answer['error']}: {answer['message']}")
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
    """Return whether a call goes without an error."""
    return not complaint(action)


def complaint(action: Callable[[], object]) -> str:
    """Return what a call raised; empty for nothing."""
    try:
        action()
    except ClientError as error:
        return str(error)
    return ""
