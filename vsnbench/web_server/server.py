"""An HTTP server in a background thread: one port, one token, limited connections, optional TLS."""

import asyncio
import socket
import ssl
import threading
from pathlib import Path
from typing import Any, Final, Self

import psutil
import uvicorn
from starlette.types import ASGIApp

from vsnbench.errors import UsageError
from vsnbench.web_server.authentication import MAX_BODY_BYTES, Access, AuthenticationMiddleware
from vsnbench.web_server.connections import LimitedListener
from vsnbench.web_server.session_key import SessionKey

LOOPBACK: Final = "127.0.0.1"
_START_TIMEOUT_S = 10.0
_MAX_MESSAGE_BYTES = 16 * 1024
"""Of a request's head, and of a message on a web socket."""


class WebServer:
    """Serves an application behind authentication. The port is bound when the server is created."""

    def __init__(
        self,
        app: ASGIApp,
        key: SessionKey,
        *,
        address: str = LOOPBACK,
        port: int = 0,
        certificate: Path | None = None,
        private_key: Path | None = None,
        max_body_bytes: int = MAX_BODY_BYTES,
    ) -> None:
        """Bind the port.

        Args:
            app: ASGI application; finds the visitor in `scope["visitor"]`.
            key: key of the address.
            address: IPv4 address of this machine; `0.0.0.0` for all of them.
            port: 0 for any free port.
            certificate: PEM file for TLS.
            private_key: key of the certificate, if it is in another file.
            max_body_bytes: size limit of a request's body.

        Raises:
            UsageError: `port-unavailable`, `unknown-address` or `invalid-certificate`.
        """
        context = _tls_context(certificate, private_key)
        self._listener = LimitedListener(address, port)
        self.port = int(self._listener.getsockname()[1])
        self.scheme = "https" if context else "http"
        self._host_names = _host_names(address)
        self._key = key
        access = Access(
            key,
            hosts=frozenset(f"{name}:{self.port}" for name in self._host_names),
            scheme=self.scheme,
            cookie_name=f"vsnbench-{self.port}",
            max_body_bytes=max_body_bytes,
            on_authenticated=self._listener.set_authenticated,
        )
        config = uvicorn.Config(
            AuthenticationMiddleware(app, access),
            http="h11",
            ws="websockets-sansio",
            ws_max_size=_MAX_MESSAGE_BYTES,
            ws_max_queue=8,
            ws_ping_interval=5.0,
            ws_ping_timeout=10.0,
            ws_per_message_deflate=False,
            lifespan="off",
            log_config=None,
            log_level="critical",  # requests of other machines must not write to the operator's terminal
            access_log=False,
            proxy_headers=False,
            server_header=False,
            timeout_keep_alive=60,
            timeout_graceful_shutdown=1,
            h11_max_incomplete_event_size=_MAX_MESSAGE_BYTES,
            ssl_context_factory=(lambda _config, _default: context) if context else None,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), name="web-server", daemon=True)
        self._started = threading.Event()

    @property
    def addresses(self) -> list[str]:
        """Addresses for a browser, with the token; the one that other machines most likely reach comes first."""
        return [f"{self.scheme}://{name}:{self.port}/?token={self._key.token}" for name in self._host_names]

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start(self) -> None:
        """Start to serve, and return when the server answers."""
        self._thread.start()
        self._started.wait(_START_TIMEOUT_S)

    def close(self) -> None:
        """Stop to serve, if the server was started, and release the port."""
        if self._thread.is_alive():
            self._server.should_exit = True
            self._thread.join(5.0)
        self._listener.close()

    async def _serve(self) -> None:
        asyncio.get_running_loop().set_exception_handler(_handle_exception)
        serving = asyncio.create_task(self._server.serve(sockets=[self._listener]))
        while not self._server.started and not serving.done():
            await asyncio.sleep(0.005)
        self._started.set()
        await serving


def _handle_exception(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Report an exception in the event loop, unless a client caused it by breaking the protocol."""
    if "transport" not in context:
        loop.default_exception_handler(context)


def _host_names(address: str) -> list[str]:
    """Return the names under which a server that listens on an address can be reached."""
    if address == LOOPBACK:
        return [LOOPBACK, "localhost"]
    if address != "0.0.0.0":  # noqa: S104  # compared, not bound
        return [address]
    interfaces = psutil.net_if_addrs().values()
    own = [entry.address for interface in interfaces for entry in interface if entry.family == socket.AF_INET]
    host = socket.gethostname().lower()
    external = [name for name in own if not name.startswith("127.")]
    return list(dict.fromkeys([*external, host, f"{host.partition('.')[0]}.local", LOOPBACK, "localhost"]))


def _tls_context(certificate: Path | None, private_key: Path | None) -> ssl.SSLContext | None:
    if certificate is None:
        if private_key is not None:
            raise UsageError(
                "a private key needs its certificate",
                advice="add `certificate` to section [console] of vsnbench.toml",
                code="invalid-certificate",
            )
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, private_key)
    except (OSError, ssl.SSLError) as error:
        raise UsageError(
            f"cannot use the certificate {certificate}: {error}",
            advice="`certificate` and `key` in section [console] of vsnbench.toml must be PEM files",
            code="invalid-certificate",
        ) from error
    return context
