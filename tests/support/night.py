"""A night at a mount on virtual time: a program polls, guides and slews, and every answer is compared with the truth.

The truth is here what the simulated mount itself takes for its position when it is asked. Its clock is set to whole
seconds, so this differs a little from where it really points. At rest, the program must receive one of the positions of
the last 1.2 seconds, to within the rounding of the two wire formats: nothing may drift, however long the night. In
motion the received position must be near the mount's own position now.
"""

from __future__ import annotations

import asyncio
import math
import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from gateway.astro.ephemeris.closed_forms import sidereal_time
from gateway.astro.spherical import (
    fold_declination,
    horizon_to_hour_angle,
    hour_angle_to_horizon,
    separation,
    wrap180,
    wrap360,
)
from tests.support.in_process_gateway import Bridge, Visitor

LATENCY = 0.05
#: Seconds that a position may be old: it counts as fresh for half a second and was on its way before.
OLDEST = 1.2
ARCSECOND = 1.0 / 3600.0
#: In motion the gateway extrapolates, which may be wrong by this many degrees if the motion has just begun, turns or
#: passes a pole: half a second at the 8 degrees a second of a Meade, on both axes.
EXTRAPOLATION_ERROR = 0.5 * 8.0 * math.sqrt(2.0)
#: Half a unit, degrees: of HH:MM:SS, of sDD*MM:SS, of 24 bits of a turn.
SECOND, ARC, BINARY = 7.5 * ARCSECOND, 0.5 * ARCSECOND, 180.0 / 2**24
#: Protocol -> half units of right ascension and declination.
UNITS = {"lx200": (SECOND, ARC), "nexstar": (BINARY, BINARY)}
#: Both mount and gateway report whole seconds, and the gateway asks the mount three times before it knows its clock.
CLOCK = 2.0 + 1.0


class Plan(NamedTuple):
    """The protocol of a program, the mount it is connected to, and whether that mount can be guided."""

    presented: str
    driven: str
    mount: str
    guided: bool


PLANS = (
    Plan("lx200", "nexstar", "6-8se", False),
    Plan("lx200", "nexstar", "cge", True),
    Plan("nexstar", "lx200", "lx200gps", True),
    Plan("nexstar", "lx200", "lx200", True),
)


@dataclass
class Record:
    """The result of a night: counts, and errors in words. ``worst`` is the largest error in units of the wire."""

    polls: int = 0
    gotos: int = 0
    pulses: int = 0
    clocks: int = 0
    worst: float = 0.0
    wrong: list[str] = field(default_factory=list)


class Truth:
    """The right ascensions and declinations that the mount reported lately."""

    def __init__(self, bridge: Bridge, plan: Plan) -> None:
        self._bridge = bridge
        self._asked: dict[str, deque[tuple[float, float]]] = {"ra": deque(maxlen=20), "dec": deque(maxlen=20)}
        self._ticks = tuple(near + far for near, far in zip(UNITS[plan.presented], UNITS[plan.driven], strict=True))
        wire: Any = bridge.controller.line.wire
        self._feed, wire._feed = wire._feed, self._note

    def _note(self, data: bytes) -> bytes:
        answer: bytes = self._feed(data)
        ra, dec = fold_declination(*self._bridge.sim.mechanics.believed(self._bridge.sim.now))
        for name, value, requests in (("ra", ra, (b"e", b":GR#")), ("dec", dec, (b"e", b":GD#"))):
            if data in requests:
                self._asked[name].append((self._bridge.clock(), value))
        return answer

    def units(self, ra: float, dec: float) -> float:
        """Return the distance to the nearest value reported lately, in units of the wire formats; 1 is the ideal."""
        now = self._bridge.clock()
        return max(
            min((abs(wrap180(told - value)) for at, value in self._asked[name] if now - at <= OLDEST), default=360.0)
            / tick
            for name, told, tick in zip(("ra", "dec"), (ra, dec), self._ticks, strict=True)
        )

    def off(self, ra: float, dec: float) -> float:
        """Return the distance from the mount's own position now, as a fraction of the permitted extrapolation error."""
        here = fold_declination(*self._bridge.sim.mechanics.believed(self._bridge.sim.now))
        return separation(ra, dec, *here) / EXTRAPOLATION_ERROR


class Lx200:
    """A program that speaks LX200."""

    def __init__(self, client: Visitor) -> None:
        self._client = client

    async def where(self) -> tuple[float, float]:
        ra = await self._client.ask(b":GR#", until=b"#")
        dec = await self._client.ask(b":GD#", until=b"#")
        hours, minutes, seconds = (int(part) for part in ra.rstrip(b"#").split(b":"))
        degrees, rest = dec[1:].rstrip(b"#").split(b"*")
        arcminutes, arcseconds = (int(part) for part in rest.split(b":"))
        size = int(degrees) + arcminutes / 60.0 + arcseconds / 3600.0
        return (hours + minutes / 60.0 + seconds / 3600.0) * 15.0, -size if dec[:1] == b"-" else size

    async def goto(self, ra: float, dec: float) -> None:
        s, a = round(ra * 240.0) % 86400, round(abs(dec) * 3600.0)
        text = (
            f":Sr{s // 3600:02}:{s // 60 % 60:02}:{s % 60:02}#"
            f":Sd{'-' if dec < 0 else '+'}{a // 3600:02}*{a // 60 % 60:02}:{a % 60:02}#:MS#"
        )
        assert await self._client.ask(text.encode(), 15, until=b"110") == b"110"

    async def slewing(self) -> bool:
        return b"\x7f" in await self._client.ask(b":D#", until=b"#")

    async def begin(self, unix: float) -> None:
        day, seconds = _date(unix, "%m/%d/%y"), _date(unix, "%H:%M:%S")
        said = await self._client.ask(f":St+45*00#:Sg350*00#:SG+00#:SL{seconds}#:SC{day}#".encode(), until=b" #")
        assert said.startswith(b"11111"), said

    async def clock(self) -> float:
        """Return the seconds of the day, UTC."""
        hours, minutes, seconds = (await self._client.ask(b":GL#", until=b"#")).rstrip(b"#").split(b":")
        return int(hours) * 3600.0 + int(minutes) * 60 + int(seconds)

    def guide(self, chance: random.Random) -> None:
        self._client.tell(f":Mg{chance.choice('nsew')}{chance.randrange(50, 800):04}#".encode())

    def park(self) -> None:
        self._client.tell(b":hP#")


class NexStar:
    """A program that speaks NexStar."""

    def __init__(self, client: Visitor) -> None:
        self._client = client

    async def where(self) -> tuple[float, float]:
        said = await self._client.ask(b"e", until=b"#")
        ra, dec = (int(part, 16) / 2**32 * 360.0 for part in said.rstrip(b"#").split(b","))
        return ra, wrap180(dec)

    async def goto(self, ra: float, dec: float) -> None:
        said = await self._client.ask(b"r%06X00,%06X00" % (_bits(ra), _bits(dec)), until=b"#")
        assert said == b"#", said

    async def slewing(self) -> bool:
        return await self._client.ask(b"L", until=b"#") == b"1#"

    async def begin(self, unix: float) -> None:
        fields = [int(_date(unix, name)) for name in ("%H", "%M", "%S", "%m", "%d", "%y")]
        assert await self._client.ask(b"W" + bytes((45, 0, 0, 0, 10, 0, 0, 0)), until=b"#") == b"#"
        assert await self._client.ask(b"H" + bytes((*fields, 0, 0)), until=b"#") == b"#"

    async def clock(self) -> float:
        """Return the seconds of the day, UTC."""
        said = await self._client.ask(b"h", 2)
        assert len(said) == 9, said
        return said[0] * 3600.0 + said[1] * 60 + said[2]

    def guide(self, chance: random.Random) -> None:
        device, rate, ticks = chance.choice((16, 17)), chance.choice((50, 206)), chance.randrange(5, 80)
        self._client.tell(bytes((ord("P"), 3, device, 38, rate, ticks, 0, 0)))

    def park(self) -> None:
        self._client.tell(b"b%06X00,%06X00" % (_bits(180.0), _bits(30.0)))


def _bits(degrees: float) -> int:
    return round(degrees / 360.0 * 2**24) % 2**24


def _date(unix: float, form: str) -> str:
    from datetime import UTC, datetime

    return datetime.fromtimestamp(unix, UTC).strftime(form)


async def night(
    plan: Plan, seconds: float, goto_every: float, seed: int, hourly: Callable[[], None] = lambda: None
) -> Record:
    """Simulate a night of this many seconds; ``hourly`` is called at every full hour."""
    chance, record = random.Random(seed), Record()
    bridge = Bridge(plan.mount, driven=plan.driven, presented=plan.presented, surface=None, latency=LATENCY)
    bridge.wire_log.sinks.clear()  # keep nothing that grows
    async with bridge:
        truth, client = Truth(bridge, plan), bridge.client()
        program = Lx200(client) if plan.presented == "lx200" else NexStar(client)
        await program.begin(bridge.clock())
        await asyncio.sleep(20.0)  # a classic LX200 computes its planets
        began = bridge.clock()
        due_goto, due_pulse, due_hour = began + 20.0, began, began + 3600.0
        slewing, target = False, (0.0, 0.0)
        while bridge.clock() < began + seconds:
            await asyncio.sleep(chance.uniform(0.5, 1.0))
            moving = bridge.controller.moving
            told = await program.where()
            units = truth.off(*told) if moving or bridge.controller.moving else truth.units(*told)
            record.polls, record.worst = record.polls + 1, max(record.worst, units)
            if units > 1.01:
                record.wrong.append(f"at {bridge.clock() - began:.0f} s: received {told}, {units:.1f} units off")
            now = bridge.clock()
            if slewing:
                slewing = await program.slewing()
                here = fold_declination(*bridge.sim.mechanics.believed(now))
                if not slewing and separation(*here, *target) > 30 * ARCSECOND:
                    record.wrong.append(f"at {now - began:.0f} s: a goto to {target} ended at {here}")
            elif now >= due_goto:
                target, slewing, due_goto = _target(bridge, chance), True, now + goto_every
                await program.goto(*target)
                record.gotos += 1
            elif plan.guided and now >= due_pulse:
                program.guide(chance)
                record.pulses, due_pulse = record.pulses + 1, now + chance.uniform(2.0, 3.0)
            if now >= due_hour - 0.5 or record.clocks == 0:
                due_hour += 3600.0 if record.clocks else 0.0
                off = (await program.clock() - bridge.clock() + 43200.0) % 86400.0 - 43200.0
                record.clocks += 1
                if abs(off) > CLOCK:
                    record.wrong.append(f"at {now - began:.0f} s: the clock is {off:.1f} s off")
                bridge.wire.clear()  # it lists everything that the mount has received
                hourly()
        program.park()
        await asyncio.sleep(120.0)
        if await program.slewing() or bridge.sim.slewing:
            record.wrong.append("still slewing to the park position")
        if plan.presented == "lx200" and bridge.sim.tracking:
            record.wrong.append("parked, but tracking")
    return record


def _target(bridge: Bridge, chance: random.Random) -> tuple[float, float]:
    """Return a target well above the horizon, with a path above it too: a goto that dips below is rightly stopped."""
    sidereal = sidereal_time(bridge.clock(), 10.0)
    ra, dec = bridge.sim.truth()
    here = wrap180(sidereal - ra), dec
    while True:
        hour_angle, up = horizon_to_hour_angle(chance.uniform(0.0, 360.0), chance.uniform(25.0, 75.0), 45.0)
        if _stays_up(here, (wrap180(hour_angle), up)):
            return wrap360(sidereal - hour_angle), up


def _stays_up(here: tuple[float, float], there: tuple[float, float]) -> bool:
    """Whether the tube stays above 5 degrees if both equatorial axes turn at equal speed."""
    turns = [end - start for start, end in zip(here, there, strict=True)]
    longest = max(map(abs, turns))
    for step in range(round(longest) + 1):
        now = [start + max(-step, min(step, turn)) for start, turn in zip(here, turns, strict=True)]
        if hour_angle_to_horizon(now[0], now[1], 45.0)[1] < 5.0:
            return False
    return True
