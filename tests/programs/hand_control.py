"""The simulated hand control, read past the gateway: the truth a test compares with.

A NexStar client of the tests' own.  Its bytes were typed by hand from the NexStar communication
protocol and owe nothing to the product's tables.
"""

from __future__ import annotations

import datetime
import socket

from .processes import PATIENCE
from .sky import Site, Spot

REVOLUTION = 2**32
"""Steps of a precise NexStar angle in 360°."""


def _degrees(text: str) -> float:
    return int(text, 16) * 360.0 / REVOLUTION


def _signed(angle: float) -> float:
    return (angle + 180.0) % 360.0 - 180.0


def _signed_byte(value: int) -> int:
    return (value + 128) % 256 - 128


class HandControl:
    """One TCP connection to a hand control, maybe a StarSense 1.20. Every answer comes in bounded time."""

    def __init__(self, port: int, starsense: bool = False) -> None:
        self.starsense = starsense
        self._wire = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)

    def close(self) -> None:
        self._wire.close()

    def ask(self, request: bytes, length: int) -> bytes:
        """Send a command; its `length` bytes of answer without the `#` that must follow."""
        self._wire.sendall(request)
        answer = b""
        while len(answer) <= length:
            part = self._wire.recv(length + 1 - len(answer))
            assert part, f"hand control closed the wire after {request!r}"
            answer += part
        assert answer[length:] == b"#", f"{request!r} was answered {answer!r}"
        return answer[:length]

    def position(self) -> Spot:
        """`e`: right ascension and declination."""
        ra, dec = self.ask(b"e", 17).decode("ascii").split(",")
        return Spot(_degrees(ra), _signed(_degrees(dec)))

    def horizontal(self) -> tuple[float, float]:
        """`z`: azimuth and altitude in degrees (alt-azimuth mounts)."""
        azimuth, altitude = self.ask(b"z", 17).decode("ascii").split(",")
        return _degrees(azimuth), _signed(_degrees(altitude))

    def goto_running(self) -> bool:
        """`L`: ASCII 1 while a goto is under way."""
        return {b"0": False, b"1": True}[self.ask(b"L", 1)]

    def tracking_mode(self) -> int:
        """`t`: 0 off, 1 alt-azimuth, 2 equatorial north, 3 equatorial south; StarSense 1.20 adds its version."""
        return self.ask(b"t", 3 if self.starsense else 1)[0]

    def aligned(self) -> bool:
        """`J`: binary 1 when the alignment is complete."""
        return self.ask(b"J", 1) == b"\x01"

    def site(self) -> Site:
        """`w`: degrees, minutes, seconds, 1 = south; then longitude, 1 = west."""
        d, m, s, south, e, n, t, west = self.ask(b"w", 8)
        latitude, longitude = d + m / 60 + s / 3600, e + n / 60 + t / 3600
        return Site(-latitude if south else latitude, -longitude if west else longitude)

    def clock(self) -> tuple[datetime.datetime, int]:
        """`h`: the Universal Time its local time stands for, and its zone plus daylight saving in hours."""
        hour, minute, second, month, day, year, zone, daylight = self.ask(b"h", 8)
        offset = _signed_byte(zone) + daylight
        local = datetime.datetime(2000 + year, month, day, hour, minute, second, tzinfo=datetime.UTC)
        return local - datetime.timedelta(hours=offset), offset
