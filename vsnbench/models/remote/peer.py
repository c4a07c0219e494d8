"""What serves at the other end of a connection, and its address."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self
from urllib.parse import urlsplit

from vsnbench.errors import ModelError, ModelLostError, UsageError, VsnbenchError
from vsnbench.models.remote.vsnbench_policy import OLDEST_WIRE_VERSION, TOKEN_VARIABLE, WIRE_VERSION, is_loopback

MAX_ANSWER_BYTES = 8 * 2**20
"""An answer has an action and diagnostics; the largest of a built-in model, VLV's map, has 40 kB."""


class ModelBusyError(ModelError):
    """Another client uses the model."""

    code = "model-busy"


@dataclass(frozen=True, slots=True)
class Peer:
    """What serves at the other end of a connection, the versions of its protocol, and the errors of its failures."""

    noun: str
    failed: type[VsnbenchError]
    """It is something else, refuses, or breaks the protocol."""
    lost: type[VsnbenchError]
    """It does not answer."""
    busy: Callable[..., VsnbenchError]
    """Another client uses it. It is called with a statement and advice."""
    versions: tuple[int, int]
    """Oldest and newest version of the protocol."""
    max_bytes: int
    """Largest message that is accepted."""
    start: str
    """How to start its server."""
    replace: str
    """How to update its server."""


MODEL = Peer(
    noun="model",
    failed=ModelError,
    lost=ModelLostError,
    busy=ModelBusyError,
    versions=(OLDEST_WIRE_VERSION, WIRE_VERSION),
    max_bytes=MAX_ANSWER_BYTES,
    start="start its server (`vsnbench models serve …` or vsnbench_policy.py), and check host and port",
    replace="replace its vsnbench_policy.py: `vsnbench models serve --write-stub DIR`",
)


@dataclass(frozen=True, slots=True)
class Address:
    """Address of a server: `ws://host:port`, `wss://host:port`, or a local socket file."""

    url: str
    """For a socket file, the name of the model."""
    unix_path: str = ""

    @classmethod
    def parse(cls, url: str, token: str, noun: str = "model") -> Self:
        """Parse an address of a `noun`.

        Raises:
            UsageError: the address is invalid, or names another machine without a token.
        """
        try:
            parts = urlsplit(url)
            port = parts.port
        except ValueError as error:
            raise UsageError(f"{noun} {url}: {error}", advice="write ws://host:port", code="invalid-address") from error
        if parts.scheme not in ("ws", "wss") or not parts.hostname or port is None:
            raise UsageError(
                f"invalid {noun} address {url}",
                advice="write ws://host:port, for example ws://gpu-box:8765",
                code="invalid-address",
            )
        if parts.username or parts.password or parts.query or parts.fragment:
            raise UsageError(
                f"{noun} address ws://{parts.hostname}:{port} has more than host and port",
                advice=f"put the token in ${TOKEN_VARIABLE}",
                code="invalid-address",
            )
        if parts.scheme == "ws" and not token and not is_loopback(parts.hostname):
            raise UsageError(
                f"{noun} {url} is on another machine, which needs a token",
                advice=f"set ${TOKEN_VARIABLE} on both sides, and use wss:// on a shared network",
                code="no-token",
            )
        return cls(url)

    def __str__(self) -> str:
        return self.url
