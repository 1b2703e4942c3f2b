"""RFC 2217: a serial port over TCP with settings and modem lines, for programs that need a COM port.

Such a client begins to negotiate (Telnet, RFC 854) as soon as it is connected. Until then the connection is plain: no
Telnet bytes are sent and 0xFF is data, so that clients without Telnet can connect, too. No command of a mount contains
0xFF followed by WILL, WONT, DO or DONT, and none ends with 0xFF.

pyserial implements RFC 2217 but needs a port, and there is none: settings such as the baud rate are accepted without
effect, and the modem lines report a connected device.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from msgspec.structs import replace
from serial.rfc2217 import M_NORMAL, PortManager

from gateway.transport.handler import Accept, NewConnection

IAC = b"\xff"
#: IAC followed by any of these begins Telnet: WILL, WONT, DO, DONT.
NEGOTIATION = frozenset(b"\xfb\xfc\xfd\xfe")
#: The longest valid subnegotiation has 6 bytes, or a signature; anything longer is dropped.
MAX_SUBNEGOTIATION_BYTES = 256


class NullSerialPort:
    """Stands for a serial port in pyserial's server; its modem lines report a device that is ready."""

    def __init__(self) -> None:
        self.baudrate, self.bytesize, self.parity, self.stopbits = 9600, 8, "N", 1
        self.xonxoff = self.rtscts = self.break_condition = self.ri = False
        self.dtr = self.rts = self.cts = self.dsr = self.cd = True

    def reset_input_buffer(self) -> None:
        """Do nothing: received bytes are processed at once."""

    def reset_output_buffer(self) -> None:
        """Do nothing: replies are sent at once."""


#: pyserial's types require a real port; any object with its interface works.
_port_manager: Callable[[Any, Any], PortManager] = PortManager


class _TelnetFilter:
    """Removes and answers Telnet commands of clients that use Telnet; passes all other bytes to the real handler."""

    def __init__(self, accept: Accept, new_connection: NewConnection) -> None:
        self.write = new_connection.write
        self._pending_iac = b""
        self._telnet: PortManager | None = None
        hang_up = new_connection.hang_up
        self._handler = accept(
            replace(
                new_connection,
                write=self._send,
                hang_up=None if hang_up is None else lambda last: hang_up(self._escape_iac(last)),
                hand_over=None,
            )
        )

    def feed(self, data: bytes) -> None:
        data = self._detect_telnet(data) if self._telnet is None else self._strip_telnet(data)
        if data:
            self._handler.feed(data)

    def _send(self, data: bytes) -> int | None:
        """Send what the real handler writes. Return how many bytes are unsent; None if unknown."""
        return self.write(self._escape_iac(data))

    def _escape_iac(self, data: bytes) -> bytes:
        return data if self._telnet is None else data.replace(IAC, IAC + IAC)

    def _detect_telnet(self, data: bytes) -> bytes:
        """Return the data of a connection that does not use Telnet yet; if Telnet begins in it, switch to Telnet."""
        data, self._pending_iac = self._pending_iac + data, b""
        at = data.find(IAC)
        while at >= 0:
            if data[at:] == IAC:
                self._pending_iac = IAC
                return data[:at]
            if data[at + 1] in NEGOTIATION:
                self._telnet = _port_manager(NullSerialPort(), self)
                return data[:at] + self._strip_telnet(data[at:])
            at = data.find(IAC, at + 1)
        return data

    def _strip_telnet(self, data: bytes) -> bytes:
        """Return the data without Telnet. Unknown commands are ignored, as RFC 854 requires."""
        telnet, plain = self._telnet, b""
        assert telnet is not None
        for number in data:
            try:
                plain += b"".join(telnet.filter(bytes([number])))
            except (KeyError, TypeError, struct.error):  # invalid values, or too few bytes
                telnet.suboption, telnet.mode = None, M_NORMAL
            if telnet.suboption is not None and len(telnet.suboption) > MAX_SUBNEGOTIATION_BYTES:
                telnet.suboption = None
        return plain

    @property
    def all_answered(self) -> bool:
        return self._handler.all_answered

    def peer_closed(self) -> None:
        self._handler.peer_closed()

    def close(self) -> None:
        self._handler.close()


def with_telnet(accept: Accept) -> Accept:
    """Return a function like ``accept`` whose connections may use Telnet with RFC 2217."""
    return lambda connected: _TelnetFilter(accept, connected)
