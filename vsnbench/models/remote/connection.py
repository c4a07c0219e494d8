"""A connection to a model's server over a WebSocket. Every request has a number and a deadline.

`vsnbench_policy.py` is the server's side; docs/wire.md describes the protocol. The server is untrusted: messages have
only numbers, strings and bytes, and at most `MAX_ANSWER_BYTES`.
"""

import contextlib
import logging
import socket
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self
from urllib.parse import urlsplit

from vsnbench.errors import ModelError, ModelLostError, UsageError
from vsnbench.models.remote.vsnbench_policy import (
    OLDEST_WIRE_VERSION,
    TOKEN_VARIABLE,
    WIRE_VERSION,
    WireError,
    is_loopback,
    pack,
    unpack,
)
from vsnbench.text.sanitize import error_line, sanitize

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

logger = logging.getLogger(__name__)

MAX_ANSWER_BYTES = 8 * 2**20
"""An answer has an action and diagnostics; the largest of a built-in model, VLV's map, has 40 kB."""
CONNECT_TIMEOUT_S = 5.0
_REPLACE_STUB = "replace its vsnbench_policy.py: `vsnbench models serve --write-stub DIR`"
"""Advice for a server of another version of the protocol."""
_MAX_LATE_ANSWERS = 100
_FRAGMENT_BYTES = 120 * 2**10
"""Size of the fragments of a request. The server reads a fragment while the next is masked, and fragments are below the
size from which malloc asks the kernel for new pages. They halve the duration of a round trip of 2.1 MB."""


class ModelBusyError(ModelError):
    """Another client uses the model."""

    code = "model-busy"


@dataclass(frozen=True, slots=True)
class Address:
    """Address of a model's server: `ws://host:port`, `wss://host:port`, or a local socket file."""

    url: str
    """For a socket file, the name of the model."""
    unix_path: str = ""

    @classmethod
    def parse(cls, url: str, token: str) -> Self:
        """Parse an address.

        Raises:
            UsageError: the address is invalid, or is that of another machine and there is no token.
        """
        try:
            parts = urlsplit(url)
            port = parts.port
        except ValueError as error:
            raise UsageError(f"model {url}: {error}", advice="write ws://host:port", code="invalid-address") from error
        if parts.scheme not in ("ws", "wss") or not parts.hostname or port is None:
            raise UsageError(
                f"invalid model address {url}",
                advice="write ws://host:port, for example ws://gpu-box:8765",
                code="invalid-address",
            )
        if parts.username or parts.password or parts.query or parts.fragment:
            raise UsageError(
                f"model address ws://{parts.hostname}:{port} has more than host and port",
                advice=f"put the token in ${TOKEN_VARIABLE}",
                code="invalid-address",
            )
        if parts.scheme == "ws" and not token and not is_loopback(parts.hostname):
            raise UsageError(
                f"model {url} is on another machine and there is no token",
                advice=f"set ${TOKEN_VARIABLE} on both sides, and use wss:// on a shared network",
                code="no-token",
            )
        return cls(url)

    def __str__(self) -> str:
        return self.url


@dataclass(frozen=True, slots=True)
class ServerAnswer:
    """The answer to a request, with its duration and size."""

    message: Mapping[str, Any]
    round_trip_s: float
    sent_bytes: int
    received_bytes: int


class Connection:
    """An open connection. Not thread-safe.

    `greeting` is the server's first message, with the model's card.
    """

    def __init__(self, address: Address, token: str, client: str) -> None:
        """Connect and exchange the first messages.

        Raises:
            ModelLostError: no server answers in time.
            ModelBusyError: another client uses the model.
            ModelError: the server is not that of a model, has another protocol version, or refuses.
        """
        self.address = address
        self._number = 0
        self._socket = _open(address)
        try:
            versions = {"wire": OLDEST_WIRE_VERSION, "newest_wire": WIRE_VERSION}
            hello = {"type": "hello", **versions, "token": token, "client": client}
            with self._deadline(CONNECT_TIMEOUT_S, "hello"):
                self._socket.send(pack(hello))
                self.greeting = self._received(self._socket.recv(timeout=CONNECT_TIMEOUT_S))
        except TimeoutError as error:
            self.close()
            raise ModelError(
                f"the server at {address} sent no greeting within {CONNECT_TIMEOUT_S:g} s",
                advice="is it a model's server?",
                code="not-a-model-server",
            ) from error
        except BaseException:
            self.close()
            raise
        _check_greeting(self.greeting, address)

    def ask(self, request: Mapping[str, Any], timeout_s: float) -> ServerAnswer:
        """Send a request and return its answer. Answers to older requests are dropped.

        The connection is closed after every error.

        Raises:
            ModelLostError: no answer in time, or the connection broke.
            ModelError: the server sent something other than an answer to this request.
        """
        self._number += 1
        content = pack({**request, "seq": self._number})
        start_s = time.perf_counter()
        what = str(request["type"])
        try:
            with self._deadline(timeout_s, what):
                early: list[object] = []
                self._socket.send(self._fragments(content, early))
                self._check_early(early)
                for _ in range(_MAX_LATE_ANSWERS):
                    received = self._socket.recv(timeout=max(0.0, start_s + timeout_s - time.perf_counter()))
                    message = self._received(received)
                    if self._answered(message) == self._number:
                        return ServerAnswer(message, time.perf_counter() - start_s, len(content), len(received))
                raise self._flood()
        except TimeoutError as error:
            self.close()
            raise ModelLostError(
                f"{what}: no answer from {self.address} within {timeout_s:g} s", code="no-answer"
            ) from error
        except BaseException:
            self.close()
            raise

    def _fragments(self, content: bytes, early: list[object]) -> Iterator[memoryview]:
        """Yield a request in fragments, then collect in `early` the messages that have arrived.

        websockets ends the request with an empty frame after the last fragment. A message that arrives before that
        frame cannot be an answer to this request.
        """
        whole = memoryview(content)
        for begin in range(0, len(whole), _FRAGMENT_BYTES):
            yield whole[begin : begin + _FRAGMENT_BYTES]
        with contextlib.suppress(TimeoutError):
            while len(early) <= _MAX_LATE_ANSWERS:
                early.append(self._socket.recv(timeout=0))

    def _check_early(self, early: list[object]) -> None:
        """Refuse an answer that arrived before its request was sent."""
        for received in early:
            if self._answered(self._received(received)) == self._number:
                raise ModelError(
                    f"the model at {self.address} answered request {self._number} before it was sent",
                    code="invalid-answer",
                )
        if len(early) > _MAX_LATE_ANSWERS:
            raise self._flood()

    def _answered(self, message: Mapping[str, Any]) -> int:
        """Return the number of the request that a message answers: this one or an older one."""
        number = message.get("seq")
        if isinstance(number, bool) or not isinstance(number, int) or number > self._number:
            raise ModelError(
                f"the model at {self.address} answered request {number!r:.20}, which was not sent",
                code="invalid-answer",
            )
        if number < self._number:
            logger.warning("the model at %s answered request %d too late; the answer is dropped", self.address, number)
        return number

    def _flood(self) -> ModelError:
        return ModelError(f"the model at {self.address} sends too many old answers", code="invalid-answer")

    def close(self) -> None:
        """Close the connection, with a last message if it can be sent at once."""
        with contextlib.suppress(Exception), self._deadline(0.5, "bye"):
            self._socket.send(pack({"type": "bye"}))
        self._break()

    def _received(self, content: object) -> Mapping[str, Any]:
        try:
            message: Mapping[str, Any] = unpack(content)
        except WireError as error:
            raise ModelError(
                f"the model at {self.address} sent an invalid message: {error}", code="invalid-message"
            ) from error
        return message

    @contextlib.contextmanager
    def _deadline(self, timeout_s: float, what: str) -> Iterator[None]:
        """Break the connection at the deadline, which also ends a send to a server that has stopped reading."""
        from websockets.exceptions import WebSocketException

        passed = threading.Event()

        def give_up() -> None:
            passed.set()
            self._break()

        timer = threading.Timer(timeout_s + 0.1, give_up)
        timer.daemon = True
        timer.start()
        try:
            yield
        except (WebSocketException, OSError) as error:
            if isinstance(error, TimeoutError):
                raise
            if passed.is_set():
                raise TimeoutError from error
            raise ModelLostError(
                f"{what}: the connection to {self.address} broke: {error_line(error, named=False)}",
                code="connection-lost",
            ) from error
        finally:
            timer.cancel()

    def _break(self) -> None:
        with contextlib.suppress(OSError):
            self._socket.socket.shutdown(socket.SHUT_RDWR)
        with contextlib.suppress(OSError):
            self._socket.socket.close()


def _open(address: Address) -> "ClientConnection":
    from websockets.exceptions import ConnectionClosed, WebSocketException
    from websockets.sync.client import connect, unix_connect

    options: dict[str, Any] = {
        "compression": None,
        "max_size": MAX_ANSWER_BYTES,
        "open_timeout": CONNECT_TIMEOUT_S,
        "close_timeout": 1.0,
        "ping_interval": None,
        "proxy": None,
        "legacy": True,
    }
    try:
        if address.unix_path:
            opened: Any = unix_connect(address.unix_path, **options)
        else:
            opened = connect(address.url, **options)
    except (WebSocketException, EOFError) as error:
        if isinstance(error, EOFError | ConnectionClosed) or isinstance(error.__cause__, EOFError | OSError):
            raise ModelLostError(
                f"the server at {address} closed the connection at once",
                advice="is it a model's server?",
                code="not-a-model-server",
            ) from error
        raise ModelError(
            f"the server at {address} is not a model's server: {error_line(error, named=False)}",
            code="not-a-model-server",
        ) from error
    except TimeoutError as error:
        raise ModelLostError(
            f"no answer from {address} within {CONNECT_TIMEOUT_S:g} s",
            advice="is the model's server running?",
            code="no-server",
        ) from error
    except OSError as error:
        raise ModelLostError(
            f"no model at {address}: {error.strerror or error_line(error, named=False)}",
            advice="start its server (`vsnbench models serve …` or vsnbench_policy.py), and check host and port",
            code="no-server",
        ) from error
    found: ClientConnection = opened
    return found


def _check_greeting(greeting: Mapping[str, Any], address: Address) -> None:
    """Raise an error unless the server sent its card in a version of the protocol that this client knows."""
    if greeting.get("type") == "error":
        statement = f"the model at {address} refuses: {sanitize(str(greeting.get('message'))[:200])}"
        if greeting.get("code") == "busy":
            raise ModelBusyError(statement, advice="end the other run, or serve the model on another port")
        if greeting.get("code") == "token":
            advice = f"set ${TOKEN_VARIABLE} to the token of the server"
            raise ModelError(statement, advice=advice, code="wrong-token")
        raise ModelError(statement, code="refused")
    if greeting.get("type") != "card":
        raise ModelError(
            f"the model at {address} sent no card", advice="is it a model's server?", code="not-a-model-server"
        )
    version: Any = greeting.get("wire")
    if isinstance(version, bool) or version not in range(OLDEST_WIRE_VERSION, WIRE_VERSION + 1):
        raise ModelError(
            f"the model at {address} uses version {version!r:.20} of the protocol, not {WIRE_VERSION}",
            advice=_REPLACE_STUB,
            code="wrong-protocol-version",
        )
