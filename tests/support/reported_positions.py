"""The positions that programs receive through either surface, and where the tube pointed at the same time."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from gateway.astro.spherical import separation
from tests.support.in_process_gateway import Bridge, RehearsalClient
from tests.support.nexstar_flows import place

MEADES = ("lx200", "lx200-16", "autostar", "lx200gps")
MOUNTS = ("cge", "cpc", "6-8se", "lx200", "autostar", "lx200gps")
FREE: dict[str, Any] = {"lowest": -90.0, "sun": 0.0}
Place = tuple[float, float]


def bridge_to(mount: str, presented: str, **settings: Any) -> Bridge:
    driven = "lx200" if mount in MEADES else "nexstar"
    return Bridge(mount, driven=driven, presented=presented, surface=None, **{"config": FREE, **settings})


def degrees(told: bytes) -> float:
    """Convert ``+DD*MM:SS#`` or ``HH:MM:SS#`` to a number of its first unit."""
    sign = -1.0 if told[:1] == b"-" else 1.0
    first, minutes, seconds = re.split(rb"[*\xdf:']", told.rstrip(b"#").lstrip(b"+-"))
    return sign * (int(first) + int(minutes) / 60.0 + int(seconds) / 3600.0)


async def reported_position(client: RehearsalClient, presented: str) -> Place:
    """Return right ascension and declination, degrees."""
    if presented == "nexstar":
        return place(await client.ask(b"e", ending=b"#"))
    ra = degrees(await client.ask(b":GR#", ending=b"#"))
    return ra * 15.0, degrees(await client.ask(b":GD#", ending=b"#"))


async def start_moving(client: RehearsalClient, presented: str, by_hand: bool) -> None:
    """Move both axes at full speed, by direction keys or by a goto to 8h, 30 degrees."""
    if presented == "nexstar":
        await client.ask(b"P\x02\x10\x24\x09\0\0\0" if by_hand else b"r55555555,15555555", ending=b"#")
        if by_hand:
            await client.ask(b"P\x02\x11\x24\x09\0\0\0", ending=b"#")
    elif by_hand:
        client.send(b":RS#:Mw#:Mn#")
    else:
        await client.ask(b":Sr08:00:00#:Sd+30*00:00#:MS#", ending=b"0")


class Track:
    """Where the tube pointed at each sampled time."""

    def __init__(self) -> None:
        self.points: list[tuple[float, Place]] = []

    def off(self, seen: Place, since: float = -1e9) -> float:
        """Return the smallest distance of a position from where the tube has pointed since then, degrees."""
        return min(separation(*seen, *point) for at, point in self.points if at >= since)


@asynccontextmanager
async def tracked(bridge: Bridge, every: float = 0.01) -> AsyncIterator[Track]:
    """Record where the tube points as long as the block lasts."""
    track, now = Track(), asyncio.get_running_loop().time

    async def watch() -> None:
        while True:
            track.points.append((now(), bridge.sim.true_position()))
            await asyncio.sleep(every)

    watching = asyncio.ensure_future(watch())
    await asyncio.sleep(0)
    try:
        yield track
    finally:
        watching.cancel()
