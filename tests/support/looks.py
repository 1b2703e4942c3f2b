"""Where the tube of a simulated mount really points during a test of the limits, and orders that lead it somewhere.

Degrees and seconds; ``bridge`` is a gateway in this process.
"""

from __future__ import annotations

import asyncio
from typing import Any

from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.protocols.mechanics.truth import Truth
from tests.support import truth

#: Seconds from one look at the tube to the next: while a motor turns it, and while it stands or follows the sky.
OFTEN, SELDOM = 0.05, 0.25


def altitude(bridge: Any) -> float:
    """How high the tube really points, degrees."""
    return truth.altitude(bridge.sim)


def notes(bridge: Any) -> list[str]:
    return [entry.note for entry in bridge.entries if entry.arrow == "!"]


async def extremes(bridge: Any, seconds: float) -> tuple[float, float]:
    """The lowest and the highest altitude that the tube really had meanwhile."""
    end, seen = bridge.clock() + seconds, [altitude(bridge)]
    while (left := end - bridge.clock()) > 1e-6:
        await asyncio.sleep(min(left, OFTEN if truth.moving(bridge.sim) else SELDOM))
        seen.append(altitude(bridge))
    return min(seen), max(seen)


async def at_rest(bridge: Any, seconds: float = 3.0, most: float = 60.0) -> tuple[float, float]:
    """The same until no motor has turned the tube for so many seconds, but not for longer than ``most``."""
    low, high, since, end = 90.0, -90.0, bridge.clock(), bridge.clock() + most
    while bridge.clock() < min(since + seconds, end):
        below, above = await extremes(bridge, 0.5)
        low, high = min(low, below), max(high, above)
        if truth.moving(bridge.sim):
            since = bridge.clock()
    return low, high


class Nearest:
    """The least true distance from the Sun."""

    def __init__(self) -> None:
        self.distance = 180.0

    def keep(self, seen: Truth) -> None:
        self.distance = min(self.distance, seen.sun_distance)


async def goes(bridge: Any, operation: op.Operation, seconds: float = 60.0) -> tuple[Fault | None, float]:
    """Give an order and wait for the end of the motion -> why it was refused, and how near the tube came to the Sun."""
    nearest, fault = Nearest(), None
    async with truth.sampled(bridge.sim, nearest.keep):
        try:
            await bridge.controller.perform(operation)
        except Fault as refused:
            fault = refused
        for _ in range(round(seconds)):
            await asyncio.sleep(1.0)
            if not bridge.controller.movement.any_motion:
                break
        await asyncio.sleep(2.0)
    return fault, nearest.distance


async def believed(bridge: Any, az: float, alt: float) -> op.Equatorial:
    """Right ascension and declination that the mount puts at an azimuth and altitude."""
    return bridge.controller.astrometry.equatorial_of(op.Horizontal(az, alt))


async def to(bridge: Any, az: float, alt: float) -> tuple[Fault | None, float]:
    place = await believed(bridge, az, alt)
    return await goes(bridge, op.Goto(place.ra, place.dec))


async def sync(bridge: Any, az: float, alt: float) -> None:
    place = await believed(bridge, az, alt)
    await bridge.controller.perform(op.Sync(place.ra, place.dec))
    await asyncio.sleep(1.0)
