"""Queries of the ROS master with a deadline, so that a hanging master cannot block the caller."""

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

    code = "no-ros-master"


class _DeadlineTransport(xmlrpc.client.Transport):
    """HTTP with a timeout on every socket operation."""

    def __init__(self, timeout_s: float) -> None:
        super().__init__()
        self._timeout_s = timeout_s

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = self._timeout_s
        return connection


def call_xmlrpc(uri: str, method: str, *arguments: str, timeout_s: float = DEFAULT_TIMEOUT_S) -> Any:
    """Call a method of a ROS master or node and return the value of its answer.

    Raises:
        OSError: the server cannot be reached in time, or its answer does not follow the protocol.
        LookupError: the server answers with an error.
    """
    with xmlrpc.client.ServerProxy(uri, transport=_DeadlineTransport(timeout_s)) as proxy:
        try:
            code, message, value = getattr(proxy, method)(*arguments)
        except (http.client.HTTPException, xmlrpc.client.Error, ExpatError, ValueError, TypeError) as error:
            raise OSError(f"{uri} does not follow the ROS protocol: {type(error).__name__}: {error}") from error
    if code != 1:
        raise LookupError(str(message))
    return value


@dataclass(frozen=True, slots=True)
class SystemState:
    """Nodes by the topic that they publish or subscribe to, and by the service that they offer."""

    publishers: dict[str, list[str]]
    subscribers: dict[str, list[str]]
    services: dict[str, list[str]]


@dataclass(frozen=True, slots=True)
class Master:
    """The master of a ROS network; every query has a deadline."""

    uri: str
    caller: str = "/vsnbench_probe"
    timeout_s: float = DEFAULT_TIMEOUT_S

    @classmethod
    def from_environment(cls) -> "Master":
        """Return the master of ROS_MASTER_URI, without contacting it.

        Raises:
            MasterError: the variable is unset, or is not an http URI with host and port.
        """
        uri = os.environ.get("ROS_MASTER_URI", "")
        if not uri:
            raise MasterError(
                "ROS_MASTER_URI is not set",
                advice="export ROS_MASTER_URI=http://ROBOT_HOST:11311 (docs/robot.md)",
            )
        parts = urlparse(uri)
        try:
            complete = parts.scheme == "http" and parts.hostname and parts.port
        except ValueError:
            complete = False
        if not complete:
            raise MasterError(f"ROS_MASTER_URI is {uri!r}, not http://HOST:PORT")
        return cls(uri)

    def ask(self, method: str, *arguments: str) -> Any:
        """Call a method of the master API.

        Raises:
            MasterError: the master does not answer in time.
            LookupError: the master answers with an error.
        """
        try:
            return call_xmlrpc(self.uri, method, self.caller, *arguments, timeout_s=self.timeout_s)
        except OSError as error:
            raise MasterError(
                f"no ROS master answers at {self.uri} ({error})",
                advice="start roscore there, or correct ROS_MASTER_URI",
            ) from error

    def pid(self) -> int:
        """Return the process id of the master."""
        return int(self.ask("getPid"))

    def state(self) -> SystemState:
        """Return the registrations of all nodes."""
        publishers, subscribers, services = (dict(part) for part in self.ask("getSystemState"))
        return SystemState(publishers, subscribers, services)

    def topic_types(self) -> dict[str, str]:
        """Return the message type of every topic."""
        return dict(self.ask("getTopicTypes"))

    def service_uri(self, name: str) -> str:
        """Return the URI of a service, `rosrpc://host:port`.

        Raises:
            LookupError: no node offers it.
        """
        return str(self.ask("lookupService", name))

    def live_node(self, name: str) -> str | None:
        """Return the URI of a node, or None if it is not registered or does not answer.

        The master keeps the registration of a killed node, and another process may have its port now: it is the node
        only if it publishes what the master has of it.
        """
        try:
            uri = str(self.ask("lookupNode", name))
            found = call_xmlrpc(uri, "getPublications", self.caller, timeout_s=self.timeout_s)
            topics = {str(topic) for topic, *_ in found}
        except (LookupError, OSError, TypeError, ValueError):
            return None
        registered = {topic for topic, nodes in self.state().publishers.items() if name in nodes}
        return uri if registered <= topics else None

    def wait(self, patience_s: float, pause_s: float = 0.25) -> None:
        """Wait until the master answers.

        Raises:
            MasterError: the master does not answer within `patience_s`.
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
