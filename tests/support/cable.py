"""The cable between a gateway and its simulated mount: it can be pulled out, plugged in, or lose single commands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class Cable:
    """The port is missing between ``pull`` and ``plug``; bytes that are on their way then are lost."""

    def __init__(self, bridge: Any) -> None:
        self._line = bridge.controller.line
        self._open = self._line.wire.open
        self._line.wire.open = self._reopen
        self._out = False

    async def _reopen(self, on_data: Any, on_lost: Any) -> None:
        if self._out:
            raise OSError("no such port")
        await self._open(on_data, on_lost)

    def pull(self) -> None:
        self._out = True
        self._line.wire._on_data = None
        self._line.transaction.connection_lost("pulled out")

    def plug(self) -> None:
        self._out = False


def lose_commands(bridge: Any, beginnings: tuple[bytes, ...], times: int = 1) -> list[bytes]:
    """Make the mount miss the next commands with these beginnings; return the list of those it has missed."""
    wire = bridge.controller.line.wire
    missed: list[bytes] = []
    feed = wire.feed

    def hear(data: bytes) -> bytes:
        if data.startswith(beginnings) and len(missed) < times:
            missed.append(data)
            return b""
        return bytes(feed(data))

    wire.feed = hear
    return missed


def lose_replies(bridge: Any, beginnings: tuple[bytes, ...], times: int) -> list[bytes]:
    """Lose the replies to the next commands with these beginnings, which the mount executes; return the commands."""
    wire = bridge.controller.line.wire
    heard: list[bytes] = []
    feed = wire.feed

    def hear(data: bytes) -> bytes:
        answer = bytes(feed(data))
        if data.startswith(beginnings) and len(heard) < times:
            heard.append(data)
            return b""
        return answer

    wire.feed = hear
    return heard


def swallow(bridge: Any, wanted: Callable[[bytes], bool], times: int = 1, *, carried_out: bool = False) -> list[bytes]:
    """The next requests that are wanted never reach the mount, or only their answers are lost -> those so far."""
    wire = bridge.controller.line.wire
    good, lost = wire.feed, []

    def feed(data: bytes) -> bytes:
        if len(lost) < times and wanted(data):
            lost.append(data)
            if carried_out:
                good(data)
            return b""
        return bytes(good(data))

    wire.feed = feed
    return lost
