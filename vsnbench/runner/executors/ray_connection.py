"""Connects to a Ray cluster in bounded time, and finds out why a connection fails.

Ray's own client retries for half a minute and then raises the same error for a wrong token, a missing token and a
server that does not answer. One gRPC request beforehand tells them apart: a client server that uses token
authentication answers UNAUTHENTICATED (Ray 2.52 and later).
"""

import importlib.util
import logging
import os
import re
import socket
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.files.home import expanded
from vsnbench.installation import command_to_add, command_to_install
from vsnbench.runtime.time_limits import TimeLimitError, call_in_thread
from vsnbench.text.sanitize import error_line

KNOCK_TIMEOUT_S = 5.0
CONNECT_TIMEOUT_S = 60.0
ANSWER_TIMEOUT_S = 15.0
"""Time for the client server's first answer."""
_METHOD = "/ray.rpc.RayletDriver/ClusterInfo"
"""Any method of Ray's client service: authentication is checked before the request is read."""
_DEFAULT_TOKEN_FILE = Path("~/.ray/auth_token")
_SERVER_FAILED = "Starting Ray client server failed"
"""Text of Ray's error, inside a traceback."""


@dataclass(frozen=True, slots=True)
class ClusterAddress:
    """Address of a cluster's client server."""

    host: str
    port: int

    @classmethod
    def parse(cls, text: str) -> "ClusterAddress":
        """Read `ray://host:port`.

        Raises:
            UsageError: the text is not such an address.
        """
        advice = "give it as ray://host:port; a head node's client server listens on port 10001"
        try:
            parts = urlsplit(text)
            host, port = parts.hostname, parts.port
        except ValueError as error:
            raise UsageError(f"--workers {text}: {error}", advice=advice) from error
        if parts.scheme != "ray" or not host or parts.path.strip("/") or parts.query or parts.username is not None:
            raise UsageError(f"--workers {text} is not the address of a Ray cluster", advice=advice)
        return cls(host, port or 10001)

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"ray://{host}:{self.port}"


def connect(address: ClusterAddress) -> Any:
    """Return the module `ray`, connected to a cluster.

    Raises:
        UsageError: Ray is not installed.
        VsnbenchError: the cluster does not answer, wants another token, or runs another version.
    """
    if importlib.util.find_spec("ray") is None:
        raise UsageError("Ray is not installed", advice=command_to_add("ray"))
    try:
        socket.create_connection((address.host, address.port), KNOCK_TIMEOUT_S).close()
    except OSError as error:
        raise VsnbenchError(
            f"--workers {address}: cannot connect ({error.strerror or error})",
            advice="is the head node up, started with `ray start --head --ray-client-server-port 10001`?",
        ) from error
    _check_token(address)
    import ray

    warnings.filterwarnings("ignore", module="ray")  # Ray raises an error for each of its warnings, too
    try:
        call_in_thread(
            lambda: ray.init(str(address), log_to_driver=False, logging_level=logging.ERROR), CONNECT_TIMEOUT_S
        )
    except TimeLimitError as late:
        raise VsnbenchError(
            f"--workers {address}: the client server did not accept a driver within {CONNECT_TIMEOUT_S:.0f} s",
            advice="run `ray status` on the head node",
        ) from late
    except Exception as error:
        raise refusal(address, error) from error
    return ray


def _check_token(address: ClusterAddress) -> None:
    """Send one request without a token and, where the cluster wants one, one with ours.

    Raises:
        VsnbenchError: nothing answers in time, or the token is missing or wrong.
    """
    import grpc

    status = _status(address, token="")
    if status in (grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.UNAVAILABLE):
        raise VsnbenchError(
            f"--workers {address}: the server there gave no answer of a Ray client server in {ANSWER_TIMEOUT_S:.0f} s",
            advice="is this the client port (--ray-client-server-port, usually 10001)? `ray status` on the head tells",
        )
    if status is not grpc.StatusCode.UNAUTHENTICATED:
        return
    if os.environ.get("RAY_AUTH_MODE") != "token":
        raise VsnbenchError(
            f"--workers {address}: the cluster requires a token, and RAY_AUTH_MODE is not set to 'token' here",
            advice="export RAY_AUTH_MODE=token RAY_AUTH_TOKEN_PATH=~/.ray-token (docs/scale.md)",
        )
    token, source = _token()
    if not token:
        raise VsnbenchError(
            f"--workers {address}: the cluster requires a token, and none is set here",
            advice="export RAY_AUTH_TOKEN_PATH=~/.ray-token (docs/scale.md)",
        )
    if _status(address, token) is grpc.StatusCode.UNAUTHENTICATED:
        raise VsnbenchError(
            f"--workers {address}: the cluster rejects this token ({source})",
            advice="copy the head node's token file to this machine",
        )


def _status(address: ClusterAddress, token: str) -> Any:
    """Return the gRPC status of one request; None when it succeeds."""
    import grpc

    metadata = [("authorization", f"Bearer {token}")] if token else []
    host = f"[{address.host}]" if ":" in address.host else address.host
    with grpc.insecure_channel(f"{host}:{address.port}") as channel:
        try:
            channel.unary_unary(_METHOD)(b"", timeout=ANSWER_TIMEOUT_S, metadata=metadata)
        except grpc.RpcError as error:
            return error.code()
    return None


def _token() -> tuple[str, str]:
    """Return the token and its source, as Ray looks them up: the variable, the file that a variable names, its own."""
    if token := os.environ.get("RAY_AUTH_TOKEN"):
        return token.strip(), "RAY_AUTH_TOKEN"
    source = os.environ.get("RAY_AUTH_TOKEN_PATH") or str(_DEFAULT_TOKEN_FILE)
    try:
        return expanded(source).read_text(encoding="utf-8").strip(), source
    except (OSError, UnicodeDecodeError):
        return "", source


def refusal(address: ClusterAddress, error: BaseException) -> VsnbenchError:
    """Return one line for an error that Ray raised while it connected."""
    text = error_line(error, named=False)
    if isinstance(error, ConnectionError) and _SERVER_FAILED in text:
        return VsnbenchError(
            f"--workers {address}: the head node could not start a client server in time",
            advice="try again; start the head with GRPC_ENABLE_FORK_SUPPORT=0, as docs/scale.md does",
        )
    if "version" in text.lower():
        server = re.search(r"started with:\s*Ray: ([\w.]+)", text)
        return VsnbenchError(
            f"--workers {address}: the cluster runs another version of Ray or Python: {text}",
            advice="install the cluster's here: "
            + command_to_install(f"ray[client]=={server[1] if server else '...'}"),
        )
    return VsnbenchError(f"--workers {address}: {text}", advice="see docs/scale.md")
