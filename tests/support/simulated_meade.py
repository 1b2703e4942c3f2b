"""A simulated Meade on a clock that the test turns, and a connection that keeps what comes late."""

from __future__ import annotations

from typing import Any

from gateway.protocols.lx200.simulator.server import SimulatedLx200

EVENING = 1768514400.0  # 2026-01-15 22:00 UTC
MODELS = ["autostar", "lx200", "lx200-16", "lx200gps"]
SITES = [(45.0, 10.0), (-34.0, 18.5)]


class Clock:
    """A clock that stands until it is turned."""

    def __init__(self) -> None:
        self.now = EVENING

    def __call__(self) -> float:
        return self.now


def meade(
    model: str = "lx200gps", site: tuple[float, float] = SITES[0], **settings: Any
) -> tuple[SimulatedLx200, Clock]:
    clock = Clock()
    return SimulatedLx200(model, clock=clock, site=site, **settings), clock


class Line:
    """One connection: what is answered at once, and what comes after how many seconds."""

    def __init__(self, sim: SimulatedLx200) -> None:
        self.late: list[tuple[float, bytes]] = []
        self.send = sim.connection(lambda seconds, answer: self.late.append((seconds, answer)))


def overhead(sim: SimulatedLx200) -> bytes:
    """``:Sr…#:Sd…#`` for a place near the meridian, a little south of the zenith (north of it in the south)."""
    hours = int(sim.mechanics.sky.sidereal(sim.now) / 15.0)
    return f":Sr{hours:02d}:00:00#:Sd{sim.site[0] * 0.6:+03.0f}*00:00#".encode()
