"""Ports: where clients come in. TCP, a pseudo-terminal with a stable name, a real serial port.

A port knows nothing of protocols: for every connection it asks ``arrive`` for somebody to feed, and hands back what
that one writes. Clients come and go at any moment; what one of them does to its connection never reaches another.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import tempfile
import zlib
from collections.abc import Callable
from typing import Any, Protocol, cast

from gateway.errors import UserError
from gateway.wires import SerialWire

#: Unread replies a connection may pile up before it is given up.
SLOW_READER = 65536


class Guest(Protocol):
    """Whoever talks to one connection."""

    def feed(self, data: bytes) -> None: ...
    def close(self) -> None: ...


#: (who it is, the host it comes from, how to write to it) -> its guest.
Arrive = Callable[[str, str, Callable[[bytes], Any]], Guest]


class Port(Protocol):
    """Something that is open until it is closed; ``where`` is its name with the real numbers in it."""

    where: str

    async def close(self) -> None: ...


async def open_port(where: str, arrive: Arrive) -> Port:
    """Open ``tcp://HOST:PORT``, ``pty:PATH`` or a serial port. Raises UserError that says what is wrong."""
    if where.startswith("tcp://"):
        return await TcpPort.open(where, arrive)
    if where.startswith("pty:"):
        if not where[4:]:
            raise UserError("pty: needs a path, for example pty:/tmp/lx200")
        return PtyPort(where[4:], arrive)
    if "://" not in where and not where.startswith(("/", "~", ".", "COM")):
        raise UserError(f"{where}: write tcp://HOST:PORT, pty:PATH or the name of a serial port")
    return await SerialPort.open(where, arrive)


# --- TCP --------------------------------------------------------------------------------------------------------


class _Connection(asyncio.Protocol):
    """One TCP connection."""

    def __init__(self, port: TcpPort) -> None:
        self._port = port
        self._guest: Guest | None = None
        self._transport: asyncio.Transport | None = None
        self._feed: Callable[[bytes], None] = lambda data: None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        stream = cast(asyncio.Transport, transport)  # uvloop's own class does not derive from it
        self._transport = stream
        stream.set_write_buffer_limits(high=SLOW_READER)
        peer = stream.get_extra_info("peername") or ("?", 0)
        self._guest = self._port.arrive(f"{peer[0]}:{peer[1]}", str(peer[0]), stream.write)
        self._feed = self._guest.feed
        self._port.connections.add(self)

    def data_received(self, data: bytes) -> None:
        self._feed(data)

    def pause_writing(self) -> None:
        """The other side does not read: let it go rather than hold its replies for ever."""
        self.abort()

    def abort(self) -> None:
        if self._transport is not None:
            self._transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._port.connections.discard(self)
        if self._guest is not None:
            self._guest.close()


class TcpPort:
    """A listening TCP port."""

    def __init__(self, arrive: Arrive) -> None:
        self.arrive = arrive
        self.connections: set[_Connection] = set()
        self.where = ""
        self._server: asyncio.Server | None = None

    @classmethod
    async def open(cls, where: str, arrive: Arrive) -> TcpPort:
        """``tcp://HOST:PORT``; without a host this computer only; port 0 takes any free one."""
        host, port = split_address(where)
        self = cls(arrive)
        try:
            self._server = await asyncio.get_running_loop().create_server(lambda: _Connection(self), host, port)
        except OSError as error:
            reason = "the port is in use" if "in use" in str(error) else error.strerror or str(error)
            if "assign requested" in str(error):
                reason = "this computer has no such address"
            raise UserError(f"cannot listen on {where}: {reason}") from None
        real = self._server.sockets[0].getsockname()
        shown = f"[{real[0]}]" if ":" in real[0] else real[0]
        self.where = f"tcp://{shown}:{real[1]}"
        return self

    async def close(self) -> None:
        if self._server is not None:
            self._server.close()
            for connection in list(self.connections):
                connection.abort()
            await asyncio.sleep(0)


def split_address(where: str) -> tuple[str, int]:
    """``tcp://HOST:PORT`` -> (host, port). Raises UserError."""
    host, colon, number = where.removeprefix("tcp://").rpartition(":")
    if number.lstrip("-").isdigit() and not 0 <= int(number) <= 65535:
        raise UserError(f"{where}: a port is a number from 0 (any free one) to 65535")
    if not colon or not number.isdigit():
        raise UserError(f"{where}: write tcp://HOST:PORT, for example tcp://127.0.0.1:4030")
    return host.strip("[]") or "127.0.0.1", int(number)


# --- pseudo-terminal --------------------------------------------------------------------------------------------


class PtyPort:
    """A virtual serial port: a raw pseudo-terminal behind a symbolic link that keeps its name.

    The slave stays open here, so programs may open and close it at will. A link left over from a crash is replaced; one
    that another gateway holds, or a file of any other kind, is not.
    """

    def __init__(self, path: str, arrive: Arrive) -> None:
        try:
            import tty
        except ImportError:
            raise UserError("pty: there are no pseudo-terminals on this system; use a serial port pair") from None
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
        if data:
            self._guest.feed(data)

    def _write(self, data: bytes) -> None:
        """Nobody may be reading: what does not fit is lost, as on a wire."""
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


def _lock_for(path: str) -> tuple[str, int]:
    """Hold a lock for a link's name, so that two gateways cannot share it. Raises UserError."""
    import fcntl

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


# --- serial -----------------------------------------------------------------------------------------------------


class SerialPort:
    """A real serial port, or any pyserial URL, with one client behind it."""

    def __init__(self, url: str) -> None:
        self.where = url
        self._wire = SerialWire(url)
        self._guest: Guest | None = None
        self._reopening: asyncio.Task[None] | None = None

    @classmethod
    async def open(cls, url: str, arrive: Arrive) -> SerialPort:
        """Raises UserError when the port cannot be opened now; later losses are waited out."""
        self = cls(url)
        self._guest = arrive(url, url, self._write)
        try:
            await self._wire.open(self._guest.feed, self._lost)
        except OSError as error:
            raise UserError(f"cannot open {url}: {error.strerror or error}") from None
        return self

    def _write(self, data: bytes) -> None:
        with contextlib.suppress(OSError):
            self._wire.write(data)

    def _lost(self, reason: str) -> None:
        self._reopening = asyncio.get_running_loop().create_task(self._reopen())

    async def _reopen(self) -> None:
        assert self._guest is not None
        while True:
            await self._wire.close()
            await asyncio.sleep(1.0)
            try:
                await self._wire.open(self._guest.feed, self._lost)
            except OSError:
                continue
            return

    async def close(self) -> None:
        if self._reopening is not None:
            self._reopening.cancel()
        if self._guest is not None:
            self._guest.close()
        await self._wire.close()
