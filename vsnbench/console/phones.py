"""Who has a page open, and when each was last heard of: a phone that is silent cannot stop the robot."""

import time
from dataclasses import dataclass

from vsnbench.console.session_key import Visitor

SILENT_S = 3.0
"""A page says something every second; after this long without, its STOP button is taken for dead."""
_FORGOTTEN_S = 3600.0


@dataclass(slots=True)
class Phone:
    """A browser with the page open."""

    number: str
    name: str
    heard_s: float
    """When it was last heard of, on this process's monotonic clock."""
    sockets: int = 0
    told_silent: bool = False


class Phones:
    """The browsers that were here; touched by the server's loop alone."""

    def __init__(self) -> None:
        self._known: dict[str, Phone] = {}

    def heard(self, visitor: Visitor) -> Phone:
        """Note a sign of life."""
        now_s = time.monotonic()
        phone = self._known.setdefault(visitor.number, Phone(visitor.number, visitor.name, now_s))
        phone.name, phone.heard_s = visitor.name or phone.name, now_s
        return phone

    def closed(self, number: str) -> None:
        """Note that a page was closed, or lost its network."""
        if (phone := self._known.get(number)) is not None:
            phone.sockets -= 1

    def shown(self, number: str) -> list[dict[str, object]]:
        """Return everybody with how long each has been silent, for the page of one of them."""
        now_s = time.monotonic()
        self._known = {key: one for key, one in self._known.items() if now_s - one.heard_s < _FORGOTTEN_S}
        return [
            {
                "name": one.name or "somebody",
                "you": one.number == number,
                "silent_s": round(now_s - one.heard_s, 1),
                "silent": now_s - one.heard_s > SILENT_S,
            }
            for one in self._known.values()
        ]

    def changes(self) -> list[str]:
        """Return what the terminal is to be told of phones that fell silent, or came back, since it was last asked."""
        said = []
        for one in self._known.values():
            silent = time.monotonic() - one.heard_s > SILENT_S
            if silent == one.told_silent:
                continue
            one.told_silent = silent
            who = f"the phone of {one.name}" if one.name else "a phone"
            said.append(f"{who} is silent: its STOP button does not reach the robot" if silent else f"{who} is back")
        return said
