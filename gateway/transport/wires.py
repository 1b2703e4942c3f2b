"""The connection to the mount: opens it, writes, and calls back with what arrives.

pyserial blocks, so a serial connection has one reader thread that hands bytes to the event loop. Every URL that
``serial.serial_for_url`` opens works. A simulated mount is a connection, too.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import socket
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from serial import Serial

#: What hand controls and telescopes speak at power-on.
BAUD = 9600

#: The group that may use serial ports on most systems.
USUAL_GROUP = "dialout"

OnData = Callable[[bytes], None]
OnLost = Callable[[str], None]
#: How long a read waits, in seconds, and how many bytes are taken from a socket at a time.
TIMEOUT, CHUNK = 0.25, 4096


#: Why a port cannot be opened: the system's numbers or a part of pyserial's words -> the number and the words here.
_REASONS = (
    ((errno.ENOENT,), "No such file", errno.ENOENT, "no such port"),
    ((errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK), "lock", errno.EBUSY, "the port is in use by another program"),
    (
        (errno.EACCES,),
        "Permission denied",
        errno.EACCES,
        "permission denied; sudo usermod -aG {group} $USER puts you into the group that may use it "
        "(then log out and in again)",
    ),
    ((errno.EISDIR,), "Is a directory", errno.EISDIR, "this is a folder, not a serial port"),
    ((errno.ENOTTY,), "Inappropriate ioctl", errno.ENOTTY, "this is not a serial port"),
    ((), "refused", errno.ECONNREFUSED, "nobody listens there (connection refused)"),
)


class Transport(Protocol):
    name: str

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        """Raises OSError when the port cannot be opened."""

    def write(self, data: bytes) -> None:
        """Raises OSError when the port is gone."""

    async def close(self) -> None: ...


class Watched(Protocol):
    """Who is handed the descriptor of a line while it is open."""

    def opened(self, descriptor: int) -> None: ...
    def closed(self) -> None: ...


class SerialTransport:
    """Any pyserial URL: a device name, ``socket://``, ``rfc2217://``, ``hwgrep://``, ``spy://`` …"""

    def __init__(self, url: str, baud: int = BAUD, watched: Watched | None = None) -> None:
        self.name, self.baud, self._watched = url, baud, watched
        self._port: Serial | None = None
        self._thread: threading.Thread | None = None

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        """Open the port and start its reader. Raises OSError with a reason a person understands."""
        loop = asyncio.get_running_loop()
        port = await loop.run_in_executor(None, open_port, self.name, self.baud)
        self._port = port
        number = descriptor(port)
        if self._watched is not None and number is not None:
            self._watched.opened(number)
        self._thread = threading.Thread(
            target=self._read, args=(port, loop, on_data, on_lost), name=f"read {self.name}", daemon=True
        )
        self._thread.start()

    def _read(self, port: Serial, loop: asyncio.AbstractEventLoop, on_data: OnData, on_lost: OnLost) -> None:
        """Hand over whatever arrives, until the port is closed or lost."""
        try:
            while self._port is port:
                data = port.read(1)
                if data:
                    try:
                        data += self._rest(port)
                    finally:  # a byte and the end of the connection: the byte counts
                        loop.call_soon_threadsafe(on_data, bytes(data))
        except Exception as error:  # pyserial has many kinds of failure, and a reader that dies must say so
            if self._port is port and not loop.is_closed():
                loop.call_soon_threadsafe(on_lost, str(error))

    def _rest(self, port: Serial) -> bytes:
        """What is there besides the first byte, without waiting for more."""
        if not self.name.startswith("socket://"):
            waiting = port.in_waiting
            return bytes(port.read(waiting)) if waiting else b""
        port.timeout = 0  # a socket says that 1 byte waits, however many there are
        rest = port.read(CHUNK)
        port.timeout = TIMEOUT
        return bytes(rest)

    def write(self, data: bytes) -> None:
        if self._port is None:
            raise OSError(errno.ENODEV, "port is closed")
        written = self._port.write(data)
        if written is not None and written != len(data):
            raise OSError(errno.EIO, f"only {written} of {len(data)} bytes could be written")

    def set_baud(self, baud: int) -> None:
        """Change the rate of the open port, and nothing else. Raises OSError for a rate that it does not have."""
        try:
            assert self._port is not None
            self._port.baudrate = baud
        except Exception as error:  # ValueError, SerialException, termios.error: as the system has it
            raise OSError(errno.EINVAL, f"{baud} baud: {error}") from None
        self.baud = baud

    async def change_rate(self) -> None:
        """Go on at ``baud`` when what was written has left; a port that cannot keeps its rate."""
        port = self._port
        if port is not None:
            with contextlib.suppress(OSError):
                await asyncio.get_running_loop().run_in_executor(None, port.flush)
                self.set_baud(self.baud)

    async def close(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            if self._watched is not None:
                self._watched.closed()
            await asyncio.get_running_loop().run_in_executor(None, self._shut, port)

    def _shut(self, port: Serial) -> None:
        cancel = getattr(port, "cancel_read", None)
        if cancel is not None:
            cancel()
        if self._thread is not None:
            self._thread.join(1.0)
        unlock(port)
        port.close()


def on_the_wire(url: str, data: bytes) -> bytes:
    """Bytes as they go through the descriptor of a line: RFC 2217 doubles the byte that begins a telnet command."""
    return data.replace(b"\xff", b"\xff\xff") if url.startswith("rfc2217://") else data


def descriptor(port: Serial) -> int | None:
    """The file descriptor of an open port; None where it has none."""
    for holder in (port, getattr(port, "_socket", None)):
        with contextlib.suppress(AttributeError, OSError, ValueError):
            return int(holder.fileno())  # type: ignore[union-attr]
    return None


def unlock(port: Serial) -> None:
    """Give up the exclusive use of a port: a duplicate of its descriptor elsewhere would hold on to it."""
    number = descriptor(port)
    if number is not None and os.name == "posix":
        import fcntl

        with contextlib.suppress(OSError):
            fcntl.flock(number, fcntl.LOCK_UN)


def open_port(url: str, baud: int) -> Serial:
    """Open a serial URL for exclusive use. Raises OSError that says what is wrong."""
    import serial

    patience: float | None = 2.0
    opened = url
    if url.startswith("rfc2217://"):
        patience = None  # pyserial's RFC 2217 client knows none
        # ser2net leaves DTR and RTS unconfirmed where the port has no such lines; no mount needs them
        opened += "" if "ign_set_control" in url else "&ign_set_control" if "?" in url else "?ign_set_control"
    try:
        return serial.serial_for_url(opened, baudrate=baud, timeout=TIMEOUT, write_timeout=patience, exclusive=True)
    except serial.SerialException as error:
        number = getattr(error, "errno", None)
        text = str(error)
        if isinstance(error.__context__, socket.gaierror):
            raise OSError(
                errno.ENOENT,
                f"no address is known for the name {urlsplit(url).hostname}; write its number, like 192.168.1.50",
            ) from None
        for numbers, part, reason, words in _REASONS:
            if number in numbers or part in text:
                raise OSError(reason, words.format(group=group_of(url))) from None
        if url.startswith(("socket://", "rfc2217://")) and "NoneType" in text:
            raise OSError(errno.EINVAL, "the port number is missing, for example socket://192.168.1.50:4030") from None
        raise OSError(number or errno.EIO, text.rpartition(": ")[2] or text) from None
    except ValueError as error:
        raise OSError(
            errno.EINVAL,
            f"{error}; socket://HOST:PORT, rfc2217://HOST:PORT or a serial port will do, "
            "and where programs connect tcp://HOST:PORT or pty:PATH",
        ) from None


#: (how to send what comes after some seconds) -> (bytes in -> the bytes that are answered at once).
Connection = Callable[[Callable[[float, bytes], None]], Callable[[bytes], bytes]]


class SimulatedTransport:
    """A simulated mount in this process; ``latency`` is the time it takes to answer, in seconds."""

    def __init__(self, name: str, connection: Connection, latency: float = 0.0) -> None:
        self.name, self._latency = name, latency
        self._on_data: OnData | None = None
        self._feed = connection(self._later)

    def _later(self, seconds: float, answer: bytes) -> None:
        """Some answers come after a while."""
        asyncio.get_running_loop().call_later(self._latency + seconds, self._deliver, answer)

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        self._on_data = on_data

    def write(self, data: bytes) -> None:
        answer = self._feed(data)
        if answer:
            loop = asyncio.get_running_loop()
            if self._latency:
                loop.call_later(self._latency, self._deliver, answer)
            else:
                loop.call_soon(self._deliver, answer)

    def _deliver(self, answer: bytes) -> None:
        if self._on_data is not None:
            self._on_data(answer)

    async def close(self) -> None:
        self._on_data = None


def group_of(device: str) -> str:
    """The group that may use a serial port; the usual one where that cannot be told."""
    try:
        import grp

        name = grp.getgrgid(os.stat(device).st_gid).gr_name
    except (ImportError, KeyError, OSError):
        return USUAL_GROUP
    return USUAL_GROUP if name in ("root", "wheel") else name
