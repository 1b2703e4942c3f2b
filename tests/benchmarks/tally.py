"""A counting TCP proxy between a gateway and a simulated hand control, and clients that poll."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Sequence

import processes


class Tally:
    """Forwards one TCP port to another and records when how many bytes passed."""

    def __init__(self, target: int) -> None:
        self._target = target
        self._passed: list[tuple[float, int]] = []
        self._requests: list[float] = []
        self._server: asyncio.Server | None = None
        self._writers: list[asyncio.StreamWriter] = []
        self._closed = asyncio.Event()

    async def open(self) -> int:
        """Listen and return the port."""
        self._server = await asyncio.start_server(self._forward, processes.HOST, 0)
        return int(self._server.sockets[0].getsockname()[1])

    async def _forward(self, near: asyncio.StreamReader, back: asyncio.StreamWriter) -> None:
        far, on = await asyncio.open_connection(processes.HOST, self._target)
        self._writers += [back, on]
        await asyncio.gather(self._pass(near, on, True), self._pass(far, back, False))
        self._closed.set()

    async def _pass(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, request: bool) -> None:
        """Forward data until either side has closed."""
        with contextlib.suppress(ConnectionError):
            while data := await reader.read(4096):
                now = asyncio.get_running_loop().time()
                self._passed.append((now, len(data)))
                if request:
                    self._requests.append(now)
                writer.write(data)
        writer.close()

    def rate(self, began: float, ended: float) -> float:
        """Return bytes per second, both directions together, between two loop times."""
        return sum(size for at, size in self._passed if began <= at < ended) / (ended - began)

    def busiest(self, began: float, ended: float, span: float) -> int:
        """Return the largest number of requests within ``span`` seconds."""
        times = [at for at in self._requests if began <= at < ended]
        return max((sum(first <= at < first + span for at in times) for first in times), default=0)

    async def close(self) -> None:
        """Close both connections and wait for data that is on its way."""
        if self._server is not None:
            self._server.close()
        for writer in self._writers:
            writer.close()
        if self._writers:
            await asyncio.wait_for(self._closed.wait(), processes.PATIENCE)


async def poll(port: int, questions: Sequence[bytes], rate: float, delay: float) -> None:
    """Send the same requests ``rate`` times a second, beginning after ``delay``, until cancelled."""
    reader, writer = await asyncio.open_connection(processes.HOST, port)
    loop = asyncio.get_running_loop()
    due = loop.time() + delay
    try:
        while True:
            await asyncio.sleep(max(0.0, due - loop.time()))
            due += 1.0 / rate
            for question in questions:
                writer.write(question)
                await reader.readuntil(b"#")
    finally:
        writer.close()
