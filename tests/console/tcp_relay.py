"""A relay between a browser and a page, on loopback: it holds bytes back, stalls as lost networks do, and listens."""

import asyncio
import contextlib
import re
import socket
import threading
from types import TracebackType
from typing import Self

_OVERLAP = 64
"""Bytes that are looked at twice: a word may come in two parts."""


class TcpRelay:
    """Carries connections to a port of this machine while it is entered; from any thread."""

    def __init__(self, to_port: int, delay_s: float = 0.0, listens_for: re.Pattern[bytes] | None = None) -> None:
        """Take a port.

        Args:
            to_port: where it leads.
            delay_s: what each byte is held back, on its way there and on its way back.
            listens_for: what is looked for in everything that the other end says.
        """
        self.delay_s = delay_s
        self.heard: list[bytes] = []
        """What was found, with what stood around it."""
        self.carried = 0
        """Bytes that came back."""
        self._to_port = to_port
        self._listens_for = listens_for
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
        self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join(10)

    def stall(self) -> None:
        """Carry nothing more, and tell nobody: a phone that has left its network."""
        self._loop.call_soon_threadsafe(self._passes.clear)

    def mend(self, *, cut: bool) -> None:
        """Carry again; what was under way arrives late, or never where the connections were `cut`."""

        def mended() -> None:
            if cut:
                for writer in self._writers:
                    writer.transport.abort()
            self._passes.set()

        self._loop.call_soon_threadsafe(mended)

    def _run(self) -> None:
        with contextlib.closing(self._loop):
            self._loop.run_until_complete(self._serve())

    async def _serve(self) -> None:
        self._passes, self._over = asyncio.Event(), asyncio.Event()
        self._passes.set()
        self._writers: set[asyncio.StreamWriter] = set()
        self._carrying: set[asyncio.Task[None]] = set()
        server = await asyncio.start_server(self._carry, sock=self._listener)
        self._started.set()
        await self._over.wait()
        server.close()
        for task in self._carrying:
            task.cancel()
        await asyncio.gather(*self._carrying, return_exceptions=True)

    async def _carry(self, near: asyncio.StreamReader, to_near: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._carrying.add(task)
        self._writers.add(to_near)
        to_far = None
        try:
            await self._passes.wait()
            far, to_far = await asyncio.open_connection("127.0.0.1", self._to_port)
            self._writers.add(to_far)
            async with asyncio.TaskGroup() as group:
                group.create_task(self._pump(near, to_far, listens=False))
                group.create_task(self._pump(far, to_near, listens=True))
        except* (OSError, asyncio.CancelledError):
            pass  # one end has gone
        finally:
            for writer in (to_near, to_far):
                if writer is not None:
                    self._writers.discard(writer)
                    writer.transport.abort()
            self._carrying.discard(task)

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, *, listens: bool) -> None:
        waiting: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue()

        async def deliver() -> None:
            while True:
                due_s, data = await waiting.get()
                await asyncio.sleep(due_s - self._loop.time())
                await self._passes.wait()
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
                if listens:
                    before = self._listen(before + data)
                    self.carried += len(data)

    def _listen(self, said: bytes) -> bytes:
        if self._listens_for is not None and (found := self._listens_for.search(said)):
            self.heard.append(said[max(0, found.start() - 80) : found.end() + 80])
        return said[-_OVERLAP:]
