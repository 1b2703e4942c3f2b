"""The simulated Meade, read past the gateway: the truth a test compares with.

An LX200 client of the tests' own.  Its bytes were typed by hand from the Meade telescope protocol
and owe nothing to the product's tables.
"""

from __future__ import annotations

import datetime
import re
import socket

from .processes import PATIENCE
from .sky import Site, Spot


def _sexagesimal(text: str) -> float:
    """Any of `12:34.5`, `-05°30`, `+45*10:30`, `010`: degrees, or hours, whatever stands between the numbers."""
    parts = [float(part) for part in re.findall(r"[0-9.]+", text)]
    value = sum(part / 60.0**place for place, part in enumerate(parts))
    return -value if text.startswith("-") else value


class Meade:
    """One TCP connection to a Meade. Every answer comes in bounded time."""

    def __init__(self, port: int) -> None:
        self._wire = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)

    def close(self) -> None:
        self._wire.close()

    def _next(self, request: bytes) -> bytes:
        byte = self._wire.recv(1)
        assert byte, f"the Meade closed the wire after {request!r}"
        return byte

    def ask(self, request: bytes) -> str:
        """Send a command; its answer without the `#` that ends it."""
        self._wire.sendall(request)
        answer = b""
        while not answer.endswith(b"#"):
            answer += self._next(request)
        return answer[:-1].decode("latin-1")

    def position(self) -> Spot:
        """`:GR#` and `:GD#`, in whichever of the two formats is set."""
        return Spot(_sexagesimal(self.ask(b":GR#")) * 15.0, _sexagesimal(self.ask(b":GD#")))

    def horizontal(self) -> tuple[float, float]:
        """`:GZ#` and `:GA#`: azimuth and altitude in degrees."""
        return _sexagesimal(self.ask(b":GZ#")), _sexagesimal(self.ask(b":GA#"))

    def goto_running(self) -> bool:
        """`:D#`: any bar stands for a slew under way; spaces do not."""
        return bool(self.ask(b":D#").strip())

    def _characters(self, request: bytes, count: int) -> str:
        """Answers that no `#` ends."""
        self._wire.sendall(request)
        return b"".join(self._next(request) for _ in range(count)).decode("ascii")

    def mode(self) -> str:
        """ACK: A alt-azimuth, P polar, L land; the last of these does not track."""
        return self._characters(b"\x06", 1)

    def status(self) -> str:
        """`:GW#`: mount, T or N for tracking, state of the alignment (a classic LX200 does not answer)."""
        return self._characters(b":GW#", 3)

    def site(self) -> Site:
        """`:Gt#` and `:Gg#`; the latter counts westward, to 360° or with a sign."""
        latitude, west = _sexagesimal(self.ask(b":Gt#")), _sexagesimal(self.ask(b":Gg#"))
        return Site(latitude, (180.0 - west) % 360.0 - 180.0)

    def clock(self) -> tuple[datetime.datetime, int]:
        """`:GC#`, `:GL#`, `:GG#`: the Universal Time its local time stands for, and the hours that is ahead."""
        offset = -round(_sexagesimal(self.ask(b":GG#")))
        stamp = f"{self.ask(b':GC#')} {self.ask(b':GL#')} +0000"
        local = datetime.datetime.strptime(stamp, "%m/%d/%y %H:%M:%S %z")
        return local - datetime.timedelta(hours=offset), offset
