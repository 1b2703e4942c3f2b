"""Network connections within the process: the test does by hand what the listening port would do."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterable
from itertools import cycle
from typing import Any

from gateway.transport.handler import NewConnection
from gateway.transport.rfc2217 import with_telnet


class Caller:
    """One connection over ``tcp`` or ``rfc2217``; ``heard`` is all it received, ``gone`` whether the gateway closed it.

    With ``trusted`` it counts as local: the gateway does not treat it as a connection from the network.
    """

    def __init__(
        self, acceptor: Any, transport: str = "tcp", host: str = "127.0.0.1", number: int = 50000, trusted: bool = False
    ) -> None:
        self.heard = b""
        self.gone = False
        self._told = asyncio.Event()
        arrive = with_telnet(acceptor.accept) if transport == "rfc2217" else acceptor.accept
        hang_up = None if trusted else self._hang_up
        self.guest = arrive(NewConnection(f"{host}:{number}", host, self._hear, hang_up))

    def _hear(self, data: bytes) -> None:
        assert not self.gone, "the gateway sends something after closing the connection"
        self.heard += data
        self._told.set()

    def _hang_up(self, last: bytes) -> None:
        self.heard += last
        self._told.set()
        self.gone = True
        self.guest.close()

    def tell(self, data: bytes) -> None:
        if not self.gone:
            self.guest.feed(data)

    async def dribble(self, data: bytes, pauses: Iterable[float]) -> None:
        """Send one byte after the other, until the connection is closed."""
        for byte, pause in zip(data, cycle(pauses), strict=False):
            if self.gone:
                return
            self.tell(bytes((byte,)))
            await asyncio.sleep(pause)

    async def ask(self, data: bytes, seconds: float = 10.0) -> bytes:
        """Send bytes and return the first that come back, or nothing after this many seconds."""
        before = len(self.heard)
        self._told.clear()
        self.tell(data)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while len(self.heard) == before:
                    await self._told.wait()
                    self._told.clear()
        return self.heard[before:]

    def close(self) -> None:
        if not self.gone:
            self.guest.close()
