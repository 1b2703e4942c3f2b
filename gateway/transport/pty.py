"""A virtual serial port: a raw pseudo-terminal behind a name that stays the same.

Programs open and close it at will. A connection begins with the first byte, and ends when the last program has closed
the port. A pseudo-terminal reports that by a hang-up, but only while the gateway itself does not hold the programs'
end open. (Linux reports the hang-up continuously, so edge-triggered epoll is used. On other systems the gateway holds
that end open: there is one connection.) The end of a connection discards unread replies, settings and locks.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import select
import struct
from collections.abc import Callable

from gateway.core.errors import UserError
from gateway.transport.baud import garble
from gateway.transport.device_link import DeviceLink, set_serial_permissions
from gateway.transport.handler import Accept, ConnectionHandler, NewConnection

#: Linux: struct termios2, whose last member is the output rate in baud.
TCGETS2, TERMIOS2 = 0x802C542A, struct.Struct("=4IB19s2I")
#: Maximum number of bytes of a read, and number of reads until other connections are served.
CHUNK_BYTES, READS_PER_TURN = 4096, 8


class PtyPort:
    """A virtual serial port. Raises UserError if the system has no pseudo-terminals, or the path cannot be used.

    It accepts every baud rate and setting, without effect. With ``baud`` it behaves like a real port: if a program
    has set another rate, the bytes in both directions are garbled.
    """

    def __init__(self, path: str, accept: Accept, baud: int | None = None) -> None:
        try:
            import tty  # noqa: F401
        except ImportError:
            raise UserError("pty: there are no pseudo-terminals on this system; use a serial port pair") from None
        self.baud = baud
        self._accept = accept
        self._handler: ConnectionHandler | None = None
        #: Whether the program that sent the newest bytes has closed its end; a reply would reach the next program.
        self._peer_closed = False
        self._link = DeviceLink(path)
        self.path = self._link.path
        self.address = f"pty:{self.path}"
        try:
            self._pair = self._new_pair()
        except UserError:
            self._link.close()
            raise

    def _new_pair(self) -> _TerminalPair:
        try:
            pair = _TerminalPair(self._read)
        except OSError as error:
            raise UserError(f"cannot make {self.path}: no pseudo-terminal: {error.strerror}") from None
        try:
            self._link.create(pair.device)
        except UserError:
            pair.close()
            raise
        return pair

    def _read(self) -> None:
        """Read everything that is available, and notice that the last program has closed its end."""
        pair = self._pair
        for _ in range(READS_PER_TURN):
            try:
                data = os.read(pair.master, CHUNK_BYTES)
            except BlockingIOError:
                return
            except OSError:
                self._disconnect()
                return
            closed = pair.is_hung_up()
            if closed:
                data += pair.read_rest()
                closed = pair.is_hung_up()  # else the next program may have sent some of it
            if self.baud is not None:
                data = garble(data, baud_rate_of(pair.master), self.baud)
            if self._handler is None:
                self._handler = self._accept(NewConnection(self.path, self.address, self._write))
            self._peer_closed = closed
            if data:
                self._handler.feed(data)
            if closed:
                self._disconnect()
                return
        pair.read_later()

    def _write(self, data: bytes) -> None:
        """Write without blocking. If no program reads, bytes that do not fit in the buffer are lost, as on a wire."""
        if self._handler is None or self._peer_closed:
            return
        if self.baud is not None:
            data = garble(data, self.baud, baud_rate_of(self._pair.master))
        with contextlib.suppress(OSError):
            os.write(self._pair.master, data)

    def _disconnect(self) -> None:
        """End the connection after the last program has closed its end, and reset the port for the next program."""
        handler, self._handler, self._peer_closed = self._handler, None, False
        if handler is not None:
            handler.close()
        if not self._pair.reset():
            self._pair.close()
            self._pair = self._new_pair()

    async def close(self) -> None:
        handler, self._handler = self._handler, None
        if handler is not None:
            handler.close()
        self._link.close()
        self._pair.close()


class _TerminalPair:
    """A pseudo-terminal: ``master``, the end that ``on_readable`` reads, and ``device``, the path of the other end."""

    def __init__(self, on_readable: Callable[[], None]) -> None:
        import tty

        self._closed = False
        self.master, slave = os.openpty()
        self.device = os.ttyname(slave)
        self._on_readable = on_readable
        tty.setraw(slave)
        set_serial_permissions(self.device)
        os.set_blocking(self.master, False)
        self._slave, self._epoll = slave, None
        if hasattr(select, "epoll"):
            os.close(slave)
            self._slave, self._epoll = -1, select.epoll()
            self._epoll.register(self.master, select.EPOLLIN | select.EPOLLET)
            self._epoll.poll(0)  # discard the event that it is not open yet
            self._hang_up_poll = select.poll()
            self._hang_up_poll.register(self.master, 0)
        asyncio.get_running_loop().add_reader(self._watched_descriptor, self._on_event)

    @property
    def _watched_descriptor(self) -> int:
        return self.master if self._epoll is None else self._epoll.fileno()

    def _on_event(self) -> None:
        if self._closed:
            return
        if self._epoll is not None:
            self._epoll.poll(0)  # consume the event
        self._on_readable()

    def read_later(self) -> None:
        """Schedule another read: epoll does not report remaining bytes again."""
        asyncio.get_running_loop().call_soon(self._on_event)

    def is_hung_up(self) -> bool:
        """Whether no program has the terminal open; always False on systems that do not report it."""
        return self._epoll is not None and any(event & select.POLLHUP for _, event in self._hang_up_poll.poll(0))

    def read_rest(self) -> bytes:
        rest = b""
        while True:
            try:
                rest += os.read(self.master, CHUNK_BYTES)
            except OSError:
                return rest

    def reset(self) -> bool:
        """Discard unread bytes and settings of the last program. Return False if it has left the device locked.
        The exclusive lock (TIOCEXCL, which INDI sets) of a real port ends when the port is closed. A pseudo-terminal
        that stays open keeps the lock, and then only root can open it.
        """
        import fcntl
        import termios
        import tty

        try:
            slave = os.open(self.device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            return error.errno != errno.EBUSY
        fcntl.ioctl(slave, termios.TIOCNXCL)
        tty.setraw(slave)  # this also discards unread bytes
        termios.tcflush(slave, termios.TCIFLUSH)  # also bytes that had no room in the buffer
        os.close(slave)
        if self._epoll is not None and any(event & select.EPOLLIN for _, event in self._epoll.poll(0)):
            self.read_later()  # the next program has written already
        return True

    def close(self) -> None:
        self._closed = True
        asyncio.get_running_loop().remove_reader(self._watched_descriptor)
        if self._epoll is not None:
            self._epoll.close()
        for descriptor in (self.master, self._slave):
            with contextlib.suppress(OSError):
                os.close(descriptor)


def baud_rate_of(terminal: int) -> int:
    """Return the baud rate of a terminal, also a non-standard rate (Linux); 0 if none is set."""
    import fcntl
    import termios

    with contextlib.suppress(OSError):
        attributes = fcntl.ioctl(terminal, TCGETS2, bytes(TERMIOS2.size))
        return int(TERMIOS2.unpack(attributes)[-1])
    return int(termios.tcgetattr(terminal)[5])
