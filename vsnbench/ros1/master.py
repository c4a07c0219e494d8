"""The ROS master, asked with a deadline: plain XML-RPC, so that a dead or wedged master cannot block anybody."""

import http.client
import os
import time
import xmlrpc.client
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlparse
from xml.parsers.expat import ExpatError

from vsnbench.errors import NoAnswerError

DEFAULT_TIMEOUT_S = 2.0


class MasterError(NoAnswerError):
    """The ROS master does not answer, or ROS_MASTER_URI is wrong."""


class _DeadlineTransport(xmlrpc.client.Transport):
    """HTTP whose every socket operation ends in time."""

    def __init__(self, timeout_s: float) -> None:
        super().__init__()
        self._timeout_s = timeout_s

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = self._timeout_s
        return connection


def call_xmlrpc(uri: str, method: str, *arguments: str, timeout_s: float = DEFAULT_TIMEOUT_S) -> Any:
    """Call `method` of a ROS master or node and return the third part of its answer.

    Raises:
        OSError: it cannot be reached in time.
        LookupError: it answers that it does not know.
    """
    with xmlrpc.client.ServerProxy(uri, transport=_DeadlineTransport(timeout_s)) as proxy:
        try:
            code, message, value = getattr(proxy, method)(*arguments)
        except (http.client.HTTPException, xmlrpc.client.Error, ExpatError, ValueError, TypeError) as error:
            raise OSError(f"{uri} does not speak ROS: {type(error).__name__}: {error}") from error
    if code != 1:
        raise LookupError(str(message))
    return value


@dataclass(frozen=True, slots=True)
class SystemState:
    """Who publishes, subscribes to and serves what: name -> nodes."""

    publishers: dict[str, list[str]]
    subscribers: dict[str, list[str]]
    services: dict[str, list[str]]


@dataclass(frozen=True, slots=True)
class Master:
    """The master of a ROS network, by its URI; every question has a deadline."""

    uri: str
    caller: str = "/vsnbench_probe"
    timeout_s: float = DEFAULT_TIMEOUT_S

    @classmethod
    def from_environment(cls, timeout_s: float = DEFAULT_TIMEOUT_S) -> "Master":
        """Return the master that ROS_MASTER_URI names; it may not be there.

        Raises:
            MasterError: the variable is unset or no http URI with host and port.
        """
        uri = os.environ.get("ROS_MASTER_URI", "")
        if not uri:
            raise MasterError(
                "ROS_MASTER_URI is not set",
                advice="export ROS_MASTER_URI=http://<the robot's laptop>:11311 (docs/robot.md)",
            )
        parts = urlparse(uri)
        try:
            complete = parts.scheme == "http" and parts.hostname and parts.port
        except ValueError:
            complete = False
        if not complete:
            raise MasterError(f"ROS_MASTER_URI is {uri!r}, not http://<host>:<port>")
        return cls(uri, timeout_s=timeout_s)

    def ask(self, method: str, *arguments: str) -> Any:
        """Call a method of the master API.

        Raises:
            MasterError: no answer in time.
            LookupError: the master answers that it does not know.
        """
        try:
            return call_xmlrpc(self.uri, method, self.caller, *arguments, timeout_s=self.timeout_s)
        except OSError as error:
            raise MasterError(
                f"no ROS master answers at {self.uri} ({error})",
                advice="is roscore running there, and is ROS_MASTER_URI right?",
            ) from error

    def pid(self) -> int:
        """Return the master's process id: it is alive."""
        return int(self.ask("getPid"))

    def state(self) -> SystemState:
        """Return who publishes, subscribes to and serves what."""
        publishers, subscribers, services = (dict(part) for part in self.ask("getSystemState"))
        return SystemState(publishers, subscribers, services)

    def topic_types(self) -> dict[str, str]:
        """Return the type of every topic that somebody named one for."""
        return dict(self.ask("getTopicTypes"))

    def service_uri(self, name: str) -> str:
        """Return where a service is served, `rosrpc://host:port`.

        Raises:
            LookupError: nobody serves it.
        """
        return str(self.ask("lookupService", name))

    def live_node(self, name: str) -> str | None:
        """Return the URI of the node called `name` if it is registered and answers, else None."""
        try:
            uri = str(self.ask("lookupNode", name))
            call_xmlrpc(uri, "getPid", self.caller, timeout_s=self.timeout_s)
        except (LookupError, OSError):
            return None
        return uri

    def wait(self, patience_s: float, pause_s: float = 0.25) -> None:
        """Wait until the master answers.

        Raises:
            MasterError: it does not within `patience_s`.
        """
        give_up_s = time.monotonic() + patience_s
        while True:
            try:
                self.pid()
            except MasterError:
                if time.monotonic() >= give_up_s:
                    raise
                time.sleep(pause_s)
            else:
                return
