"""A virtual serial port: a raw pseudo-terminal behind a symbolic link that keeps its name."""

from __future__ import annotations

import asyncio
import contextlib
import os
import struct
import zlib

from gateway.errors import UserError
from gateway.ports.guest import Arrive
from gateway.ports.uart import misread

#: Linux: struct termios2, whose last number is the output rate itself.
TCGETS2, TERMIOS2 = 0x802C542A, struct.Struct("=4IB19s2I")


class PtyPort:
    """A virtual serial port: a raw pseudo-terminal behind a symbolic link that keeps its name.

    The slave stays open here, so programs may open and close it at will. A link left over from a crash is replaced; one
    that another gateway holds, or a file of any other kind, is not. With ``baud`` it is as picky as a real one: a
    program that has set its end to another rate is not understood, and understands nothing.
    """

    def __init__(self, path: str, arrive: Arrive, baud: int | None = None) -> None:
        try:
            import tty
        except ImportError:
            raise UserError("pty: there are no pseudo-terminals on this system; use a serial port pair") from None
        self.baud = baud
        self.path = os.path.abspath(os.path.expanduser(path))
        self.where = f"pty:{self.path}"
        self._lock_name, self._lock = _lock_for(self.path)
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self._device = os.ttyname(self._slave)
        try:
            _link(self._device, self.path)
        except OSError as error:
            self._close_files()
            raise UserError(f"cannot make {self.path}: {error.strerror}") from None
        self._guest = arrive(self.path, f"pty:{self.path}", self._write)
        asyncio.get_running_loop().add_reader(self._master, self._read)

    def _read(self) -> None:
        try:
            data = os.read(self._master, 4096)
        except (BlockingIOError, OSError):
            return
        if self.baud is not None:
            data = misread(data, speed(self._slave), self.baud)
        if data:
            self._guest.feed(data)

    def _write(self, data: bytes) -> None:
        """Nobody may be reading: what does not fit is lost, as on a wire."""
        if self.baud is not None:
            data = misread(data, self.baud, speed(self._slave))
        with contextlib.suppress(OSError):
            os.write(self._master, data)

    def _close_files(self) -> None:
        with contextlib.suppress(OSError):
            os.unlink(self._lock_name)
        for number in (self._master, self._slave, self._lock):
            with contextlib.suppress(OSError):
                os.close(number)

    async def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self._master)
        self._guest.close()
        if os.path.islink(self.path) and os.readlink(self.path) == self._device:
            os.unlink(self.path)
        self._close_files()


def speed(terminal: int) -> int:
    """The baud rate that a terminal is set to; 0 when it cannot be told. Rates without a name count, too (Linux)."""
    import fcntl
    import termios

    with contextlib.suppress(OSError):
        held = fcntl.ioctl(terminal, TCGETS2, bytes(TERMIOS2.size))
        return int(TERMIOS2.unpack(held)[-1])
    return int(termios.tcgetattr(terminal)[5])


def _lock_for(path: str) -> tuple[str, int]:
    """Hold a lock for a link's name, so that two gateways cannot share it. Raises UserError."""
    import fcntl
    import tempfile

    name = os.path.join(tempfile.gettempdir(), f"mount-gateway-{zlib.crc32(path.encode()):08x}.lock")
    number = os.open(name, os.O_CREAT | os.O_RDWR, 0o666)
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(number)
        raise UserError(f"cannot make {path}: another gateway holds it") from None
    return name, number


def _link(device: str, path: str) -> None:
    """Point a symbolic link at the device, in the place of an older link. Raises OSError."""
    if os.path.islink(path):
        os.unlink(path)
    os.symlink(device, path)
