"""A simulated Meade on a clock that the test sets, and a connection that records delayed replies."""

from __future__ import annotations

from typing import Any

from gateway.protocols.lx200.simulator.server import SimulatedLx200

EVENING = 1768514400.0  # 2026-01-15 22:00 UTC
MODELS = ["autostar", "lx200", "lx200-16", "lx200gps"]
SITES = [(45.0, 10.0), (-34.0, 18.5)]


class Clock:
    """A clock that stands still until the test sets it."""

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
    """One connection: ``send`` returns the immediate reply; ``late`` collects (delay in seconds, reply)."""

    def __init__(self, sim: SimulatedLx200) -> None:
        self.late: list[tuple[float, bytes]] = []
        self.send = sim.connection(lambda seconds, answer: self.late.append((seconds, answer)))


def overhead(sim: SimulatedLx200) -> bytes:
    """Return ``:Sr…#:Sd…#`` near the meridian, a little south of the zenith (north of it in the southern half)."""
    hours = int(sim.mechanics.sky.lst(sim.now) / 15.0)
    return f":Sr{hours:02d}:00:00#:Sd{sim.site[0] * 0.6:+03.0f}*00:00#".encode()
