"""A listening TCP port and the connections it has accepted.

At most ``READ_BYTES`` are read from a connection at a time, so that no client delays the others for long. After a full
read, it is not read for a while, so that a flood of bytes takes a fifth of a processor at most. A connection whose
replies stay unread is closed. If the other end has vanished, the system notices it within a minute.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import socket
import time
from typing import cast

from gateway.transport.handler import Accept, ConnectionHandler, ConnectionRefused, NewConnection, TakeOver
from gateway.transport.listening import NETWORK_SCHEMES, listen, split_address, url_host

#: Bytes of a read: about a hundred commands, half a second of a serial line, two milliseconds of work.
READ_BYTES = 512
#: Pause after a full read: seconds, and a multiple of the seconds that processing took; the longer of both applies.
READ_PAUSE, PAUSE_FACTOR = 0.05, 4.0
#: Bytes of unread replies after which a connection is closed.
MAX_UNREAD_BYTES = 65536
#: Seconds that a client gets to read the last bytes before the connection is closed.
LINGER_TIME = 2.0
#: Seconds between two checks whether a client that sends no more has got all its replies.
CHECK_PERIOD = 0.02
#: Seconds without data before a keep-alive probe, seconds between probes, and their number; and milliseconds after
#: which unacknowledged replies end the connection. No system has all of these options.
KEEPALIVE = {"TCP_KEEPIDLE": 30, "TCP_KEEPALIVE": 30, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 3, "TCP_USER_TIMEOUT": 60_000}


class _Connection(asyncio.BufferedProtocol):
    def __init__(self, port: TcpPort) -> None:
        self._port = port
        self._handler: ConnectionHandler | None = None
        self._transport: asyncio.Transport | None = None
        self._buffer = bytearray(READ_BYTES)
        self._view = memoryview(self._buffer)
        #: The replies to the bytes that are being processed, collected to be sent together; None at other times.
        self._replies: list[bytes] | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        stream = cast(asyncio.Transport, transport)  # uvloop's own class does not derive from it
        self._transport = stream
        stream.set_write_buffer_limits(high=MAX_UNREAD_BYTES)
        _enable_keepalive(stream.get_extra_info("socket"))
        peer = stream.get_extra_info("peername") or ("?", 0)
        host = str(peer[0])
        name = f"{url_host(host)}:{peer[1]}"
        try:
            self._handler = self._port.accept(NewConnection(name, host, self._write, self._hang_up, self._hand_over))
        except ConnectionRefused:
            stream.abort()
            return
        self._port.connections.add(self)

    def get_buffer(self, sizehint: int) -> bytearray:
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        began = time.perf_counter()
        self._process(bytes(self._view[:nbytes]))
        if nbytes == READ_BYTES and self._transport is not None and not self._transport.is_closing():
            self._transport.pause_reading()
            pause = max(READ_PAUSE, PAUSE_FACTOR * (time.perf_counter() - began))
            asyncio.get_running_loop().call_later(pause, self._resume_reading)

    def _process(self, data: bytes) -> None:
        """Process bytes, and send the replies to them together."""
        replies: list[bytes] = []
        self._replies = replies
        if self._handler is not None:
            self._handler.feed(data)
        self._replies = None
        if replies:
            self._write(replies[0] if len(replies) == 1 else b"".join(replies))

    def _resume_reading(self) -> None:
        if self._transport is not None and not self._transport.is_closing():
            self._transport.resume_reading()

    def eof_received(self) -> bool:
        """Close the connection when the client, which sends no more but may still read, has got all its replies."""
        if self._handler is not None:
            self._handler.peer_closed()
        self._close_when_answered()
        return True

    def _close_when_answered(self) -> None:
        if self._transport is None or self._transport.is_closing():
            return
        if self._handler is None or self._handler.all_answered:
            self._transport.close()
        else:
            asyncio.get_running_loop().call_later(CHECK_PERIOD, self._close_when_answered)

    def _write(self, data: bytes) -> int:
        """Send bytes, or collect them while received bytes are processed. Return how many are still to be sent."""
        if self._replies is not None:
            self._replies.append(data)
        elif self._transport is not None and not self._transport.is_closing():
            if data:
                self._transport.write(data)
            return self._transport.get_write_buffer_size()
        return 0

    def pause_writing(self) -> None:
        """Close the connection of a client that does not read, rather than keep its replies for ever."""
        self.abort()

    def _hang_up(self, last_bytes: bytes) -> None:
        """Send the last bytes, then discard input for a while before closing: the system resets a connection that is
        closed with unread input, and then the client might miss the last bytes.
        """
        loop = asyncio.get_running_loop()
        if last_bytes:
            self._write(last_bytes)
        self._close_handler()
        loop.call_soon(self._send_eof)  # after the replies to the bytes being processed
        loop.call_later(LINGER_TIME, self.abort)

    def _hand_over(self, take_transport: TakeOver) -> None:
        """Give the connection to a new owner, who sets another asyncio protocol."""
        self._close_and_forget()
        transport, self._transport = self._transport, None
        if transport is not None and not transport.is_closing():
            if not transport.is_reading():
                transport.resume_reading()
            take_transport(transport)

    def _send_eof(self) -> None:
        if self._transport is not None and not self._transport.is_closing():
            self._transport.write_eof()

    def abort(self) -> None:
        self._close_and_forget()
        if self._transport is not None:
            self._transport.abort()

    def _close_and_forget(self) -> None:
        """Close the handler and forget the connection."""
        self._port.connections.discard(self)
        self._close_handler()

    def _close_handler(self) -> None:
        handler, self._handler = self._handler, None
        if handler is not None:
            handler.close()

    def connection_lost(self, exc: Exception | None) -> None:
        self._close_and_forget()


def _enable_keepalive(connection: socket.socket) -> None:
    """Let the system detect that the other end has vanished."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in KEEPALIVE.items():
        with contextlib.suppress(OSError, AttributeError):
            connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


class TcpPort:
    """A listening TCP port; ``address`` is its address with the real port number."""

    def __init__(self, accept: Accept) -> None:
        self.accept = accept
        self.connections: set[_Connection] = set()
        self.address = ""
        self._server: asyncio.Server | None = None

    @classmethod
    async def open(cls, address: str, accept: Accept) -> TcpPort:
        """Open ``SCHEME://HOST:PORT``, of the form that ``listen`` describes. Raises UserError if that fails."""
        self = cls(accept)
        self._server, self.address = await listen(address, lambda: _Connection(self))
        return self

    async def close(self) -> None:
        if self._server is not None:
            self._server.close()
            for connection in list(self.connections):
                connection.abort()
            await asyncio.sleep(0)


def is_exposed(address: str) -> bool:
    """Whether the real address of a port, ``SCHEME://HOST:PORT``, can be reached from other computers."""
    if not address.startswith(NETWORK_SCHEMES):
        return False
    try:
        return not ipaddress.ip_address(split_address(address)[0]).is_loopback
    except ValueError:
        return True
