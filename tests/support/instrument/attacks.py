"""Attacks: what nobody means, and programs do. Each is a preparation and an act, on the kinds of mount that it fits.

An attack goes through if the true tube comes into the circle of the risen Sun (D1), beyond a limit that is written
(D2), or moves where nobody sent it; what it ran on at the stop is permitted. Angles are degrees.
"""

from __future__ import annotations

import asyncio
import copy
from collections.abc import Awaitable, Callable, Iterator, Mapping
from random import Random
from typing import Any, NamedTuple

from gateway.astro.axes import Build, Geometry, Observer, Pair
from gateway.astro.spherical import horizon_to_hour_angle, hour_angle_to_horizon, wrap180
from gateway.protocols.mechanics.truth import sun_position
from tests.support.instrument.worlds import CIRCLE, HOUR, KINDS, NOTHING, SITES, Slip, World, altitude_at, on_date

Step = Callable[[World, Random], Awaitable[None]]
#: What alignment and running on explain, degrees: of an altitude, of the distance from the Sun, of an hour angle.
LOW, NEAR, PAST = 0.5, 1.3, 2.5
MEADES = ("lx200gps", "lx200gps polar", "autostar", "classic polar")
ALTAZ = ("cpc", "6-8se", "lx200gps", "autostar", "alpaca altaz", "synscan-az")
POLAR = tuple(kind for kind in KINDS if kind not in ALTAZ)
LOWEST = {"lowest": 20.0}


class Attack(NamedTuple):
    """``starts`` is night, day or dawn."""

    name: str
    kinds: tuple[str, ...]
    steps: tuple[Step, ...]
    starts: str = "night"
    limits: Mapping[str, Any] = NOTHING
    slip: Slip = Slip()


class Result(NamedTuple):
    """What came of one attack: D1, D2 or nothing; the lowest altitude, the nearest Sun, how far past the meridian."""

    name: str
    kind: str
    through: str
    low: float
    near: float
    past: float

    def __str__(self) -> str:
        return f"{self.kind} ({self.low:.1f}° high, {self.near:.1f}° from the Sun, {self.past:.0f}° past the meridian)"


def sun_at(world: World) -> Pair:
    """Return azimuth and altitude of the Sun."""
    ra, dec = sun_position(world.now)
    return hour_angle_to_horizon(wrap180(Observer(*world.site).lst(world.now) - ra), dec, world.site[0])


def leading_to(world: World, azimuth: float, altitude: float) -> Pair:
    """Return what the mount must be told to come truly to an azimuth and altitude."""
    twin, now = copy.deepcopy(world.mechanics), world.now
    hour_angle, dec = horizon_to_hour_angle(azimuth, altitude, world.site[0])
    geometry = Geometry(twin.build, world.site[0])
    twin.goto_axes(now, *geometry.to_axes(hour_angle, dec, geometry.is_flipped(hour_angle)))
    ra, dec = twin.believed_position(twin.arrival_time(now) + 0.5)
    return ra, max(-90.0, min(90.0, dec if abs(dec) <= 90.0 else (180.0 if dec > 0 else -180.0) - dec))


async def goes(world: World, azimuth: float, altitude: float) -> bool:
    begun = not await world.goto(*leading_to(world, azimuth, max(-20.0, min(88.0, altitude))))
    await world.rest(90.0)
    return begun


async def arrow(world: World, letter: str, seconds: float, rate: str = "RS") -> None:
    """Hold an arrow, polling as programs do."""
    world.program.send(f":{rate}#:M{letter}#".encode())
    for _ in range(int(seconds)):
        world.program.send(b":GR#:GD#")
        await world.watch(1.0)
    await world.tell(f":Q{letter}#".encode())
    await world.rest(30.0)


# --- what is done -----------------------------------------------------------------------------------------------------


async def to_low_places(world: World, dice: Random) -> None:
    """Gotos to where the tube is too low in truth, and looks highest by the mount's own clock."""
    for below in (1.5, 5.0, 12.0):
        azimuths = range(0, 360, 10)
        looks = {az: world.believed(world.place(az, world.lowest - below)) for az in azimuths}
        await goes(world, max(looks, key=lambda az: looks[az]), world.lowest - below)
        await goes(world, dice.uniform(0.0, 360.0), world.lowest - below)
        await goes(world, dice.uniform(0.0, 360.0), dice.uniform(30.0, 70.0))


async def to_the_sun(world: World, dice: Random) -> None:
    for beside in (0.0, 9.0, -14.0):
        azimuth, altitude = sun_at(world)
        await goes(world, azimuth + beside, altitude + beside / 3.0)


async def past_the_sun(world: World, dice: Random) -> None:
    """From one side of the Sun to the other."""
    for _ in range(3):
        azimuth, altitude = sun_at(world)
        first, second = dice.uniform(25.0, 60.0), dice.uniform(25.0, 60.0)
        await goes(world, azimuth - first, altitude + dice.uniform(-10.0, 20.0))
        await goes(world, azimuth + second, altitude + dice.uniform(-10.0, 20.0))


async def anywhere(world: World, dice: Random) -> None:
    """Gotos from anywhere to anywhere within the limits."""
    for _ in range(6):
        await goes(world, dice.uniform(0.0, 360.0), dice.uniform(max(5.0, world.lowest + 1.0), 80.0))


async def arrows_at_the_sun(world: World, dice: Random) -> None:
    for letter, east, up in (("w", -34.0, 0.0), ("e", 34.0, 0.0), ("s", 0.0, 32.0), ("n", 0.0, 32.0)):
        azimuth, altitude = sun_at(world)
        if altitude + up < 85.0:
            await goes(world, azimuth + east * (1.0 if world.site[0] > 0 else -1.0), max(10.0, altitude + up))
            await arrow(world, letter, 22.0, dice.choice(("RS", "RM")))


async def arrows_down(world: World, dice: Random) -> None:
    for letter in dice.sample("nsew", 4):
        await goes(world, dice.uniform(0.0, 360.0), world.lowest + dice.uniform(6.0, 30.0))
        await arrow(world, letter, 20.0, dice.choice(("RS", "RS", "RM")))


async def arrows_over(world: World, dice: Random) -> None:
    """Over the pole or the zenith, and down on the other side."""
    high = world.site[0] if world.mechanics.build is not Build.ALTAZ else 80.0
    await goes(world, 0.0 if world.site[0] > 0 else 180.0, min(86.0, abs(high) + 8.0))
    for letter in dice.sample("ns", 2):
        await arrow(world, letter, 45.0)


async def tracks_down(world: World, dice: Random) -> None:
    await goes(world, 268.0, world.lowest + 0.15)
    for _ in range(8):
        await world.watch(12.0, 1.0)
        await world.tell(dice.choice((b":AP#", b":Mgs2500#", b":Mgn2500#", b":Mgw2500#")))


async def parks(world: World, dice: Random) -> None:
    await goes(world, sun_at(world)[0] + dice.choice((-70.0, 70.0)), 40.0)
    await world.tell(dice.choice((b":hP#", b":hF#")))
    await world.rest(120.0, 6.0)


async def arrows_at_the_pier(world: World, dice: Random) -> None:
    for letter, hours in (("w", -1.0), ("e", 1.0)):
        ra = Observer(*world.site).lst(world.now) - hours * 15.0
        if not await world.goto(ra % 360.0, 10.0 if world.site[0] > 0 else -10.0):
            await world.rest(90.0)
        await arrow(world, letter, 22.0, dice.choice(("RS", "RM")))


# --- what is prepared -------------------------------------------------------------------------------------------------


def clock(ahead: float) -> Step:
    async def step(world: World, dice: Random) -> None:
        await world.set_clock(ahead)

    return step


async def other_longitude(world: World, dice: Random) -> None:
    """A program sets the longitude with the wrong sign."""
    west = world.site[1] % 360.0
    await world.ask(f":Sg{int(west):03}*{int(west % 1 * 60):02}#".encode(), b"1")
    await asyncio.sleep(6.0)


def synced(degrees: float, azimuth: float | None = None, altitude: float = 45.0, times: int = 1) -> Step:
    """Syncs, each by so many degrees: in altitude or declination, or along the first axis."""

    async def step(world: World, dice: Random) -> None:
        turned = dice.uniform(0.0, 360.0) if azimuth is None else azimuth
        if world.stage.controller.policy.limits.sun and sun_at(world)[1] > -2.0:
            turned = sun_at(world)[0] + 100.0
        await goes(world, turned, altitude)
        for _ in range(times):
            ra, dec = await world.told_place()
            if altitude > 70.0:  # small on the sky, and far along the first axis
                await world.sync(ra + degrees, dec)
            else:
                await world.sync(ra, max(-89.0, min(89.0, dec + degrees)))

    return step


async def turned_at_the_pole(world: World, dice: Random) -> None:
    """A guide pulse brings the tube over the pole, where a sync may turn the first axis by half a circle."""
    pole = 1.0 if world.site[0] > 0.0 else -1.0
    if not await world.goto(dice.uniform(0.0, 360.0), 89.99 * pole):
        await world.rest(90.0)
    await world.tell(b":Mgn4300#" if pole > 0 else b":Mgs4300#")
    await world.watch(7.0)
    ra, dec = await world.told_place()
    await world.sync(ra, dec - 8.0 * pole)


def waits(hours: float) -> Step:
    async def step(world: World, dice: Random) -> None:
        for _ in range(int(hours * 12)):
            await world.watch(300.0, 60.0)

    return step


DAY: dict[str, Any] = {"lowest": -90.0}
_WITHOUT = Slip(config=lambda site: None)


def attacks() -> Iterator[Attack]:
    everyone = tuple(KINDS)
    for hours in (1.0, -1.0, 5.0, -5.0):
        slip, name = Slip(told=hours * HOUR), f"told clock {hours:+g} h"
        yield Attack(f"{name}, low gotos", everyone, (to_low_places,), "night", LOWEST, slip)
        yield Attack(f"{name}, to the Sun", everyone, (to_the_sun,), "day", DAY, slip)
    for hours in (-3.0, 2.0, 12.0):
        set_clock, name = clock(hours * HOUR), f"a program's clock {hours:+g} h"
        yield Attack(f"{name}, low gotos", MEADES, (set_clock, to_low_places), "night", LOWEST)
        yield Attack(f"{name}, to the Sun", MEADES, (set_clock, to_the_sun), "day", DAY)
        yield Attack(f"{name}, arrows at the Sun", MEADES, (set_clock, arrows_at_the_sun), "day", DAY)
    yield Attack("a program's longitude, to the Sun", MEADES, (other_longitude, to_the_sun), "day", DAY)
    yield Attack("the same, nobody else knows the site", MEADES, (other_longitude, to_the_sun), "day", DAY, _WITHOUT)
    yield Attack("a program's longitude, low gotos", MEADES, (other_longitude, to_low_places), limits=LOWEST)
    for degrees in (14.0, -14.0):
        yield Attack(f"a sync of {degrees:+g}°, low gotos", everyone, (synced(degrees), to_low_places), limits=LOWEST)
        yield Attack(f"a sync of {degrees:+g}°, arrows down", everyone, (synced(degrees), arrows_down), limits=LOWEST)
        yield Attack(f"a sync of {degrees:+g}°, to the Sun", everyone, (synced(degrees), to_the_sun), "day", DAY)
        yield Attack(f"a sync of {degrees:+g}°, over the top", everyone, (synced(degrees), arrows_over), limits=LOWEST)
        high = synced(degrees, altitude=85.0)
        yield Attack(f"a sync of {degrees:+g}° at 85°, then by day", everyone,
                     (high, waits(2.4), to_the_sun, arrows_at_the_sun), "dawn", DAY)  # fmt: skip
        yield Attack(f"a sync of {degrees:+g}° at 85°, then low", everyone, (high, to_low_places, arrows_down),
                     limits={"lowest": 15.0})  # fmt: skip
    for degrees, times, altitude in ((60.0, 1, 88.5), (15.0, 9, 86.0), (4.0, 20, 87.0)):
        yield Attack(f"{times} syncs of {degrees:g}° of hour angle at {altitude:g}°, to the Sun", everyone,
                     (synced(degrees, altitude=altitude, times=times), to_the_sun), "day", DAY)  # fmt: skip
    yield Attack("a sync over the pole, arrows down", POLAR, (turned_at_the_pole, arrows_down), "night", LOWEST)
    yield Attack("a sync over the pole, to the Sun", POLAR, (turned_at_the_pole, to_the_sun), "day", DAY)
    yield Attack("gotos anywhere above 20°", POLAR, (anywhere,), "night", LOWEST)
    yield Attack("gotos anywhere by day", everyone, (anywhere, anywhere), "day")
    yield Attack("arrows down", everyone, (arrows_down,), limits=LOWEST)
    yield Attack("arrows over the top", everyone, (arrows_over,), limits=LOWEST)
    yield Attack("tracking and pulses down", everyone, (tracks_down,), limits=LOWEST)
    yield Attack("arrows at the Sun", everyone, (arrows_at_the_sun,), "day", DAY)
    yield Attack("past the Sun", everyone, (past_the_sun,), "day")
    yield Attack("park and home by day", everyone, (parks,), "day", {"park": "mount"})
    yield Attack("told clock +12 h, past the Sun", ALTAZ, (past_the_sun, past_the_sun), "day", DAY,
                 Slip(told=12.0 * HOUR))  # fmt: skip
    yield Attack("arrows at the pier", POLAR, (arrows_at_the_pier,), limits={"hour_angle_limit": 0.5, "lowest": 5.0})


def starts_at(attack: Attack, dice: Random, site: Pair) -> float:
    """Return the moment; dawn is an hour before the Sun rises."""
    if attack.starts != "dawn":
        return on_date(dice, site, attack.starts == "day")
    while True:
        unix = on_date(dice, site, False)
        if altitude_at(site, *sun_position(unix + HOUR), unix + HOUR) > -3.0:
            return unix


async def assault(attack: Attack, kind: str, seed: int) -> Result:
    """Play one attack on one kind of mount; return what came of it."""
    dice = Random(f"{attack.name} {kind} {seed}")
    site = SITES[seed % len(SITES)]
    async with World(kind, site, starts_at(attack, dice, site), attack.slip, attack.limits) as world:
        await goes(world, dice.uniform(0.0, 360.0) if attack.starts == "night" else sun_at(world)[0] + 120.0, 45.0)
        world.looks = [world.look()]
        for step in attack.steps:
            await step(world, dice)
        found, through = world.looks, ""
        if any(look.altitude < world.lowest - LOW for look in found) and found[0].altitude > world.lowest:
            through = "D2"
        past = max(look.past for look in found)
        if "hour_angle_limit" in attack.limits and past > attack.limits["hour_angle_limit"] * 15.0 + PAST:
            through = "D2"
        near = min(look.sun for look in found)
        if near < min(CIRCLE, found[0].sun) - NEAR:
            through = "D1"
        return Result(attack.name, kind, through, min(look.altitude for look in found), near, past)
