"""A real serial port, or any pyserial URL, for one client. A lost port is opened again."""

from __future__ import annotations

import asyncio
import contextlib
import errno

from gateway.core.errors import UserError
from gateway.transport.handler import Accept, ConnectionHandler, NewConnection
from gateway.transport.wires import SerialTransport

#: Seconds between two attempts to open a lost port.
REOPEN_DELAY = 1.0
#: What the user can do if the port at which programs should connect does not exist.
MISSING_PORT_ADVICE = (
    "; a program opens one end of a pair of ports and the gateway the other: make the pair first. On Linux and "
    "macOS, pty:/tmp/port makes both"
)


class SerialPort:
    """Listens on a serial port or pyserial URL; it has one connection, which lasts until ``close``."""

    def __init__(self, url: str, baud: int) -> None:
        self.address, self._baud = url, baud
        self._transport = SerialTransport(url, baud)
        self._handler: ConnectionHandler | None = None
        self._reopen_task: asyncio.Task[None] | None = None
        self._baud_change_task: asyncio.Task[None] | None = None

    @classmethod
    async def open(cls, url: str, accept: Accept, baud: int = 9600) -> SerialPort:
        """Open the port. Raises UserError if that is not possible now; if it is lost later, it is opened again."""
        self = cls(url, baud)
        self._handler = accept(NewConnection(url, url, self._write, change_baud=self._change_baud))
        try:
            await self._transport.open(self._handler.feed, self._on_lost)
        except OSError as error:
            advice = MISSING_PORT_ADVICE if error.errno == errno.ENOENT and "://" not in url else ""
            raise UserError(f"cannot open {url}: {error.strerror or error}{advice}") from None
        return self

    def _write(self, data: bytes) -> None:
        with contextlib.suppress(OSError):
            self._transport.write(data)

    def _change_baud(self, baud: int) -> int:
        """Change the baud rate as soon as all bytes are sent. Return the previous rate."""
        previous, self._transport.baud = self._transport.baud, baud
        self._baud_change_task = asyncio.get_running_loop().create_task(self._transport.apply_baud())
        return previous

    def _on_lost(self, reason: str) -> None:
        self._transport.baud = self._baud  # a device that comes back has been switched off meanwhile
        self._reopen_task = asyncio.get_running_loop().create_task(self._reopen())

    async def _reopen(self) -> None:
        assert self._handler is not None
        while True:
            await self._transport.close()
            await asyncio.sleep(REOPEN_DELAY)
            try:
                await self._transport.open(self._handler.feed, self._on_lost)
            except OSError:
                continue
            return

    async def close(self) -> None:
        for task in (self._reopen_task, self._baud_change_task):
            if task is not None:
                task.cancel()
        if self._handler is not None:
            self._handler.close()
        await self._transport.close()
