"""A listening TCP port, and the connections it has accepted.

Whoever connects can do no more to the others than take its turn: little is read of a connection at a time, one that
sends without end waits in between, one that does not read its replies is let go, and one whose other side has vanished
is found out by the system within a minute.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import socket
import time
from typing import cast

from gateway.transport.handler import Arrive, ConnectionHandler, ConnectionRefused, Taker
from gateway.transport.intake import LATE, SHARE, SKIM, Pace, unrepeated
from gateway.transport.listening import LISTENING, in_brackets, listen, split_address

#: Unread replies a connection may pile up before it is given up.
SLOW_READER = 65536
#: Seconds that whoever is to go is given to read what it was told last.
PARTING = 2.0
#: How often it is looked whether a connection that sends no more has been answered, seconds.
LOOK = 0.02
#: A silent connection is asked for a sign of life after so many seconds, every so many, so many times; replies that
#: nobody acknowledges (milliseconds) are the same sign. By the names the system has for it; not every one has all.
ALIVE = {"TCP_KEEPIDLE": 30, "TCP_KEEPALIVE": 30, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 3, "TCP_USER_TIMEOUT": 60_000}


class _Connection(asyncio.BufferedProtocol):
    def __init__(self, port: TcpPort) -> None:
        self._port = port
        self._guest: ConnectionHandler | None = None
        self._transport: asyncio.Transport | None = None
        self._buffer = bytearray(SHARE)
        self._view = memoryview(self._buffer)
        #: After a share that only ended motions, that share: what repeats it is passed over.
        self._share = b""
        #: Since when there has been more to read than is read at a time.
        self._behind_since: float | None = None
        #: What was read together and is taken in share by share.
        self._rest = b""
        #: While bytes are being taken in: the replies to them, which go out as one.
        self._replies: list[bytes] | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        stream = cast(asyncio.Transport, transport)  # uvloop's own class does not derive from it
        self._transport = stream
        stream.set_write_buffer_limits(high=SLOW_READER)
        _watch(stream.get_extra_info("socket"))
        peer = stream.get_extra_info("peername") or ("?", 0)
        try:
            self._guest = self._port.arrive(f"{in_brackets(str(peer[0]))}:{peer[1]}", str(peer[0]), self._write)
        except ConnectionRefused:
            stream.abort()
            return
        self._port.connections.add(self)
        self._guest.network(self._hang_up, self._hand_over)

    def get_buffer(self, sizehint: int) -> bytearray:
        return self._port.skimmed if self._share else self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        if not self._share:
            data = bytes(self._view[:nbytes])
            if nbytes < SHARE:
                self._behind_since = None  # though this may be a gap in what still comes
                self._answer(data)
            else:
                self._answer_share(data)
            return
        self._rest = unrepeated(self._share, bytes(memoryview(self._port.skimmed)[:nbytes]))
        self._take_share(nbytes >= SHARE)

    def _answer(self, data: bytes) -> None:
        """Take bytes in; the replies to them go out as one."""
        replies: list[bytes] = []
        self._replies = replies
        if self._guest is not None:
            self._guest.feed(data)
        self._replies = None
        if replies:
            self._write(replies[0] if len(replies) == 1 else b"".join(replies))

    def _answer_share(self, data: bytes) -> None:
        """The same where there may be more at once: others are read before this connection is again."""
        began = time.perf_counter()
        self._answer(data)
        took = time.perf_counter() - began
        if self._transport is None or self._transport.is_closing():
            return
        ended = self._guest is not None and self._guest.ended
        self._share = (self._share + data)[-SHARE:] if ended else b""
        self._transport.pause_reading()
        loop = asyncio.get_running_loop()
        now = loop.time()
        self._behind_since = self._behind_since or now
        late = now - self._behind_since > LATE
        loop.call_later(self._port.pace.pause(now, took, late), self._go_on)

    def _take_share(self, more: bool) -> None:
        """The next share of what was read together."""
        data, self._rest = self._rest[:SHARE], self._rest[SHARE:]
        if more or self._rest:
            self._answer_share(data)
        else:
            self._answer(data)
            self._share = b""

    def _go_on(self) -> None:
        if self._transport is None or self._transport.is_closing():
            return
        if self._rest:
            self._take_share(False)
        if not self._rest:
            self._transport.resume_reading()

    def eof_received(self) -> bool:
        """The other side sends no more, but it may still read: it is told what is due to it before this side closes."""
        if self._guest is not None:
            self._guest.gone()
        self._close_when_answered()
        return True

    def _close_when_answered(self) -> None:
        if self._transport is None or self._transport.is_closing():
            return
        if self._guest is None or self._guest.answered:
            self._transport.close()
        else:
            asyncio.get_running_loop().call_later(LOOK, self._close_when_answered)

    def _write(self, data: bytes) -> int:
        """Send bytes, which may be none -> how many of this connection the system has not taken yet."""
        if self._replies is not None:
            self._replies.append(data)
        elif self._transport is not None and not self._transport.is_closing():
            if data:
                self._transport.write(data)
            return self._transport.get_write_buffer_size()
        return 0

    def pause_writing(self) -> None:
        """The other side does not read: let it go rather than hold its replies for ever."""
        self.abort()

    def _hang_up(self, last: bytes) -> None:
        """Say this, and that it was the last; what still comes is thrown away for a while.

        Were the connection closed while bytes of the other side are unread, the system would reset it, and the other
        side might never read what it was told.
        """
        loop = asyncio.get_running_loop()
        if last:
            self._write(last)
        self._dismiss()
        loop.call_soon(self._say_no_more)  # after the replies to the bytes that are being taken in
        loop.call_later(PARTING, self.abort)

    def _hand_over(self, take: Taker) -> None:
        """Leave the connection to somebody else, who gives it another protocol of the event loop."""
        self._leave()
        transport, self._transport = self._transport, None
        if transport is not None and not transport.is_closing():
            if not transport.is_reading():
                transport.resume_reading()
            take(transport)

    def _say_no_more(self) -> None:
        if self._transport is not None and not self._transport.is_closing():
            self._transport.write_eof()

    def abort(self) -> None:
        self._leave()
        if self._transport is not None:
            self._transport.abort()

    def _leave(self) -> None:
        """Nothing more is heard of it or said to it, and it is no connection of the port's any more."""
        self._port.connections.discard(self)
        self._dismiss()

    def _dismiss(self) -> None:
        guest, self._guest = self._guest, None
        if guest is not None:
            guest.close()

    def connection_lost(self, exc: Exception | None) -> None:
        self._leave()


def _watch(connection: socket.socket) -> None:
    """Have the system find out when the other side has vanished without a word."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in ALIVE.items():
        with contextlib.suppress(OSError, AttributeError):
            connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


class TcpPort:
    """A listening TCP port; ``where`` names the real one."""

    def __init__(self, arrive: Arrive) -> None:
        self.arrive = arrive
        self.connections: set[_Connection] = set()
        self.pace = Pace()
        #: Where reads in large pieces go, and are looked at before anybody else reads.
        self.skimmed = bytearray(SKIM)
        self.where = ""
        self._server: asyncio.Server | None = None

    @classmethod
    async def open(cls, where: str, arrive: Arrive) -> TcpPort:
        """``SCHEME://HOST:PORT``; without a host this computer only; port 0 takes any free one. Raises UserError.

        The address ``[::]`` is every one of this computer, of both kinds.
        """
        self = cls(arrive)
        self._server, self.where = await listen(where, lambda: _Connection(self))
        return self

    async def close(self) -> None:
        if self._server is not None:
            self._server.close()
            for connection in list(self.connections):
                connection.abort()
            await asyncio.sleep(0)


def exposed(where: str) -> bool:
    """Whether ``SCHEME://HOST:PORT``, as a port tells it, can be reached from another computer."""
    if not where.startswith(LISTENING):
        return False
    try:
        return not ipaddress.ip_address(split_address(where)[0]).is_loopback
    except ValueError:
        return True
