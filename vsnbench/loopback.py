"""A web server for one person's browser on this machine: 127.0.0.1, a secret in the address, bounded in every way.

Any page on the Web can make a browser call this machine, and a name that its owner points to 127.0.0.1 makes such a
call look like one to that page's own server. So a request must name this machine as its host and carry the token; it
must be made within seconds; and there are only so many at a time.
"""

import contextlib
import hmac
import http.server
import io
import os
import secrets
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final

LOOPBACK: Final = "127.0.0.1"
MOST_CONNECTIONS: Final = 32
REQUEST_TIMEOUT_S: Final = 10.0
"""For a whole request to arrive; not for each byte of it."""
ANSWER_TIMEOUT_S: Final = 120.0
"""For a whole answer to be taken."""

_PRIVATE = {
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",  # the address is the secret
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


@dataclass(frozen=True, slots=True)
class Answer:
    """What a page's server says to a GET."""

    status: int
    content_type: str = "text/plain; charset=utf-8"
    length: int = 0
    body: Iterable[bytes] = ()
    headers: Mapping[str, str] = field(default_factory=dict)


def page(content: bytes, content_type: str, headers: Mapping[str, str] | None = None) -> Answer:
    """Return the answer that is one piece of content."""
    return Answer(HTTPStatus.OK, content_type, len(content), (content,), headers or {})


def file(path: Path, content_type: str) -> Answer:
    """Return the answer that is a file, read while it is sent; NOT_FOUND when it cannot be."""
    try:
        opened = path.open("rb")
    except OSError:
        return NOT_FOUND
    length = os.fstat(opened.fileno()).st_size

    def chunks() -> Iterator[bytes]:
        with opened:
            while chunk := opened.read(1 << 20):
                yield chunk

    return Answer(HTTPStatus.OK, content_type, length, chunks())


NOT_FOUND: Final = Answer(HTTPStatus.NOT_FOUND)

Site = Callable[[str, str], Answer]
"""Answers a GET: from the path after the token (`report.html`, empty for the page itself) and the query string."""


class LoopbackServer(http.server.ThreadingHTTPServer):
    """Serves a site on 127.0.0.1 under an address with a token; begin with `serve_forever`.

    Raises:
        OSError: the port is taken.
        OverflowError: it is no port.
    """

    daemon_threads = True
    request_queue_size = MOST_CONNECTIONS

    def __init__(self, port: int, site: Site, timeout_s: float = REQUEST_TIMEOUT_S) -> None:
        """Listen.

        Args:
            port: 0 for any that is free.
            site: what is served; called from several threads.
            timeout_s: for a request to arrive whole.
        """
        self.site = site
        self.timeout_s = timeout_s
        self.token = secrets.token_urlsafe(16)
        self._free = threading.BoundedSemaphore(MOST_CONNECTIONS)
        super().__init__((LOOPBACK, port), _Request)
        self.hosts = frozenset(f"{name}:{self.server_port}" for name in (LOOPBACK, "localhost"))

    @property
    def address(self) -> str:
        """What a browser opens."""
        return f"http://{LOOPBACK}:{self.server_port}/{self.token}/"

    def process_request(self, request: Any, client_address: Any) -> None:
        """Give a connection a thread of its own, or refuse it while all are busy."""
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
            return
        with contextlib.suppress(OSError):
            request.setblocking(False)
            request.send(b"HTTP/1.0 503 Service Unavailable\r\nContent-Length: 0\r\n\r\n")
        self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer, and make room for the next connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a client that left or was too slow; anything else is our bug and keeps its traceback."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Request(http.server.BaseHTTPRequestHandler):
    """One connection: HTTP/1.0, so one request."""

    server: LoopbackServer

    def setup(self) -> None:
        """Read under one deadline, however the bytes trickle in."""
        super().setup()
        self.rfile = io.BufferedReader(_UntilDeadline(self.connection, time.monotonic() + self.server.timeout_s))

    def do_GET(self) -> None:
        """Check who asks, and answer."""
        if self.headers.get_all("Host", []) not in [[host] for host in self.server.hosts]:
            self._send(Answer(HTTPStatus.MISDIRECTED_REQUEST))
            return
        path, _, query = self.path.partition("?")
        token, slash, rest = path.removeprefix("/").partition("/")
        if not hmac.compare_digest(token.encode("utf-8", "replace"), self.server.token.encode()):
            self._send(Answer(HTTPStatus.FORBIDDEN))
        elif not slash:
            self._send(Answer(HTTPStatus.FOUND, headers={"Location": f"/{token}/"}))
        else:
            self._send(self.server.site(rest, query))

    def _send(self, answer: Answer) -> None:
        deadline = time.monotonic() + ANSWER_TIMEOUT_S
        self.send_response_only(answer.status)
        for name, value in {**_PRIVATE, **answer.headers}.items():
            self.send_header(name, value)
        self.send_header("Content-Type", answer.content_type)
        self.send_header("Content-Length", str(answer.length))
        self.connection.settimeout(ANSWER_TIMEOUT_S)
        self.end_headers()
        for chunk in answer.body:
            # `sendall` spends a time-out on the whole chunk.
            self.connection.settimeout(max(deadline - time.monotonic(), 0.001))
            self.wfile.write(chunk)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base class's name
        """Say nothing: this is a person's own browser."""


class _UntilDeadline(io.RawIOBase):
    """A socket's bytes until a moment; then TimeoutError."""

    def __init__(self, connection: socket.socket, deadline: float) -> None:
        self._connection, self._deadline = connection, deadline

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        left_s = self._deadline - time.monotonic()
        if left_s <= 0:
            raise TimeoutError("the request did not arrive in time")
        self._connection.settimeout(left_s)
        return self._connection.recv_into(buffer)
