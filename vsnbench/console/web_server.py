"""A web server in a thread beside the work: one port, one token, bounded connections, TLS where there is a certificate.

Whoever never finishes a request is dropped first when there are many, so no number of slow clients locks out the
phone that holds the STOP button.
"""

import asyncio
import socket
import ssl
import threading
from collections import OrderedDict
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import h11
import psutil
import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from vsnbench.console.gate import MOST_BODY_BYTES, Door, Gate
from vsnbench.console.session_key import SessionKey
from vsnbench.errors import UsageError

LOOPBACK: Final = "127.0.0.1"
MOST_STRANGERS: Final = 48
"""Connections that have not shown the cookie; one more, and the oldest of them is closed."""
MOST_CONNECTIONS: Final = 128
REQUEST_TIMEOUT_S: Final = 10.0
"""For the first request of a connection to arrive whole."""
_START_TIMEOUT_S = 10.0
_MOST_WAITING_BYTES = 16 * 1024
"""Of a request's head, and of a message on a web socket."""


class _Connections:
    """Who is connected; touched by the server's loop alone."""

    def __init__(self) -> None:
        self.strangers: OrderedDict[tuple[str, int], asyncio.Transport] = OrderedDict()
        self.trusted: OrderedDict[tuple[str, int], asyncio.Transport] = OrderedDict()

    def came(self, client: tuple[str, int], transport: asyncio.Transport) -> None:
        self.strangers[client] = transport
        while len(self.strangers) > MOST_STRANGERS:
            self.strangers.popitem(last=False)[1].abort()

    def trust(self, client: tuple[str, int]) -> None:
        if (transport := self.strangers.pop(client, None)) is not None:
            self.trusted[client] = transport
            while len(self.trusted) > MOST_CONNECTIONS:
                self.trusted.popitem(last=False)[1].abort()

    def too_slow(self, client: tuple[str, int]) -> None:
        if (transport := self.strangers.pop(client, None)) is not None:
            transport.abort()

    def left(self, client: tuple[str, int]) -> None:
        self.strangers.pop(client, None)
        self.trusted.pop(client, None)


def _protocol(connections: _Connections) -> type[H11Protocol]:
    class Bounded(H11Protocol):
        """A connection that is counted, and closed when its first request does not come."""

        def connection_made(self, transport: Any) -> None:
            super().connection_made(transport)
            if self.client is not None:
                connections.came(self.client, transport)
                self.loop.call_later(REQUEST_TIMEOUT_S, connections.too_slow, self.client)

        def send_400_response(self, msg: str) -> None:
            """Answer what is no HTTP; where a request breaks off into it, in place of the page."""
            if self.cycle is not None:
                self.cycle.disconnected = True
                self.cycle.message_event.set()
            try:
                super().send_400_response(msg)
            except h11.LocalProtocolError:  # the page's answer is on its way
                self.transport.close()

        def connection_lost(self, exc: Exception | None) -> None:
            if self.client is not None:
                connections.left(self.client)
            super().connection_lost(exc)

    return Bounded


class WebServer:
    """Serves an application behind a gate while it is entered; its port is taken from the beginning."""

    def __init__(
        self,
        app: ASGIApp,
        key: SessionKey,
        *,
        address: str = LOOPBACK,
        port: int = 0,
        certificate: Path | None = None,
        private_key: Path | None = None,
        most_body_bytes: int = MOST_BODY_BYTES,
        port_option: str = "--console-port",
    ) -> None:
        """Take the port.

        Args:
            app: a Starlette application, or any other; the visitor is in `scope["visitor"]`.
            key: whose token the address has.
            address: of this machine; `0.0.0.0` for all of its own.
            port: 0 for any that is free.
            certificate: a PEM file for TLS.
            private_key: of the certificate, where it is not in the same file.
            most_body_bytes: of a request.
            port_option: with which another port is named, for people.

        Raises:
            UsageError: the port is taken, the address is not this machine's, or the certificate cannot be used.
        """
        context = _tls(certificate, private_key)
        self._socket = _listening(address, port, port_option)
        self.port = int(self._socket.getsockname()[1])
        self.scheme = "https" if context else "http"
        self._names = _names(address)
        self._key = key
        connections = _Connections()
        door = Door(
            key,
            frozenset(f"{name}:{self.port}" for name in self._names),
            self.scheme,
            f"vsnbench-{self.port}",
            most_body_bytes,
            connections.trust,
        )
        config = uvicorn.Config(
            Gate(app, door),
            http=_protocol(connections),
            ws="websockets-sansio",
            ws_max_size=_MOST_WAITING_BYTES,
            ws_max_queue=8,
            ws_ping_interval=5.0,
            ws_ping_timeout=10.0,
            ws_per_message_deflate=False,
            lifespan="off",
            log_config=None,
            # What strangers send is not told on the terminal at which a person is asked something.
            log_level="error",
            access_log=False,
            proxy_headers=False,
            server_header=False,
            timeout_keep_alive=60,
            timeout_graceful_shutdown=1,
            h11_max_incomplete_event_size=_MOST_WAITING_BYTES,
            ssl_context_factory=(lambda _config, _default: context) if context else None,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._serve, name="console", daemon=True)
        self._is_up = threading.Event()

    @property
    def addresses(self) -> list[str]:
        """What a browser opens, the one most likely to be reached from elsewhere first."""
        return [f"{self.scheme}://{name}:{self.port}/?token={self._key.token}" for name in self._names]

    def __enter__(self) -> Self:
        self._thread.start()
        self._is_up.wait(_START_TIMEOUT_S)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.should_exit = True
        self._thread.join(5.0)
        self._socket.close()

    def _serve(self) -> None:
        async def serve() -> None:
            serving = asyncio.create_task(self._server.serve(sockets=[self._socket]))
            while not self._server.started and not serving.done():
                await asyncio.sleep(0.005)
            self._is_up.set()
            await serving

        asyncio.run(serve())


def _listening(address: str, port: int, port_option: str) -> socket.socket:
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((address, port))
        listener.listen(256)
    except (OSError, OverflowError) as error:
        listener.close()
        if isinstance(error, OSError) and port:
            raise UsageError(
                f"port {port} at {address} cannot be had ({error.strerror or error})",
                advice=f"is another page of vsnbench there? name another with {port_option}",
            ) from error
        raise UsageError(f"{address}:{port} is no address of this machine to serve a page at: {error}") from error
    return listener


def _names(address: str) -> list[str]:
    """Return what a browser may call this machine."""
    if address == LOOPBACK:
        return [LOOPBACK, "localhost"]
    if address != "0.0.0.0":  # noqa: S104  # compared, not bound
        return [address]
    own = [one.address for each in psutil.net_if_addrs().values() for one in each if one.family == socket.AF_INET]
    host = socket.gethostname().lower()
    elsewhere = [name for name in own if not name.startswith("127.")]
    return list(dict.fromkeys([*elsewhere, host, f"{host.partition('.')[0]}.local", LOOPBACK, "localhost"]))


def _tls(certificate: Path | None, private_key: Path | None) -> ssl.SSLContext | None:
    if certificate is None:
        if private_key is not None:
            raise UsageError("a private key without its certificate", advice="name both: --console-certificate")
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, private_key)
    except (OSError, ssl.SSLError) as error:
        raise UsageError(
            f"the certificate {certificate} cannot be used: {error}",
            advice="PEM files, --console-certificate and --console-key",
        ) from error
    return context
