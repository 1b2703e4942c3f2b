"""The connection to the mount: opens it, writes, and calls back with the received bytes.

pyserial blocks, so a serial connection has a reader thread that passes bytes to the event loop. Every URL that
``serial.serial_for_url`` accepts works. A simulated mount in this process is reached through the same interface.
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

from gateway.core.waiting import run_in_thread

if TYPE_CHECKING:
    from serial import Serial

#: The baud rate of hand controls and telescopes at power-on.
DEFAULT_BAUD = 9600

#: The group that may use serial ports on most systems.
SERIAL_GROUP = "dialout"

OnData = Callable[[bytes], None]
OnLost = Callable[[str], None]
#: Seconds that a read waits, and bytes read from a socket at a time.
READ_TIMEOUT, CHUNK_BYTES = 0.25, 4096


#: Why a port cannot be opened: (system error numbers, part of pyserial's message, number and message to raise).
_OPEN_FAILURES = (
    ((errno.ENOENT,), "No such file", errno.ENOENT, "no such port"),
    ((errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK), "lock", errno.EBUSY, "the port is in use by another program"),
    ((errno.EACCES,), "Permission denied", errno.EACCES, "permission denied; {who}"),
    ((errno.EISDIR,), "Is a directory", errno.EISDIR, "this is a folder, not a serial port"),
    ((errno.ENOTTY,), "Inappropriate ioctl", errno.ENOTTY, "this is not a serial port"),
    ((), "FileNotFoundError", errno.ENOENT, "no such port"),  # as pyserial says it on Windows
    ((), "PermissionError", errno.EBUSY, "the port is in use by another program"),  # there it means that
    ((), "refused", errno.ECONNREFUSED, "no program listens there (connection refused)"),
)


class Transport(Protocol):
    name: str

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        """Open the port: ``on_data`` gets received bytes, ``on_lost`` the reason if it is lost. Raises OSError."""

    def write(self, data: bytes) -> None:
        """Send bytes. Raises OSError if the port is closed or lost."""

    async def close(self) -> None: ...


class DescriptorWatcher(Protocol):
    """Is informed when a line opens, with its file descriptor, and when it closes."""

    def opened(self, descriptor: int) -> None: ...
    def closed(self) -> None: ...


class SerialTransport:
    """A line to a mount at any pyserial URL: a device, ``socket://``, ``rfc2217://``, ``hwgrep://``, ``spy://`` …"""

    def __init__(self, url: str, baud: int = DEFAULT_BAUD, watcher: DescriptorWatcher | None = None) -> None:
        self.name, self.baud, self._watcher = url, baud, watcher
        self._port: Serial | None = None
        self._thread: threading.Thread | None = None

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        """Open the port and start its reader thread. Raises OSError with a reason that the user understands."""
        loop = asyncio.get_running_loop()
        port = await loop.run_in_executor(None, open_port, self.name, self.baud)
        self._port = port
        descriptor = descriptor_of(port)
        if self._watcher is not None and descriptor is not None:
            self._watcher.opened(descriptor)
        self._thread = threading.Thread(
            target=self._read, args=(port, loop, on_data, on_lost), name=f"read {self.name}", daemon=True
        )
        self._thread.start()

    def _read(self, port: Serial, loop: asyncio.AbstractEventLoop, on_data: OnData, on_lost: OnLost) -> None:
        """Pass on received bytes until the port is closed or lost (in the reader thread)."""
        try:
            while self._port is port:
                data = port.read(1)
                if data:
                    try:
                        data += self._read_available(port)
                    finally:  # if the connection ends now, the byte still counts
                        loop.call_soon_threadsafe(on_data, bytes(data))
        except Exception as error:  # pyserial has many kinds of failure, and each must be reported
            if self._port is port and not loop.is_closed():
                loop.call_soon_threadsafe(on_lost, str(error))

    def _read_available(self, port: Serial) -> bytes:
        """Return the bytes available after the first byte, without waiting for more."""
        if not self.name.startswith("socket://"):
            waiting = port.in_waiting
            return bytes(port.read(waiting)) if waiting else b""
        port.timeout = 0  # pyserial's socket reports 1 byte, however many there are
        rest = port.read(CHUNK_BYTES)
        port.timeout = READ_TIMEOUT
        return bytes(rest)

    def write(self, data: bytes) -> None:
        if self._port is None:
            raise OSError(errno.ENODEV, "port is closed")
        written = self._port.write(data)
        if written is not None and written != len(data):
            raise OSError(errno.EIO, f"only {written} of {len(data)} bytes could be written")

    def set_baud(self, baud: int) -> None:
        """Change the baud rate of the port at once. Raises OSError if it is not open or does not support the rate."""
        try:
            assert self._port is not None
            self._port.baudrate = baud
        except Exception as error:  # ValueError, SerialException or termios.error
            raise OSError(errno.EINVAL, f"{baud} baud: {error}") from None
        self.baud = baud

    async def apply_baud(self) -> None:
        """Change to the rate ``baud`` as soon as all bytes are sent. A port that cannot change keeps its rate."""
        port = self._port
        if port is not None:
            with contextlib.suppress(OSError):
                await asyncio.get_running_loop().run_in_executor(None, port.flush)
                self.set_baud(self.baud)

    async def close(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            if self._watcher is not None:
                self._watcher.closed()
            await run_in_thread(self._close_port, port)

    def _close_port(self, port: Serial) -> None:
        cancel = getattr(port, "cancel_read", None)
        if cancel is not None:
            cancel()
        if self._thread is not None:
            self._thread.join(1.0)
        unlock_port(port)
        port.close()


def bytes_on_wire(url: str, data: bytes) -> bytes:
    """Return bytes as the port sends them: RFC 2217 doubles 0xFF, which begins a Telnet command."""
    return data.replace(b"\xff", b"\xff\xff") if url.startswith("rfc2217://") else data


def descriptor_of(port: Serial) -> int | None:
    """Return the file descriptor of an open port; None if it has none."""
    for holder in (port, getattr(port, "_socket", None)):
        with contextlib.suppress(AttributeError, OSError, ValueError):
            return int(holder.fileno())  # type: ignore[union-attr]
    return None


def unlock_port(port: Serial) -> None:
    """End the exclusive lock of a port; else it would last while another process has a copy of its descriptor."""
    descriptor = descriptor_of(port)
    if descriptor is not None and os.name == "posix":
        import fcntl

        with contextlib.suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_UN)


def open_port(url: str, baud: int) -> Serial:
    """Open a serial URL for exclusive use. Raises OSError with a readable reason."""
    import serial

    timeout: float | None = 2.0
    opened = url
    if url.startswith("rfc2217://"):
        timeout = None  # pyserial's RFC 2217 client supports none
        # ser2net does not confirm DTR and RTS if the port has no such lines; no mount needs them
        opened += "" if "ign_set_control" in url else "&ign_set_control" if "?" in url else "?ign_set_control"
    try:
        return serial.serial_for_url(opened, baudrate=baud, timeout=READ_TIMEOUT, write_timeout=timeout, exclusive=True)
    except serial.SerialException as error:
        number = getattr(error, "errno", None)
        text = str(error)
        if isinstance(error.__context__, socket.gaierror):
            raise OSError(
                errno.ENOENT,
                f"no address is known for the name {urlsplit(url).hostname}; write its number, like 192.168.1.50",
            ) from None
        for numbers, part, reason, message in _OPEN_FAILURES:
            if number in numbers or part in text:
                raise OSError(reason, message.format(who=_permission_advice(url))) from None
        if url.startswith(("socket://", "rfc2217://")) and "NoneType" in text:
            raise OSError(errno.EINVAL, "the port number is missing, for example socket://192.168.1.50:4030") from None
        raise OSError(number or errno.EIO, text.rpartition(": ")[2] or text) from None
    except ValueError as error:
        raise OSError(
            errno.EINVAL,
            f"{error}; write socket://HOST:PORT, rfc2217://HOST:PORT or a serial port "
            "(a surface for programs: tcp://HOST:PORT or pty:PATH)",
        ) from None


#: Connects to a simulated mount. The argument delivers bytes after some seconds. Returns a function: bytes -> reply.
SimulatedConnection = Callable[[Callable[[float, bytes], None]], Callable[[bytes], bytes]]


class SimulatedTransport:
    """A simulated mount in this process; ``latency`` is its response time in seconds."""

    def __init__(self, name: str, connect: SimulatedConnection, latency: float = 0.0) -> None:
        self.name, self._latency = name, latency
        self._on_data: OnData | None = None
        self.feed = connect(self._deliver_later)

    def _deliver_later(self, seconds: float, answer: bytes) -> None:
        """Deliver an answer of the simulated mount after these seconds and the latency."""
        asyncio.get_running_loop().call_later(self._latency + seconds, self.deliver, answer)

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        self._on_data = on_data

    def write(self, data: bytes) -> None:
        answer = self.feed(data)
        if answer:
            loop = asyncio.get_running_loop()
            if self._latency:
                loop.call_later(self._latency, self.deliver, answer)
            else:
                loop.call_soon(self.deliver, answer)

    def deliver(self, answer: bytes) -> None:
        if self._on_data is not None:
            self._on_data(answer)

    async def close(self) -> None:
        self._on_data = None


def _permission_advice(device: str) -> str:
    """Return what the user can do, by the port's group and mode, to be allowed to open it."""
    with contextlib.suppress(OSError):
        if os.stat(device).st_mode & 0o060 != 0o060:
            return (
                f"no group may use {device}: plug in a USB adapter, which has a name like "
                f"/dev/ttyUSB0; if the mount is at {device}, allow it: sudo chgrp {SERIAL_GROUP} {device} && sudo "
                f"chmod 660 {device}"
            )
    advice = f"sudo usermod -aG {group_of(device)} $USER puts you into the group that may use it"
    return f"{advice} (then log out and in again)"


def group_of(device: str) -> str:
    """Return the group that may use a serial port; the usual group if that is unknown, or is root or wheel."""
    try:
        import grp

        name = grp.getgrgid(os.stat(device).st_gid).gr_name
    except (ImportError, KeyError, OSError):
        return SERIAL_GROUP
    return SERIAL_GROUP if name in ("root", "wheel") else name
