"""One conversation with a model behind a WebSocket: every question has a number and a deadline.

The stub `vsnbench_policy.py` is the other side; both speak what docs/wire.md describes. The peer is untrusted: nothing
it sends is more than numbers, text and bytes, and no answer is larger than `MAX_ANSWER_BYTES`.
"""

import contextlib
import logging
import socket
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self
from urllib.parse import urlsplit

from vsnbench.errors import ModelError, ModelLostError, UsageError
from vsnbench.models.remote.vsnbench_policy import TOKEN_VARIABLE, WIRE_VERSION, WireError, is_loopback, pack, unpack

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

logger = logging.getLogger(__name__)

MAX_ANSWER_BYTES = 8 * 2**20
"""An answer holds an action and diagnostics; the largest of ours, VLV's map, has 40 kB."""
CONNECT_TIMEOUT_S = 5.0
_MOST_LATE_ANSWERS = 100
_FRAGMENT_BYTES = 120 * 2**10
"""Sent in such pieces, the other side reads one while the next is being masked; and they fit below the size from which
malloc asks the kernel for fresh pages each time. 2.1 MB there and back takes half the time that it takes in one."""


class ModelBusyError(ModelError):
    """The model is there, and another client has it."""


@dataclass(frozen=True, slots=True)
class Address:
    """Where a model is served: `ws://host:port`, `wss://host:port`, or a socket file of this machine."""

    url: str
    """Or, for a socket file, what people know the model by."""
    unix_path: str = ""

    @classmethod
    def parse(cls, url: str, token: str) -> Self:
        """Return the address that a user typed.

        Raises:
            UsageError: it is none, or would use a model of another machine without a token.
        """
        try:
            parts = urlsplit(url)
            port = parts.port
        except ValueError as error:
            raise UsageError(f"model {url}: {error}", advice="write ws://host:port") from error
        if parts.scheme not in ("ws", "wss") or not parts.hostname or port is None:
            raise UsageError(
                f"model {url} is no address of a model", advice="write ws://host:port, for example ws://gpu-box:8765"
            )
        if parts.username or parts.password or parts.query or parts.fragment:
            raise UsageError(
                f"model ws://{parts.hostname}:{port}", advice=f"give the token in ${TOKEN_VARIABLE}, not in the address"
            )
        if parts.scheme == "ws" and not token and not is_loopback(parts.hostname):
            raise UsageError(
                f"model {url} is on another machine and there is no token",
                advice=f"set ${TOKEN_VARIABLE} on both sides (and use wss:// where the network is not yours)",
            )
        return cls(url)

    def __str__(self) -> str:
        return self.url


@dataclass(frozen=True, slots=True)
class Answer:
    """What came back to one question, and what it cost."""

    message: Mapping[str, Any]
    round_trip_s: float
    sent_bytes: int
    received_bytes: int


class Connection:
    """An open conversation; a context manager. Not for several threads.

    `greeting` is the model's first message, with its card.
    """

    def __init__(self, address: Address, token: str, client: str) -> None:
        """Connect and say hello.

        Raises:
            ModelLostError: nothing answers, or not in time.
            ModelBusyError: another client has it.
            ModelError: what answers is no model, speaks another version, or refuses.
        """
        self.address = address
        self._number = 0
        self._socket = _open(address)
        try:
            hello = {"type": "hello", "wire": WIRE_VERSION, "token": token, "client": client}
            with self._deadline(CONNECT_TIMEOUT_S, "hello"):
                self._socket.send(pack(hello))
                self.greeting = self._received(self._socket.recv(timeout=CONNECT_TIMEOUT_S))
        except TimeoutError as error:
            self.close()
            raise ModelError(
                f"what listens at {address} says no hello within {CONNECT_TIMEOUT_S:g} s",
                advice="is it a model's server?",
            ) from error
        except BaseException:
            self.close()
            raise
        _check_greeting(self.greeting, address)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def ask(self, question: Mapping[str, Any], timeout_s: float) -> Answer:
        """Send a question and return the answer with its number; older answers are dropped.

        Raises:
            ModelLostError: no answer came in time, or the connection broke; it is closed then.
            ModelError: the answer is no message of the protocol; the connection is closed then.
        """
        self._number += 1
        content = pack({**question, "seq": self._number})
        began = time.perf_counter()
        what = str(question["type"])
        try:
            with self._deadline(timeout_s, what):
                self._socket.send(_fragments(content))
                for _ in range(_MOST_LATE_ANSWERS):
                    received = self._socket.recv(timeout=max(0.0, began + timeout_s - time.perf_counter()))
                    message = self._received(received)
                    number = message.get("seq")
                    if number == self._number and not isinstance(number, bool):
                        return Answer(message, time.perf_counter() - began, len(content), len(received))
                    if isinstance(number, bool) or not isinstance(number, int) or number > self._number:
                        raise ModelError(
                            f"the model at {self.address} answers question {number!r:.20}, which was not asked"
                        )
                    logger.warning("the model at %s answered question %d too late: dropped", self.address, number)
                raise ModelError(f"the model at {self.address} floods this run with old answers")
        except TimeoutError as error:
            self.close()
            raise ModelLostError(f"{what}: no answer from {self.address} within {timeout_s:g} s") from error
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Say good-bye where that is possible at once, and let go."""
        with contextlib.suppress(Exception), self._deadline(0.5, "bye"):
            self._socket.send(pack({"type": "bye"}))
        self._break()

    def _received(self, content: object) -> Mapping[str, Any]:
        try:
            message: Mapping[str, Any] = unpack(content)
        except WireError as error:
            raise ModelError(f"the model at {self.address} does not speak the protocol: {error}") from error
        return message

    @contextlib.contextmanager
    def _deadline(self, timeout_s: float, what: str) -> Iterator[None]:
        """Break the connection when the time is up: nothing else ends a send to a peer that has stopped reading."""
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
            raise ModelLostError(f"{what}: the connection to {self.address} broke: {_words(error)}") from error
        finally:
            timer.cancel()

    def _break(self) -> None:
        with contextlib.suppress(OSError):
            self._socket.socket.shutdown(socket.SHUT_RDWR)
        with contextlib.suppress(OSError):
            self._socket.socket.close()


def _fragments(content: bytes) -> Iterator[memoryview]:
    whole = memoryview(content)
    return (whole[begin : begin + _FRAGMENT_BYTES] for begin in range(0, len(whole), _FRAGMENT_BYTES))


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
                f"what listens at {address} hangs up at once", advice="is it a model's server?"
            ) from error
        raise ModelError(f"what listens at {address} is no model's server: {_words(error)}") from error
    except TimeoutError as error:
        raise ModelLostError(
            f"no answer from {address} within {CONNECT_TIMEOUT_S:g} s", advice="is the model served there?"
        ) from error
    except OSError as error:
        raise ModelLostError(
            f"no model at {address}: {error.strerror or _words(error)}",
            advice="start it there (`vsnbench models serve …` or vsnbench_policy.py) and look at host and port",
        ) from error
    found: ClientConnection = opened
    return found


def _check_greeting(greeting: Mapping[str, Any], address: Address) -> None:
    if greeting.get("type") == "error":
        code, words = greeting.get("code"), str(greeting.get("message"))[:200]
        advice = {
            "token": f": set ${TOKEN_VARIABLE} to the token that the server was started with",
            "busy": ": end the other run, or serve the model on another port",
        }.get(str(code), "")
        refused = ModelBusyError if code == "busy" else ModelError
        raise refused(f"the model at {address} refuses: {words}{advice}")
    if greeting.get("type") != "card":
        raise ModelError(f"the model at {address} does not begin with its card", advice="is it a model's server?")
    if greeting.get("wire") != WIRE_VERSION:
        raise ModelError(
            f"the model at {address} speaks version {greeting.get('wire')!r:.20} of the wire, not {WIRE_VERSION}",
            advice="copy vsnbench_policy.py there anew: `vsnbench models serve --write-stub DIR`",
        )


def _words(error: BaseException) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
