"""A port that is opened once and kept open from the first query to the last.

Devices notice when a port is opened: the operating system raises DTR and RTS together, and Arduino boards restart when
DTR rises. No program can prevent this rise on POSIX, but it happens only once: baud rates are changed on the open port,
and the driver's link uses this transport instead of opening the port again. DTR and RTS stay as the system set them.
Lowering them one after the other is the sequence that resets an ESP32, and a level shifter that is powered from these
lines would lose its supply during the query.
"""

from __future__ import annotations

import asyncio
from typing import Protocol

from gateway.transport.wires import OnData, OnLost, Transport

#: Seconds between two checks for received bytes.
CHECK_PERIOD = 0.02


class BaudTransport(Transport, Protocol):
    """A transport whose baud rate can be changed while it is open."""

    def set_baud(self, baud: int) -> None:
        """Set the baud rate. Raises OSError if the port does not support it."""


class PortListener:
    """Collects the bytes that an open port receives. It is also a transport for a ``MountLink``, which may open and
    close it: the port itself stays open.
    """

    def __init__(self, transport: BaudTransport) -> None:
        self.name, self._transport = transport.name, transport
        self.received = b""  # the last 4096 bytes that arrived while no caller had opened this transport
        self.loss_reason = ""  # empty while the port is there
        self._last_byte_at = 0.0
        self._on_data: OnData | None = None
        self._on_lost: OnLost | None = None

    async def open_port(self) -> None:
        """Open the port and begin to listen. Raises OSError, with a reason for users, if it cannot be opened."""
        await self._transport.open(self._on_received, self._on_port_lost)
        self._last_byte_at = self.now()

    async def close_port(self) -> None:
        """Close the port."""
        await self._transport.close()

    # --- listening ------------------------------------------------------------------------------------------------

    def change_baud(self, baud: int) -> None:
        """Change the baud rate and discard received bytes. Raises OSError if the port does not support the rate."""
        self._transport.set_baud(baud)
        self.discard_received()

    def discard_received(self) -> None:
        """Discard all received bytes and restart the measurement of silence."""
        self.received = b""
        self._last_byte_at = self.now()

    def now(self) -> float:
        """Return the event loop's time in seconds."""
        return asyncio.get_running_loop().time()

    @property
    def quiet_seconds(self) -> float:
        """Seconds since the last byte arrived, or since listening began."""
        return self.now() - self._last_byte_at

    async def wait_briefly(self) -> None:
        """Wait for `CHECK_PERIOD`. Raises OSError if the port has disappeared."""
        await asyncio.sleep(CHECK_PERIOD)
        if self.loss_reason:
            raise OSError(self.loss_reason)

    # --- as a transport -------------------------------------------------------------------------------------------

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        """Pass received bytes to this caller from now on. Raises OSError if the port has disappeared."""
        if self.loss_reason:
            raise OSError(self.loss_reason)
        self._on_data, self._on_lost = on_data, on_lost

    def write(self, data: bytes) -> None:
        """Send bytes. Raises OSError if the port has disappeared."""
        self._transport.write(data)

    async def close(self) -> None:
        """Stop passing received bytes to the caller of ``open``; the port stays open."""
        self._on_data = self._on_lost = None

    def _on_received(self, data: bytes) -> None:
        self._last_byte_at = self.now()
        if self._on_data is not None:
            self._on_data(data)
        else:
            self.received = (self.received + data)[-4096:]

    def _on_port_lost(self, reason: str) -> None:
        self.loss_reason = reason or "the port is gone"
        if self._on_lost is not None:
            self._on_lost(reason)
