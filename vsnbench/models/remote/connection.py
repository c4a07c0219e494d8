"""A connection to a server of a model, or of another peer, over a WebSocket. Every request has a number and a deadline.

`vsnbench_policy.py` is the model server's side; docs/wire.md describes the protocol. The server is untrusted: messages
have only numbers, strings and bytes, and at most `Peer.max_bytes`.
"""

import contextlib
import logging
import socket
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from vsnbench.errors import VsnbenchError
from vsnbench.models.remote.peer import MODEL, Address, Peer
from vsnbench.models.remote.vsnbench_policy import TOKEN_VARIABLE, WireError, pack, unpack
from vsnbench.text.sanitize import error_line, sanitize

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

logger = logging.getLogger(__name__)

CONNECT_TIMEOUT_S = 5.0
_MAX_LATE_ANSWERS = 100
_TOO_BIG = 1009
"""Code with which a connection is closed whose message is too large (RFC 6455, section 7.4.1)."""
_FRAGMENT_BYTES = 120 * 2**10
"""Size of the fragments of a request. The server reads a fragment while the next is masked, and fragments are below the
size from which malloc asks the kernel for new pages. They halve the duration of a round trip of 2.1 MB."""


@dataclass(frozen=True, slots=True)
class ServerAnswer:
    """The answer to a request, with its duration and size."""

    message: Mapping[str, Any]
    round_trip_s: float
    sent_bytes: int
    received_bytes: int


class Connection:
    """An open connection. Not thread-safe.

    `greeting` is the server's first message, with the peer's card. Errors are those of the peer: of a model ModelError,
    ModelLostError and ModelBusyError.
    """

    def __init__(self, address: Address, token: str, client: str, peer: Peer | None = None) -> None:
        """Connect and exchange the first messages; the peer is a model by default.

        Raises:
            ModelLostError: no server answers in time.
            ModelBusyError: another client uses the model.
            ModelError: the server is not that of a model, has another protocol version, or refuses.
        """
        self.address = address
        self.peer = peer or MODEL
        self._number = 0
        self._closed = False
        self._socket = _open(address, self.peer)
        try:
            versions = {"wire": self.peer.versions[0], "newest_wire": self.peer.versions[1]}
            hello = {"type": "hello", **versions, "token": token, "client": client}
            with self._deadline(CONNECT_TIMEOUT_S, "hello"):
                self._socket.send(pack(hello))
                self.greeting = self._received(self._socket.recv(timeout=CONNECT_TIMEOUT_S))
        except TimeoutError as error:
            self.close()
            raise self.peer.failed(
                f"the server at {address} sent no greeting within {CONNECT_TIMEOUT_S:g} s",
                advice=_is_it(self.peer),
                code=_not_a_server(self.peer),
            ) from error
        except BaseException:
            self.close()
            raise
        _check_greeting(self.greeting, address, self.peer)

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
            raise self.peer.lost(
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
                raise self.peer.failed(
                    f"the {self.peer.noun} at {self.address} answered request {self._number} before it was sent",
                    code="invalid-answer",
                )
        if len(early) > _MAX_LATE_ANSWERS:
            raise self._flood()

    def _answered(self, message: Mapping[str, Any]) -> int:
        """Return the number of the request that a message answers: this one or an older one."""
        number = message.get("seq")
        if isinstance(number, bool) or not isinstance(number, int) or number > self._number:
            raise self.peer.failed(
                f"the {self.peer.noun} at {self.address} answered request {number!r:.20}, which was not sent",
                code="invalid-answer",
            )
        if number < self._number:
            at = f"{self.peer.noun} at {self.address}"
            logger.warning("the %s answered request %d too late; the answer is dropped", at, number)
        return number

    def _flood(self) -> VsnbenchError:
        return self.peer.failed(
            f"the {self.peer.noun} at {self.address} sends too many old answers", code="invalid-answer"
        )

    @property
    def is_open(self) -> bool:
        """Whether this side has not closed the connection, nor found it broken."""
        return not self._closed

    def close(self) -> None:
        """Close the connection, with a last message if it can be sent at once."""
        with contextlib.suppress(Exception), self._deadline(0.5, "bye"):
            self._socket.send(pack({"type": "bye"}))
        self._break()

    def _received(self, content: object) -> Mapping[str, Any]:
        try:
            message: Mapping[str, Any] = unpack(content)
        except WireError as error:
            raise self.peer.failed(
                f"the {self.peer.noun} at {self.address} sent an invalid message: {error}", code="invalid-message"
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
            reason = f"the connection to {self.address} broke: {error_line(error, named=False)}"
            if getattr(getattr(error, "sent", None), "code", 0) == _TOO_BIG:
                reason = (
                    f"the {self.peer.noun} at {self.address} sent more than {self.peer.max_bytes} bytes in a message"
                )
            raise self.peer.lost(
                f"{what}: {reason}",
                code="connection-lost",
            ) from error
        finally:
            timer.cancel()

    def _break(self) -> None:
        self._closed = True
        with contextlib.suppress(OSError):
            self._socket.socket.shutdown(socket.SHUT_RDWR)
        with contextlib.suppress(OSError):
            self._socket.socket.close()


def _a(peer: Peer) -> str:
    return f"{'an' if peer.noun[0] in 'aeiou' else 'a'} {peer.noun}"


def _is_it(peer: Peer) -> str:
    return f"is it {_a(peer)}'s server?"


def _not_a_server(peer: Peer) -> str:
    return f"not-a-{peer.noun}-server"


def _open(address: Address, peer: Peer) -> "ClientConnection":
    from websockets.exceptions import ConnectionClosed, WebSocketException
    from websockets.sync.client import connect, unix_connect

    options: dict[str, Any] = {
        "compression": None,
        "max_size": peer.max_bytes,
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
            raise peer.lost(
                f"the server at {address} closed the connection at once",
                advice=_is_it(peer),
                code=_not_a_server(peer),
            ) from error
        raise peer.failed(
            f"the server at {address} is not {_a(peer)}'s server: {error_line(error, named=False)}",
            code=_not_a_server(peer),
        ) from error
    except TimeoutError as error:
        raise peer.lost(
            f"no answer from {address} within {CONNECT_TIMEOUT_S:g} s",
            advice=f"is the {peer.noun}'s server running?",
            code="no-server",
        ) from error
    except OSError as error:
        raise peer.lost(
            f"no {peer.noun} at {address}: {error.strerror or error_line(error, named=False)}",
            advice=peer.start,
            code="no-server",
        ) from error
    found: ClientConnection = opened
    return found


def _check_greeting(greeting: Mapping[str, Any], address: Address, peer: Peer) -> None:
    """Raise an error unless the server sent its card in a version of the protocol that this client knows."""
    if greeting.get("type") == "error":
        statement = f"the {peer.noun} at {address} refuses: {sanitize(str(greeting.get('message'))[:200])}"
        if greeting.get("code") == "busy":
            raise peer.busy(statement, advice=f"end the other run, or serve the {peer.noun} on another port")
        if greeting.get("code") == "token":
            advice = f"set ${TOKEN_VARIABLE} to the token of the server"
            raise peer.failed(statement, advice=advice, code="wrong-token")
        raise peer.failed(statement, code="refused")
    if greeting.get("type") != "card":
        raise peer.failed(f"the {peer.noun} at {address} sent no card", advice=_is_it(peer), code=_not_a_server(peer))
    version: Any = greeting.get("wire")
    if isinstance(version, bool) or version not in range(peer.versions[0], peer.versions[1] + 1):
        raise peer.failed(
            f"the {peer.noun} at {address} uses version {version!r:.20} of the protocol, not {peer.versions[1]}",
            advice=peer.replace,
            code="wrong-protocol-version",
        )
