"""Browsers that have the page open, and the time of their last message.

A browser without a connection cannot stop the robot, so the pages and the terminal show which ones are silent.
"""

import time
from dataclasses import dataclass
from typing import Final

from vsnbench.web_server.session_key import Visitor

SILENT_S: Final = 3.0
"""A page sends a message every second. After this time without one it counts as silent."""
_FORGET_S = 3600.0


@dataclass(slots=True)
class Client:
    """A browser with the page open."""

    id: str
    name: str
    last_message_s: float
    """Time of the last message, on this process's monotonic clock."""
    reported_silent: bool = False

    @property
    def silence_s(self) -> float:
        """Time since the last message."""
        return time.monotonic() - self.last_message_s

    @property
    def is_silent(self) -> bool:
        """Whether the client has missed its messages."""
        return self.silence_s > SILENT_S


class Clients:
    """The clients of a session. Use it from the server's event loop only."""

    def __init__(self) -> None:
        self._clients: dict[str, Client] = {}

    def record_message(self, visitor: Visitor) -> None:
        """Record that a client has sent a message."""
        client = self._clients.setdefault(visitor.id, Client(visitor.id, visitor.name, 0.0))
        client.name, client.last_message_s = visitor.name or client.name, time.monotonic()

    def as_json(self, visitor_id: str) -> list[dict[str, object]]:
        """Return all clients, for the page of one of them."""
        self._clients = {key: client for key, client in self._clients.items() if client.silence_s < _FORGET_S}
        return [
            {"name": client.name or "unnamed", "is_you": client.id == visitor_id, "is_silent": client.is_silent}
            for client in self._clients.values()
        ]

    def status_changes(self, *, may_drive: bool) -> list[str]:
        """Return a message for each client that became silent or came back since the last messages.

        Without a trial in which the robot may drive there are none: nothing needs the STOP button.
        """
        messages: list[str] = []
        if not may_drive:
            return messages
        for client in self._clients.values():
            if client.is_silent == client.reported_silent:
                continue
            client.reported_silent = client.is_silent
            name = f"the phone of {client.name}" if client.name else "a phone"
            if client.is_silent:
                messages.append(f"{name} is not connected: its STOP button does not reach the robot")
            else:
                messages.append(f"{name} is connected again")
        return messages
