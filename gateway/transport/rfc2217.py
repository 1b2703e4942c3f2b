"""RFC 2217: a serial port over TCP, settings and modem lines included, for programs that want a COM port.

Such a client begins to negotiate (Telnet, RFC 854) as soon as it is connected. Until one does, a connection is plain:
no byte of Telnet is sent, and 0xFF is data, so that a program which knows nothing of all this may connect, too. No
command of either protocol has 0xFF followed by WILL, WONT, DO or DONT in it, and none ends with 0xFF.

pyserial speaks RFC 2217; what it needs besides is a port, and there is none: baud rates and the like are taken and
forgotten, and the modem lines say that somebody is there.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from serial.rfc2217 import M_NORMAL, PortManager

from gateway.transport.handler import Arrive, HandOver, HangUp, Write

IAC = b"\xff"
#: IAC followed by one of these begins Telnet: WILL, WONT, DO, DONT.
NEGOTIATION = frozenset(b"\xfb\xfc\xfd\xfe")
#: The longest subnegotiation there is has 6 bytes, or a signature; what never ends is no client.
LONGEST = 256


class NoPort:
    """What pyserial's server takes for a serial port; it says that a device is there, ready to send and receive."""

    def __init__(self) -> None:
        self.baudrate, self.bytesize, self.parity, self.stopbits = 9600, 8, "N", 1
        self.xonxoff = self.rtscts = self.break_condition = self.ri = False
        self.dtr = self.rts = self.cts = self.dsr = self.cd = True

    def reset_input_buffer(self) -> None:
        """Nothing waits: what arrives is dealt with at once."""

    def reset_output_buffer(self) -> None:
        """Nothing waits: what is answered is sent at once."""


#: pyserial's types ask for a real port; any that looks like one will do.
_server: Callable[[Any, Any], PortManager] = PortManager


class _Doorman:
    """A handler in front of the real one, who speaks Telnet with clients that do."""

    #: Telnet counts what it is told: nothing of it is passed over.
    ended = False

    def __init__(self, arrive: Arrive, name: str, host: str, write: Write) -> None:
        self.write = write
        self._held = b""
        self._telnet: PortManager | None = None
        self._guest = arrive(name, host, self._answer)

    def feed(self, data: bytes) -> None:
        data = self._plain(data) if self._telnet is None else self._filtered(data)
        if data:
            self._guest.feed(data)

    def _answer(self, data: bytes) -> int | None:
        """Send what the real handler writes -> how much of it waits, where that is known."""
        return self.write(self._escaped(data))

    def _escaped(self, data: bytes) -> bytes:
        return data if self._telnet is None else data.replace(IAC, IAC + IAC)

    def _plain(self, data: bytes) -> bytes:
        """The data of a connection that may still become Telnet."""
        data, self._held = self._held + data, b""
        at = data.find(IAC)
        while at >= 0:
            if data[at:] == IAC:
                self._held = IAC
                return data[:at]
            if data[at + 1] in NEGOTIATION:
                self._telnet = _server(NoPort(), self)
                return data[:at] + self._filtered(data[at:])
            at = data.find(IAC, at + 1)
        return data

    def _filtered(self, data: bytes) -> bytes:
        """The data without Telnet. What no RFC knows of is passed over, as RFC 854 would have it."""
        telnet, plain = self._telnet, b""
        assert telnet is not None
        for number in data:
            try:
                plain += b"".join(telnet.filter(bytes([number])))
            except (KeyError, TypeError, struct.error):  # values that do not exist, or too few bytes of them
                telnet.suboption, telnet.mode = None, M_NORMAL
            if telnet.suboption is not None and len(telnet.suboption) > LONGEST:
                telnet.suboption = None
        return plain

    @property
    def answered(self) -> bool:
        return self._guest.answered

    def gone(self) -> None:
        self._guest.gone()

    def serial(self, change_rate: Callable[[int], int]) -> None:
        """There is no serial port behind it."""

    def network(self, hang_up: HangUp, hand_over: HandOver | None = None) -> None:
        self._guest.network(lambda last: hang_up(self._escaped(last)))

    def close(self) -> None:
        self._guest.close()


def over_telnet(arrive: Arrive) -> Arrive:
    """Where handlers arrive -> where those arrive who may speak RFC 2217."""
    return lambda name, host, write: _Doorman(arrive, name, host, write)
