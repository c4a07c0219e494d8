"""ROS 1 service calls with a deadline.

A call of rospy waits for ever on a hanging server, so this client implements TCPROS: look up, connect, handshake, send,
wait. Every stage ends at the deadline of the call; all but the last have a shorter limit too.
"""

import select
import socket
import struct
import time
from collections.abc import Callable
from io import BytesIO
from typing import Any, Self
from urllib.parse import urlparse

from vsnbench.errors import NoAnswerError
from vsnbench.ros.ros1.master import Master

_STAGE_TIMEOUT_S = 2.0
"""Time limit of connection and handshake; only the answer may take as long as the motion."""
_WATCH_PERIOD_S = 0.05
_LARGEST_ANSWER = 1 << 20


TIMEOUT, UNAVAILABLE, REFUSED = "service-timeout", "service-unavailable", "service-refused"
"""Codes: the server did not answer in time; no node offers the service, or its server disappeared; the server refused
the call, because its type differs or its handler failed."""


class ServiceError(NoAnswerError):
    """A service call without an answer; its code says why."""

    code = "service"


class ServiceClient:
    """Calls one service; keeps its address, so that later calls need no master. Thread-safe."""

    def __init__(self, name: str, service_class: Any, master: Master) -> None:
        self.name = name
        self._class = service_class
        self._master = master
        self._address: tuple[str, int] | None = None

    def locate(self) -> tuple[str, int]:
        """Look the address of the service up and keep it.

        Raises:
            ServiceError: no node offers the service, or its host is unknown here.
            MasterError: the master does not answer.
        """
        try:
            uri = urlparse(self._master.service_uri(self.name))
            found = socket.getaddrinfo(uri.hostname, uri.port, type=socket.SOCK_STREAM)
        except LookupError as error:
            raise ServiceError(
                f"no node offers {self.name}", advice="start the node that offers it", code=UNAVAILABLE
            ) from error
        except (OSError, ValueError) as error:
            raise ServiceError(
                f"{self.name} is offered at {uri.geturl()}, whose host name cannot be resolved here ({error})",
                advice="set ROS_IP or ROS_HOSTNAME on the robot (docs/robot.md)",
                code=UNAVAILABLE,
            ) from error
        self._address = (str(found[0][4][0]), int(found[0][4][1]))
        return self._address

    def probe(self) -> float:
        """Perform the handshake without a call; return its duration in seconds.

        Raises:
            ServiceError: the server is missing, has another type, or does not answer in time.
            MasterError: the master does not answer.
        """
        began_s = time.monotonic()
        with _Call(self.name, self._connect, _STAGE_TIMEOUT_S) as call:
            call.handshake(self._header(probe="1"))
        return time.monotonic() - began_s

    def call(self, request: Any, timeout_s: float, watch: Callable[[], None] | None = None) -> Any:
        """Send `request` and return the response.

        Args:
            request: a message of the service's request class.
            timeout_s: longest duration of the call.
            watch: called every 50 ms while waiting for the answer; its exceptions end the call.

        Raises:
            ServiceError: no answer was received; the statement names the stage.
            MasterError: the address is unknown and the master does not answer.
        """
        body = BytesIO()
        request.serialize(body)
        with _Call(self.name, self._connect, timeout_s) as call:
            call.handshake(self._header())
            return self._class._response_class().deserialize(call.exchange(body.getvalue(), watch))  # noqa: SLF001

    def _header(self, **extra: str) -> dict[str, str]:
        return {
            "callerid": self._master.caller,
            "service": self.name,
            "md5sum": self._class._md5sum,  # noqa: SLF001
            "type": self._class._type,  # noqa: SLF001
            **extra,
        }

    def _connect(self, timeout_s: float) -> socket.socket:
        """Connect to the kept address; look the address up if there is none or the connection is refused."""
        if self._address is not None:
            try:
                return socket.create_connection(self._address, timeout_s)
            except TimeoutError:
                raise
            except OSError:
                self._address = None
        return socket.create_connection(self.locate(), timeout_s)


class _Call:
    """One connection to a server with one deadline."""

    _socket: socket.socket

    def __init__(self, name: str, connect: Callable[[float], socket.socket], timeout_s: float) -> None:
        self._name = name
        self._connect = connect
        self._timeout_s = timeout_s
        self._deadline_s = time.monotonic() + timeout_s

    def __enter__(self) -> Self:
        self._begin("connection", _STAGE_TIMEOUT_S)
        try:
            self._socket = self._connect(self._remaining())
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except OSError as error:
            raise self._failure(error) from error
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def handshake(self, header: dict[str, str]) -> None:
        """Send the header of the client and read that of the server."""
        self._begin("handshake", _STAGE_TIMEOUT_S)
        fields = b"".join(_frame(f"{key}={value}".encode()) for key, value in header.items())
        try:
            self._send(_frame(fields))
            answer = self._receive(self._length(), None)
        except OSError as error:
            raise self._failure(error) from error
        if (reason := _fields(answer).get("error")) is not None:
            raise ServiceError(f"{self._name} refuses the call: {reason}", code=REFUSED)

    def exchange(self, body: bytes, watch: Callable[[], None] | None) -> bytes:
        """Send the request and return the body of the answer."""
        self._begin("answer", self._timeout_s)
        try:
            self._send(_frame(body))
            succeeded = self._receive(1, watch)[0]
            answer = self._receive(self._length(), watch)
        except OSError as error:
            raise self._failure(error) from error
        if not succeeded:
            raise ServiceError(f"{self._name} failed: {answer.decode('utf-8', 'replace')}", code=REFUSED)
        return answer

    def _begin(self, stage: str, limit_s: float) -> None:
        self._stage = stage
        self._limit_s = min(self._timeout_s, limit_s)
        self._stage_deadline_s = min(self._deadline_s, time.monotonic() + limit_s)

    def _remaining(self) -> float:
        left_s = self._stage_deadline_s - time.monotonic()
        if left_s <= 0:
            raise TimeoutError
        return left_s

    def _send(self, data: bytes) -> None:
        self._socket.settimeout(self._remaining())
        self._socket.sendall(data)

    def _length(self) -> int:
        (length,) = struct.unpack("<I", self._receive(4, None))
        if length > _LARGEST_ANSWER:
            raise ConnectionError(f"it announces an answer of {length} bytes")
        return int(length)

    def _receive(self, count: int, watch: Callable[[], None] | None) -> bytes:
        data = b""
        while len(data) < count:
            while not select.select([self._socket], [], [], min(self._remaining(), _WATCH_PERIOD_S))[0]:
                if watch is not None:
                    watch()
            chunk = self._socket.recv(count - len(data))
            if not chunk:
                raise ConnectionError("it closed the connection")
            data += chunk
        return data

    def _failure(self, error: OSError) -> ServiceError:
        if isinstance(error, TimeoutError):
            return ServiceError(
                f"{self._name} did not answer within {self._limit_s:.1f} s ({self._stage})",
                advice="its server hangs or is unreachable: restart it",
                code=TIMEOUT,
            )
        return ServiceError(
            f"{self._name} disappeared ({self._stage}): {error}", advice="restart its server", code=UNAVAILABLE
        )


def _frame(payload: bytes) -> bytes:
    return struct.pack("<I", len(payload)) + payload


def _fields(header: bytes) -> dict[str, str]:
    """Return the fields of a TCPROS header."""
    found: dict[str, str] = {}
    offset = 0
    while offset + 4 <= len(header):
        (length,) = struct.unpack_from("<I", header, offset)
        key, _, value = header[offset + 4 : offset + 4 + length].decode("utf-8", "replace").partition("=")
        found[key] = value
        offset += 4 + length
    return found
