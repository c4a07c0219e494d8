"""A TCP relay between a browser and a page that can delay, stall, and search the traffic."""

import asyncio
import contextlib
import re
import socket
import threading
from types import TracebackType
from typing import Self

_OVERLAP = 64
"""Bytes that are searched twice, because a match can span two reads."""


class TcpRelay:
    """Forwards connections to a port of this machine while the context is entered. Thread-safe."""

    def __init__(self, to_port: int, delay_s: float = 0.0, search_for: re.Pattern[bytes] | None = None) -> None:
        """Bind a port.

        Args:
            to_port: target port.
            delay_s: delay of each byte, in both directions.
            search_for: pattern to find in the data from the target.
        """
        self.delay_s = delay_s
        self.matches: list[bytes] = []
        """Matches of the pattern, with some context."""
        self.received = 0
        """Number of bytes from the target."""
        self._to_port = to_port
        self._search_for = search_for
        self._listener = socket.create_server(("127.0.0.1", 0), backlog=256)
        self.port = int(self._listener.getsockname()[1])
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="relay", daemon=True)
        self._started = threading.Event()

    def __enter__(self) -> Self:
        self._thread.start()
        self._started.wait()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._loop.call_soon_threadsafe(self._closing.set)
        self._thread.join(10)

    def stall(self) -> None:
        """Stop to forward without closing connections, as when a phone leaves its network."""
        self._loop.call_soon_threadsafe(self._is_open.clear)

    def mend(self, *, cut: bool) -> None:
        """Forward again. With `cut`, connections are closed and their data are lost."""

        def resume() -> None:
            if cut:
                for writer in self._writers:
                    writer.transport.abort()
            self._is_open.set()

        self._loop.call_soon_threadsafe(resume)

    def _run(self) -> None:
        with contextlib.closing(self._loop):
            self._loop.run_until_complete(self._serve())

    async def _serve(self) -> None:
        self._is_open, self._closing = asyncio.Event(), asyncio.Event()
        self._is_open.set()
        self._writers: set[asyncio.StreamWriter] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        server = await asyncio.start_server(self._forward, sock=self._listener)
        self._started.set()
        await self._closing.wait()
        server.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _forward(self, near: asyncio.StreamReader, to_near: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        self._writers.add(to_near)
        to_far = None
        try:
            await self._is_open.wait()
            far, to_far = await asyncio.open_connection("127.0.0.1", self._to_port)
            self._writers.add(to_far)
            async with asyncio.TaskGroup() as group:
                group.create_task(self._pump(near, to_far, search=False))
                group.create_task(self._pump(far, to_near, search=True))
        except* (OSError, asyncio.CancelledError):
            pass  # an end has closed
        finally:
            for writer in (to_near, to_far):
                if writer is not None:
                    self._writers.discard(writer)
                    writer.transport.abort()
            self._tasks.discard(task)

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, *, search: bool) -> None:
        waiting: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue()

        async def deliver() -> None:
            while True:
                due_s, data = await waiting.get()
                await asyncio.sleep(due_s - self._loop.time())
                await self._is_open.wait()
                if not data:
                    writer.write_eof()
                    return
                writer.write(data)
                await writer.drain()

        async with asyncio.TaskGroup() as group:
            group.create_task(deliver())
            before = b""
            while True:
                data = await reader.read(65536)
                waiting.put_nowait((self._loop.time() + self.delay_s, data))
                if not data:
                    break
                if search:
                    before = self._search(before + data)
                    self.received += len(data)

    def _search(self, data: bytes) -> bytes:
        if self._search_for is not None and (found := self._search_for.search(data)):
            self.matches.append(data[max(0, found.start() - 80) : found.end() + 80])
        return data[-_OVERLAP:]
