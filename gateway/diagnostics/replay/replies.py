"""A replayed connection: the bytes it received then and now that have not been compared yet."""

from __future__ import annotations

import re
from typing import NamedTuple

from gateway.app.gateway import Gateway
from gateway.app.recording.format import Event
from gateway.core.errors import UserError
from gateway.core.wire_log import show
from gateway.transport import ConnectionHandler
from gateway.transport.handler import Connected
from gateway.transport.listening import networked

#: How many bytes of a difference are shown.
SHOWN = 24


class Difference(NamedTuple):
    """The first difference of a client: when it occurred, the bytes received then, and now."""

    client: str
    at: float
    then: bytes
    now: bytes


class ReplayedConnection:
    """One connection; ``at`` is the time of the last bytes of ``then``."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.guest: ConnectionHandler | None = None
        self.then, self.now = bytearray(), bytearray()
        self.at = 0.0
        self.difference: Difference | None = None

    def come(self, gateway: Gateway, event: Event, name: str | None = None) -> None:
        """Connect as in a recorded event, under another ``name`` if one is given. Raises UserError."""
        number, host = surface_and_host(event)
        from_network = networked(gateway.endpoints[number - 1].where)
        hang_up = (lambda last: None) if from_network else None  # a stranger's bytes (a browser's) are not recorded
        connected = Connected(name or self.name, host, self.now.extend, hang_up)
        self.guest = gateway.acceptors[number - 1].create(connected)  # it was accepted when it was recorded

    def play(self, event: Event) -> None:
        """Replay what the client did; any other event is its end."""
        assert self.guest is not None
        if event.arrow == ">":
            self.guest.feed(event.data)
        elif event.arrow == "e":
            self.guest.peer_closed()
        else:
            self.guest.close()

    def was_told(self, event: Event) -> None:
        self.then += event.data
        self.at = event.at

    def compare(self, less: bool = False, more: bool = False) -> None:
        """Discard equal bytes and remember the first difference.

        At the end, ``less`` and ``more`` tell whether missing and additional bytes count as one.
        """
        common = min(len(self.then), len(self.now))
        if self.difference is None:
            left = (less and len(self.then) > common) or (more and len(self.now) > common)
            if left or self.then[:common] != self.now[:common]:
                self.difference = Difference(self.name, self.at, bytes(self.then[:SHOWN]), bytes(self.now[:SHOWN]))
            del self.then[:common], self.now[:common]
        if self.difference is not None:
            self.then.clear()
            self.now.clear()


def surface_and_host(event: Event) -> tuple[int, str]:
    """Return the number of the surface and the host of a recorded connection. Raises UserError."""
    found = re.fullmatch(r"surface (\d+), host (.*)", event.data.decode("latin-1"))
    if found is None:
        raise UserError(f"recording, {event.at:.6f} s: a connection without its surface and host")
    return int(found.group(1)), found.group(2)


def in_words(found: list[Difference]) -> list[str]:
    return [f"{item.at:.3f} s, {item.client}: then '{show(item.then)}', now '{show(item.now)}'" for item in found]
