"""Helpers for tests of whole gateways with a NexStar surface: a bridge, and what a program sends and reads."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from gateway.astro.ephemeris.closed_forms import sidereal_time
from gateway.astro.spherical import separation, wrap360
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge, RehearsalClient

ARCSECOND = 1 / 3600
NORTH = bytes((80, 2, 17, 36, 9, 0, 0, 0))
HALT = {axis: bytes((80, 2, 15 + axis, 36, 0, 0, 0, 0)) for axis in (1, 2)}


def on_a_bridge(**settings: Any) -> Callable[[Callable[[Bridge], Awaitable[None]]], Callable[[], None]]:
    """Decorate a test so that it gets a gateway with a NexStar surface that drives a simulated hand control."""

    def wrap(test: Callable[[Bridge], Awaitable[None]]) -> Callable[[], None]:
        def wrapped() -> None:
            async def program() -> None:
                given = {"mount": "6-8se", "surface": "6-8se", **settings}
                async with Bridge(presented="nexstar", **given) as bridge:
                    await test(bridge)

            run(program())

        wrapped.__name__, wrapped.__doc__ = test.__name__, test.__doc__
        return wrapped

    return wrap


def precise(letter: bytes, first: float, second: float) -> bytes:
    """Return a command with two angles of 32 bits each, as programs send them."""
    return b"%s%08X,%08X" % (letter, int(first / 360 * 2**32) % 2**32, int(second / 360 * 2**32) % 2**32)


def place(reply: bytes) -> tuple[float, float]:
    assert len(reply) == 18 and reply[8:9] == b"," and reply[17:] == b"#", reply
    first, second = int(reply[:8], 16) / 2**32 * 360, int(reply[9:17], 16) / 2**32 * 360
    return first, second - 360 if second > 180 else second


def up(bridge: Bridge, east: float = 20.0, dec: float = 40.0) -> tuple[float, float]:
    """Return (right ascension, declination) well above the horizon, degrees."""
    latitude, longitude = bridge.sim.site
    return wrap360(sidereal_time(bridge.clock(), longitude) + east), dec if latitude > 0 else -dec


def off(bridge: Bridge, ra: float, dec: float) -> float:
    """Return how far the tube really points from these coordinates, degrees."""
    return separation(*bridge.sim.true_position(), ra, dec)


async def settled(client: RehearsalClient, seconds: float = 120.0) -> None:
    """Poll ``L`` as INDIGO does until it is 0."""
    end = asyncio.get_running_loop().time() + seconds
    while asyncio.get_running_loop().time() < end:
        if await client.ask(b"L") == b"0#":
            return
        await asyncio.sleep(0.5)
    raise AssertionError("still slewing")


async def polled(client: RehearsalClient) -> None:
    """Poll like a program that has been connected for a while."""
    for _ in range(3):
        await client.ask(b"L")
        await client.ask(b"e")
        await asyncio.sleep(0.5)
