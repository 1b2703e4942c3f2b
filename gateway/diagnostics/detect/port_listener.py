"""An open port, listened to: opened once, kept open from the first question to the last.

Opening a port is what a device notices: the operating system raises DTR and RTS together, and boards of the Arduino
kind restart when DTR rises. No program can prevent that edge on POSIX, so there is exactly one: rates are changed on
the open port, and the driver's line is lent this wire instead of opening it again. The two lines are left as the system
put them. Lowering them afterwards would be one edge more for each, one after the other, which is the very sequence that
resets an ESP32; and a level shifter fed from them would go dead just while it is being asked.
"""

from __future__ import annotations

import asyncio
from typing import Protocol

from gateway.transport.wires import OnData, OnLost, Transport

#: Seconds between two looks at what has arrived.
TICK = 0.02


class Tunable(Transport, Protocol):
    """A wire whose rate can be changed while it is open."""

    def set_baud(self, baud: int) -> None:
        """Raises OSError for a rate that the port does not have."""


class PortListener:
    """Hears an open wire. It is a wire itself, which ``MountLink`` may open and close at will: the port stays open."""

    def __init__(self, wire: Tunable) -> None:
        self.name, self._wire = wire.name, wire
        self.heard = b""
        self.lost = ""
        self._last = 0.0
        self._on_data: OnData | None = None
        self._on_lost: OnLost | None = None

    async def begin(self) -> None:
        """Open the port. Raises OSError with a reason a person understands."""
        await self._wire.open(self._arrived, self._vanished)
        self._last = self.now()

    async def end(self) -> None:
        """Close the port."""
        await self._wire.close()

    # --- what it is for -------------------------------------------------------------------------------------------

    def tune(self, baud: int) -> None:
        """Go on at another rate; what was heard at the old one means nothing. Raises OSError."""
        self._wire.set_baud(baud)
        self.forget()

    def forget(self) -> None:
        """Begin to listen anew."""
        self.heard = b""
        self._last = self.now()

    def now(self) -> float:
        """The loop's time, seconds."""
        return asyncio.get_running_loop().time()

    @property
    def still(self) -> float:
        """Seconds since the last byte arrived, or since listening began."""
        return self.now() - self._last

    async def tick(self) -> None:
        """Let a moment pass. Raises OSError when the port is gone."""
        await asyncio.sleep(TICK)
        if self.lost:
            raise OSError(self.lost)

    # --- as a wire ------------------------------------------------------------------------------------------------

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        """Lend the wire. Raises OSError when the port is gone."""
        if self.lost:
            raise OSError(self.lost)
        self._on_data, self._on_lost = on_data, on_lost

    def write(self, data: bytes) -> None:
        """Raises OSError when the port is gone."""
        self._wire.write(data)

    async def close(self) -> None:
        """Give the wire back."""
        self._on_data = self._on_lost = None

    def _arrived(self, data: bytes) -> None:
        self._last = self.now()
        if self._on_data is not None:
            self._on_data(data)
        else:
            self.heard = (self.heard + data)[-4096:]

    def _vanished(self, reason: str) -> None:
        self.lost = reason or "the port is gone"
        if self._on_lost is not None:
            self._on_lost(reason)
