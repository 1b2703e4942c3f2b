"""Answers at the pace of a serial line: a reply leaves some milliseconds after the last byte of its request.

Programs that were developed with real hand controls write a command, discard their unread input, and then read. A real
hand control never answers before the input is discarded; over a pseudo-terminal it would. Commands take effect at once.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from msgspec.structs import replace

from gateway.transport.handler import ConnectionHandler, NewConnection

#: Seconds from the last byte of a request to its reply, for programs that were developed with real hand controls.
HARDWARE_REPLY_TIME = 0.006


class PacedHandler:
    """Sends a connection's replies ``delay`` seconds after the last request; ``accept`` makes the real handler."""

    def __init__(
        self, connection: NewConnection, accept: Callable[[NewConnection], ConnectionHandler], delay: float
    ) -> None:
        self._write_bytes, self._delay = connection.write, delay
        self._loop = asyncio.get_running_loop()
        self._reply_due_at = 0.0
        self._delayed_bytes = b""
        self._timer: asyncio.TimerHandle | None = None
        change = connection.change_baud
        self._handler = accept(
            replace(
                connection,
                write=self._send,
                hand_over=None,
                change_baud=None if change is None else lambda baud: self._change_baud(change, baud),
            )
        )

    def feed(self, data: bytes) -> None:
        self._reply_due_at = self._loop.time() + self._delay
        self._handler.feed(data)

    def _send(self, data: bytes) -> int | None:
        """Send a reply when it is due. Return how many bytes are unsent; None if unknown."""
        if data and (self._delayed_bytes or self._loop.time() < self._reply_due_at):
            self._delayed_bytes += data
            if self._timer is None:
                self._timer = self._loop.call_at(self._reply_due_at, self.flush)
        unsent = self._write_bytes(b"" if self._delayed_bytes else data)
        return None if unsent is None else unsent + len(self._delayed_bytes)

    def flush(self) -> None:
        """Send the waiting replies now."""
        data, self._delayed_bytes = self._delayed_bytes, b""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if data:
            self._write_bytes(data)

    def _change_baud(self, change_baud: Callable[[int], int], baud: int) -> int:
        """Change the baud rate after sending the acknowledgement at the old rate. Return the old rate."""
        self.flush()
        return change_baud(baud)

    @property
    def all_answered(self) -> bool:
        return self._handler.all_answered and not self._delayed_bytes

    def peer_closed(self) -> None:
        self._handler.peer_closed()

    def close(self) -> None:
        """End the connection, and drop the waiting replies, because the program has disconnected."""
        self._delayed_bytes = b""
        self.flush()
        self._handler.close()


def delay_replies(
    accept: Callable[[NewConnection], ConnectionHandler], delay: float
) -> Callable[[NewConnection], ConnectionHandler]:
    """Return a function like ``accept`` whose handlers reply ``delay`` seconds later; ``accept`` itself if 0."""
    return (lambda connected: PacedHandler(connected, accept, delay)) if delay else accept
