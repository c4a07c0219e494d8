"""Pages that show a state which changes: they receive it over a WebSocket, and answer heartbeats."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import Any, Final

from starlette.websockets import WebSocket, WebSocketDisconnect

INTERVAL_S: Final = 1.0
"""Longest time between two states that a page receives."""


class LivePages:
    """Connected pages of one application."""

    def __init__(self, least_interval_s: float = 0.0) -> None:
        """Start without a page.

        Args:
            least_interval_s: shortest time between two states that a page receives.
        """
        self._least_interval_s = least_interval_s
        self._loop: asyncio.AbstractEventLoop | None = None
        self._changes: set[asyncio.Event] = set()
        """One event per connected page, set when the state has changed."""

    def notify(self) -> None:
        """Send the new state to every page. Callable from any thread."""
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # the event loop ends with the session
                self._loop.call_soon_threadsafe(self._set_changed)

    def _set_changed(self) -> None:
        for changed in self._changes:
            changed.set()

    async def serve(
        self,
        socket: WebSocket,
        state: Callable[[], dict[str, Any]],
        take: Callable[[dict[str, Any]], Awaitable[dict[str, Any] | None]],
    ) -> None:
        """Serve one page until it is gone.

        Args:
            socket: its connection, not accepted yet.
            state: returns the state to send.
            take: takes each message of the page, and returns an answer to it or None.
        """
        await socket.accept()
        self._loop = asyncio.get_running_loop()
        changed = asyncio.Event()
        self._changes.add(changed)
        sending = asyncio.create_task(self._send(socket, state, changed))
        try:
            while True:
                message = await socket.receive_json()
                if not isinstance(message, dict):
                    continue
                if (answer := await take(message)) is not None:
                    await socket.send_json(answer)
                elif isinstance(message.get("heartbeat"), int):
                    await socket.send_json({"heartbeat": message["heartbeat"]})
        except (WebSocketDisconnect, ValueError, KeyError, RuntimeError):
            pass  # the page is gone, or sends what ours does not
        finally:
            sending.cancel()
            self._changes.discard(changed)

    async def _send(self, socket: WebSocket, state: Callable[[], dict[str, Any]], changed: asyncio.Event) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError):
            while True:
                changed.clear()
                await socket.send_json(state())
                await asyncio.sleep(self._least_interval_s)
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(INTERVAL_S):
                        await changed.wait()
