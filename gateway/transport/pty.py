"""A virtual serial port: a raw pseudo-terminal behind a name that stays.

Programs open and close it at will, and every opening is a connection of its own: it begins with the first byte, and
ends when the last program has closed its end. That moment a pseudo-terminal tells by hanging up, but only as long as
the gateway does not hold that end open itself; and it goes on to say so, which is why Linux's edge-triggered epoll is
asked. Elsewhere the gateway holds it open, and all of it is one connection.

What one program leaves behind never reaches the next: replies nobody read, settings, exclusive use.
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
from gateway.transport.baud import misread
from gateway.transport.device_link import DeviceLink, like_a_serial_port
from gateway.transport.handler import Arrive, ConnectionHandler

#: Linux: struct termios2, whose last number is the output rate itself.
TCGETS2, TERMIOS2 = 0x802C542A, struct.Struct("=4IB19s2I")
#: So much is read at a time, so many times before others have their turn.
CHUNK, TURNS = 4096, 8


class PtyPort:
    """A virtual serial port. Raises UserError when there is none on this system, or the name cannot be had.

    It takes every baud rate and every setting a program asks for, and heeds none. With ``baud`` it is as picky as a
    real one: a program that has set its end to another rate is not understood, and understands nothing.
    """

    def __init__(self, path: str, arrive: Arrive, baud: int | None = None) -> None:
        try:
            import tty  # noqa: F401
        except ImportError:
            raise UserError("pty: there are no pseudo-terminals on this system; use a serial port pair") from None
        self.baud = baud
        self._arrive = arrive
        self._guest: ConnectionHandler | None = None
        #: Whoever has said what is heard just now has closed it: the answers would be read by the next.
        self._gone = False
        self._link = DeviceLink(path)
        self.path = self._link.path
        self.where = f"pty:{self.path}"
        try:
            self._pair = self._new_pair()
        except UserError:
            self._link.close()
            raise

    def _new_pair(self) -> _Pair:
        try:
            pair = _Pair(self._read)
        except OSError as error:
            raise UserError(f"cannot make {self.path}: no pseudo-terminal: {error.strerror}") from None
        try:
            self._link.point(pair.device)
        except UserError:
            pair.close()
            raise
        return pair

    def _read(self) -> None:
        """Take everything that is there; notice that the last program has closed its end."""
        pair = self._pair
        for _ in range(TURNS):
            try:
                data = os.read(pair.master, CHUNK)
            except BlockingIOError:
                return
            except OSError:
                self._leave()
                return
            gone = pair.hung_up()
            if gone:
                data += pair.last_words()
                gone = pair.hung_up()  # else some of it may be the next program's already, who waits for an answer
            if self.baud is not None:
                data = misread(data, speed(pair.master), self.baud)
            if self._guest is None:
                self._guest = self._arrive(self.path, self.where, self._write)
            self._gone = gone
            if data:
                self._guest.feed(data)
            if gone:
                self._leave()
                return
        pair.look_again()

    def _write(self, data: bytes) -> None:
        """Nobody may be reading: what does not fit is lost, as on a wire."""
        if self._guest is None or self._gone:
            return
        if self.baud is not None:
            data = misread(data, self.baud, speed(self._pair.master))
        with contextlib.suppress(OSError):
            os.write(self._pair.master, data)

    def _leave(self) -> None:
        """Nobody has it open any more: the connection ends, and the port is as new for the next."""
        guest, self._guest, self._gone = self._guest, None, False
        if guest is not None:
            guest.close()
        if not self._pair.freshen():
            self._pair.close()
            self._pair = self._new_pair()

    async def close(self) -> None:
        guest, self._guest = self._guest, None
        if guest is not None:
            guest.close()
        self._link.close()
        self._pair.close()


class _Pair:
    """The two ends of a pseudo-terminal: ``master`` is read when ``look`` is called, ``device`` is for programs."""

    def __init__(self, look: Callable[[], None]) -> None:
        import tty

        self._closed = False
        self.master, slave = os.openpty()
        self.device = os.ttyname(slave)
        self._look = look
        tty.setraw(slave)
        like_a_serial_port(self.device)
        os.set_blocking(self.master, False)
        self._held, self._epoll = slave, None
        if hasattr(select, "epoll"):
            os.close(slave)
            self._held, self._epoll = -1, select.epoll()
            self._epoll.register(self.master, select.EPOLLIN | select.EPOLLET)
            self._epoll.poll(0)  # that nobody has opened it yet is no news
            self._open = select.poll()
            self._open.register(self.master, 0)
        asyncio.get_running_loop().add_reader(self._watched, self._wake)

    @property
    def _watched(self) -> int:
        return self.master if self._epoll is None else self._epoll.fileno()

    def _wake(self) -> None:
        if self._closed:
            return
        if self._epoll is not None:
            self._epoll.poll(0)  # else it goes on to tell the same
        self._look()

    def look_again(self) -> None:
        """There is more; it will not be told once more."""
        asyncio.get_running_loop().call_soon(self._wake)

    def hung_up(self) -> bool:
        """Whether no program has it open; always False where that is not told."""
        return self._epoll is not None and any(event & select.POLLHUP for _, event in self._open.poll(0))

    def last_words(self) -> bytes:
        words = b""
        while True:
            try:
                words += os.read(self.master, CHUNK)
            except OSError:
                return words

    def freshen(self) -> bool:
        """Forget what the last program has left -> False when it has left it locked.

        Exclusive use (TIOCEXCL, which INDI asks for) ends with the last closing of a real port. A pseudo-terminal that
        lives on keeps it, and only root may open that one ever again.
        """
        import fcntl
        import termios
        import tty

        try:
            slave = os.open(self.device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            return error.errno != errno.EBUSY
        fcntl.ioctl(slave, termios.TIOCNXCL)
        tty.setraw(slave)  # and throws away what was not read
        termios.tcflush(slave, termios.TCIFLUSH)  # also what had no room to be read yet
        os.close(slave)
        if self._epoll is not None and any(event & select.EPOLLIN for _, event in self._epoll.poll(0)):
            self.look_again()  # the next program was quick
        return True

    def close(self) -> None:
        self._closed = True
        asyncio.get_running_loop().remove_reader(self._watched)
        if self._epoll is not None:
            self._epoll.close()
        for number in (self.master, self._held):
            with contextlib.suppress(OSError):
                os.close(number)


def speed(terminal: int) -> int:
    """The baud rate that a terminal is set to; 0 when it cannot be told. Rates without a name count, too (Linux)."""
    import fcntl
    import termios

    with contextlib.suppress(OSError):
        held = fcntl.ioctl(terminal, TCGETS2, bytes(TERMIOS2.size))
        return int(TERMIOS2.unpack(held)[-1])
    return int(termios.tcgetattr(terminal)[5])
