"""Simulated mounts: inside this process, or on ports to which other programs connect."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from datetime import UTC, datetime

from gateway.app.config import Endpoint, MountConfig
from gateway.core.errors import UserError
from gateway.protocols.mechanics.simulated import Simulated
from gateway.protocols.registry import PROTOCOLS, simulated_protocols
from gateway.transport import Accept, Listener, open_port
from gateway.transport.baud import PacedLine
from gateway.transport.wires import DEFAULT_BAUD, SimulatedTransport

DEFAULT_SITE = (45.0, 10.0)
#: Endpoints without a baud rate, where bytes take no time.
NETWORK_PREFIXES = ("tcp:", "rfc2217:")


def parse_time(text: str) -> float:
    """Return the Unix seconds of an ISO 8601 time, UTC if it names no zone. Raises UserError."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise UserError(f"{text!r}: write it like 2026-01-15T22:00:00Z") from None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def running_clock(start: float | None) -> Callable[[], float]:
    """Return this computer's clock, or a clock that starts now at ``start`` (Unix seconds)."""
    if start is None:
        return time.time
    began = time.monotonic()
    return lambda: start + time.monotonic() - began


def make_simulator(
    endpoint: Endpoint,
    *,
    clock: Callable[[], float],
    site: tuple[float, float] = DEFAULT_SITE,
    aligned: bool = True,
    speed: float = 1.0,
    **settings: object,
) -> Simulated:
    """Make the simulated mount that an endpoint names; ``settings`` are those that only one protocol's simulator has.

    Raises UserError for a version that the model never had, and for a protocol without a simulator.
    """
    make = PROTOCOLS[endpoint.protocol].make_simulator
    if make is None:
        raise UserError(f"no {endpoint.protocol} mount can be simulated; {' or '.join(simulated_protocols())} can")
    return make(endpoint.model, endpoint.version, clock=clock, site=site, aligned=aligned, speed=speed, **settings)


def simulated_transport(endpoint: Endpoint, config: MountConfig) -> SimulatedTransport:
    """Make the transport to a simulated mount ``…@sim`` in this process."""
    simulator = make_simulator(endpoint, clock=time.time, site=config.site or DEFAULT_SITE, speed=config.speed)
    return SimulatedTransport(f"sim {endpoint.protocol}", simulator.connection, config.latency)


class _SimulatedConnection:
    """One connection to a simulated mount, which all connections share.

    Each reply is sent after ``latency`` seconds. With ``baud`` the bytes are paced at that rate in both directions.
    """

    def __init__(
        self, simulator: Simulated, latency: float, baud: int | None, write_bytes: Callable[[bytes], object]
    ) -> None:
        self._latency, self._write = latency, write_bytes
        #: How many replies are delayed and not sent yet.
        self._delayed_replies = 0
        self._answer: Callable[[bytes], bytes] = simulator.connection(self._send_later)
        self.feed: Callable[[bytes], None] = self._receive
        self._line_paces: list[PacedLine] = []
        if baud is not None:
            self._line_paces = [PacedLine(baud, self._receive), PacedLine(baud, write_bytes)]
            self.feed, self._write = self._line_paces[0].send, self._line_paces[1].send

    def _send_later(self, seconds: float, answer: bytes) -> None:
        """Send a reply after the latency and ``seconds`` more."""
        self._delayed_replies += 1
        asyncio.get_running_loop().call_later(self._latency + seconds, self._send, answer)

    def _send(self, answer: bytes) -> None:
        self._delayed_replies -= 1
        self._write(answer)

    def _receive(self, data: bytes) -> None:
        answer = self._answer(data)
        if answer and self._latency:
            self._send_later(0.0, answer)
        elif answer:
            self._write(answer)

    @property
    def all_answered(self) -> bool:
        """Whether every reply has been sent."""
        return not self._delayed_replies

    def peer_closed(self) -> None:
        """Do nothing: a mount does not notice who is connected."""

    def close(self) -> None:
        self._write = lambda data: None
        for pace in self._line_paces:
            pace.close()


async def serve_simulator(
    simulator: Simulated, ports: list[str], latency: float, baud: int | None = None
) -> list[Listener]:
    """Open ``ports``, at which any number of programs connect to one simulated mount. Raises UserError.

    Serial ports and pseudo-terminals are paced at ``baud`` (default: 9600); if it is given, they accept no other rate.
    TCP and RFC 2217 ports are paced only if ``baud`` is given.
    """

    def accept_at(baud: int | None) -> Accept:
        return lambda connected: _SimulatedConnection(simulator, latency, baud, connected.write)

    return [
        await open_port(place, accept_at(baud or (None if place.startswith(NETWORK_PREFIXES) else DEFAULT_BAUD)), baud)
        for place in ports
    ]
