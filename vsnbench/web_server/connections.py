"""A listening socket that limits its connections.

Above a limit the oldest connection is closed, and connections that have not authenticated have a limit of their own.
Slow or hostile clients therefore cannot lock out the phone with the STOP button.
"""

import asyncio
import contextlib
import socket
from typing import Final

from vsnbench.errors import UsageError

MAX_UNAUTHENTICATED: Final = 48
MAX_AUTHENTICATED: Final = 128
AUTHENTICATION_TIMEOUT_S: Final = 10.0
"""Time for a new connection to send an authenticated request."""

_Connections = dict[tuple[str, int], socket.socket]


class LimitedListener(socket.socket):
    """TCP listener for an asyncio server. Use it from the server's event loop only."""

    def __init__(self, address: str, port: int) -> None:
        """Bind the port.

        Args:
            address: IPv4 address of this machine; `0.0.0.0` for all of them.
            port: 0 for any free port.

        Raises:
            UsageError: `port-unavailable`, the port is in use or not permitted; `unknown-address`, the address is not
                one of this machine.
        """
        super().__init__(socket.AF_INET, socket.SOCK_STREAM)
        self._unauthenticated: _Connections = {}
        self._authenticated: _Connections = {}
        self.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self.bind((address, port))
            self.listen(256)
        except (OSError, OverflowError) as error:
            self.close()
            if isinstance(error, OSError) and port:
                raise UsageError(
                    f"cannot listen on {address}:{port} ({error.strerror or error})",
                    advice="another page of vsnbench may use the port; choose a different one",
                    code="port-unavailable",
                ) from error
            raise UsageError(f"{address}:{port} is not an address of this machine", code="unknown-address") from error

    def accept(self) -> tuple[socket.socket, tuple[str, int]]:
        """Accept a connection, and close the oldest unauthenticated one if there are too many."""
        connection, client = super().accept()
        self._add(self._unauthenticated, client, connection, MAX_UNAUTHENTICATED)
        asyncio.get_running_loop().call_later(AUTHENTICATION_TIMEOUT_S, self._time_out, client, connection)
        return connection, client

    def set_authenticated(self, client: tuple[str, int]) -> None:
        """Move the connection of a client to the authenticated ones."""
        if (connection := self._unauthenticated.pop(client, None)) is not None:
            self._add(self._authenticated, client, connection, MAX_AUTHENTICATED)

    def _add(self, connections: _Connections, client: tuple[str, int], connection: socket.socket, limit: int) -> None:
        for address in [address for address, connection in connections.items() if connection.fileno() == -1]:
            del connections[address]
        connections[client] = connection
        while len(connections) > limit:
            _disconnect(connections.pop(next(iter(connections))))

    def _time_out(self, client: tuple[str, int], connection: socket.socket) -> None:
        if self._unauthenticated.get(client) is connection:
            _disconnect(self._unauthenticated.pop(client))


def _disconnect(connection: socket.socket) -> None:
    """Shut a connection down; its transport then reads the end of the stream and closes it."""
    with contextlib.suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)
