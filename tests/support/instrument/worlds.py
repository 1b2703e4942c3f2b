"""The worlds in which evenings and attacks are played: kinds of mounts, slips of an evening, and the truth.

A world is a whole gateway on virtual time over a simulated mount at its own speed. What the mount alone would do is
calculated beforehand, from a copy of its mechanics. Angles are degrees.
"""

from __future__ import annotations

import asyncio
import copy
import time
from collections.abc import Mapping
from random import Random
from types import MappingProxyType
from typing import Any, NamedTuple

from gateway.astro.axes import Build, Geometry, Observer, Pair
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import horizon_to_hour_angle, hour_angle_to_horizon, separation, wrap180, wrap360
from gateway.core import operations as op
from gateway.diagnostics.rehearsal.stage import RehearsalGateway
from gateway.protocols.mechanics.mount import Mechanics
from gateway.protocols.mechanics.truth import sun_position
from tests.support.typed_programs import dms, hms

#: Degrees: the Sun is up from here on, and no tube comes nearer to it than the circle.
RISEN, CIRCLE = -0.9, 20.0
#: Seconds between two looks at the tube.
LOOK = 0.25
HOUR = 3600.0
EPHEMERIS = Sky()
NOTHING: Mapping[str, Any] = MappingProxyType({})


class Kind(NamedTuple):
    """A kind of mount: protocol, model and version, how its simulator is set up, and what is said to it at first."""

    driven: str
    model: str
    version: str | None = None
    simulated: Mapping[str, Any] = NOTHING
    first: bytes = b""


KINDS = {
    "cpc": Kind("nexstar", "cpc", "4.21"), "6-8se": Kind("nexstar", "6-8se"),
    "cpc wedge": Kind("nexstar", "cpc", "4.21", {"wedge": True}), "cge": Kind("nexstar", "cge", "4.21"),
    "cgem": Kind("nexstar", "cgem", "5.31"), "avx": Kind("nexstar", "avx"), "lx200gps": Kind("lx200", "lx200gps"),
    "lx200gps polar": Kind("lx200", "lx200gps", first=b":AP#"), "autostar": Kind("lx200", "autostar"),
    "classic polar": Kind("lx200", "lx200"),
    "synscan": Kind("nexstar", "synscan"), "synscan-az": Kind("nexstar", "synscan-az"),
    "onstep": Kind("lx200", "onstep"), "teenastro": Kind("lx200", "teenastro"),
    "alpaca german": Kind("alpaca", "german"), "alpaca altaz": Kind("alpaca", "altaz"),
    "alpaca polar": Kind("alpaca", "polar"),
}  # fmt: skip
SITES: tuple[Pair, ...] = ((45.0, 10.0), (-33.5, 150.0), (28.0, -106.0), (-35.0, -70.3), (59.3, 24.8), (-44.0, 170.5))


class Slip(NamedTuple):
    """What is wrong in an evening, seconds ahead and degrees: the clock that the mount tells (it points right), the
    computer's clock, and the configured site (``config``: None for none, else a function of the true one).
    """

    told: float = 0.0
    computer: float = 0.0
    config: Any = staticmethod(lambda site: site)
    doubtful: bool = False
    latency: float = 0.05
    syncs: tuple[int, float] = (0, 0.0)
    phone: float = 0.0


SLIPS = {
    "right": Slip(), "zone +1 h": Slip(told=HOUR), "board -5 h": Slip(computer=-5 * HOUR),
    "computer +1 h": Slip(computer=HOUR),
    "longitude's sign": Slip(config=lambda site: (site[0], -site[1])),
    "computer +12 h": Slip(computer=12 * HOUR), "computer -12 h": Slip(computer=-12 * HOUR),
    "mount +3 min": Slip(told=180.0), "site 0.7°": Slip(config=lambda site: (site[0] + 0.7, site[1])),
    "doubtful computer": Slip(computer=-40 * HOUR, doubtful=True), "slow line": Slip(latency=0.3),
    "sync of 3°": Slip(syncs=(1, 3.0)), "ten syncs": Slip(syncs=(10, 0.5)), "phone +1 h": Slip(phone=HOUR),
}  # fmt: skip


def on_date(dice: Random, site: Pair, day: bool) -> float:
    """Return a moment of 2026 at which the Sun is well up, or well down, and stays so for a while."""
    while True:
        unix = 1767225600.0 + dice.random() * 365 * 86400.0
        height = [altitude_at(site, *sun_position(moment), moment) for moment in (unix, unix + 1500.0)]
        if min(height) > 8.0 if day else max(height) < -8.0:
            return unix


def altitude_at(site: Pair, ra: float, dec: float, unix: float) -> float:
    return hour_angle_to_horizon(wrap180(Observer(*site).lst(unix) - ra), dec, site[0])[1]


class Look(NamedTuple):
    """One look at the tube: its altitude, azimuth, distance from the Sun (180 with the Sun down), the hour angle of a
    German mount's shaft past the meridian, or of a polar fork (-90 on an alt-az one).
    """

    altitude: float
    azimuth: float
    sun: float
    past: float

    @classmethod
    def at(cls, mechanics: Mechanics, now: float) -> Look:
        first, second = mechanics.axes(now)
        ground = mechanics.true_sky
        hour_angle, dec = Geometry(mechanics.build, ground.latitude).ha_dec_of_axes(first, second)
        azimuth, altitude = hour_angle_to_horizon(hour_angle, dec, ground.latitude)
        there, sidereal = sun_position(now), ground.lst(now)
        up = hour_angle_to_horizon(sidereal - there[0], there[1], ground.latitude)[1] > RISEN
        past = {Build.GERMAN: abs(wrap180(first - 90.0)) - 90.0, Build.WEDGE: abs(wrap180(hour_angle))}
        return cls(
            altitude, azimuth, separation(hour_angle, dec, sidereal - there[0], there[1]) if up else 180.0,
            past.get(mechanics.build, -90.0),
        )  # fmt: skip


class Way(NamedTuple):
    """A way of the tube: the looks at it, and the true right ascension and declination at its end."""

    looks: list[Look]
    end: Pair

    def keeps(self, lowest: float, slack: float = 0.0) -> bool:
        """Whether it keeps above an altitude and out of the circle, or comes no nearer than where it begins."""
        first = self.looks[0]
        low, near = min(lowest, first.altitude) - slack, min(CIRCLE, first.sun) - slack
        return all(look.altitude >= low and look.sun >= near for look in self.looks)


class World:
    """One gateway over one mount. ``limits`` are settings of the configuration."""

    def __init__(
        self, kind: str, site: Pair, start: float, slip: Slip = Slip(), limits: Mapping[str, Any] = NOTHING
    ) -> None:
        made, config = KINDS[kind], dict(limits)
        self.kind, self.site, self.slip = kind, site, slip
        if (configured := slip.config(site)) is not None:
            config["site"] = configured
        if slip.doubtful:
            config["computer_clock"] = "doubtful"
        self.stage = RehearsalGateway(
            made.model, made.version, driven=made.driven, presented="lx200", surface="lx200gps", start=start,
            site=site, latency=slip.latency, sky=EPHEMERIS, config=config, host_ahead=slip.computer,
            simulated=dict(made.simulated),
        )  # fmt: skip
        self.sim: Any = self.stage.sim
        self.lowest = float(config.get("lowest", -90.0))
        own: Any = getattr(self.sim, "utc", None)
        if slip.told:
            vars(self.sim)["utc"] = lambda: own() + slip.told
        if made.first:
            self.sim.feed(made.first)
        self.looks: list[Look] = []

    @property
    def mechanics(self) -> Mechanics:
        return self.sim.mechanics  # type: ignore[no-any-return]

    @property
    def now(self) -> float:
        return self.stage.clock()

    async def __aenter__(self) -> World:
        await self.stage.__aenter__()
        self.program = self.stage.client("10.0.0.7")
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.stage.__aexit__()

    # --- the sky ------------------------------------------------------------------------------------------------------

    def place(self, azimuth: float, altitude: float) -> Pair:
        """Return right ascension and declination of a point over the true horizon."""
        hour_angle, dec = horizon_to_hour_angle(azimuth, altitude, self.site[0])
        return wrap360(Observer(*self.site).lst(self.now) - hour_angle), dec

    def believed(self, place: Pair) -> float:
        """Return the altitude of a place by the site and clock that the mount tells."""
        ground = self.mechanics.sky
        unix = self.now + ground.clock_ahead + self.slip.told
        return altitude_at((ground.latitude, ground.longitude), *place, unix)

    # --- the mount ----------------------------------------------------------------------------------------------------

    def alone(self, goal: Pair, horizontal: Pair | None = None) -> Way:
        """Return the way that the mount alone would take to a goal (``horizontal``: to an azimuth and altitude)."""
        twin, now = copy.deepcopy(self.mechanics), self.now
        if horizontal is not None and twin.build is Build.ALTAZ:
            twin.goto_axes(now, *horizontal)
        else:
            twin.goto_sky(now, *goal)
        looks = [Look.at(twin, now)]
        while twin.slewing(now):
            now += LOOK
            looks.append(Look.at(twin, now))
        return Way(looks, twin.true_position(now))

    def look(self) -> Look:
        self.sim.advance_to_now()
        self.looks.append(Look.at(self.mechanics, self.sim.now))
        return self.looks[-1]

    async def watch(self, seconds: float, every: float = LOOK) -> list[Look]:
        """Look at the tube for a while."""
        began = len(self.looks)
        for _ in range(max(1, round(seconds / every))):
            await asyncio.sleep(every)
            self.look()
        return self.looks[began:]

    async def rest(self, most: float = 200.0, still: float = 1.25) -> list[Look]:
        """Look at the tube until it has rested for a moment."""
        began, quiet, seconds = len(self.looks), 0.0, 0.0
        while quiet < still and seconds < most:
            await asyncio.sleep(LOOK)
            seconds += LOOK
            self.look()
            quiet = 0.0 if self.mechanics.is_moving(self.sim.now) else quiet + LOOK
        return self.looks[began:]

    # --- a program ----------------------------------------------------------------------------------------------------

    async def ask(self, data: bytes, until: bytes = b"", seconds: float = 6.0) -> bytes:
        return await self.program.ask(data, seconds, ending=until)

    async def tell(self, data: bytes) -> None:
        self.program.send(data)
        await asyncio.sleep(0.3)

    async def target(self, ra: float, dec: float) -> None:
        await self.ask(f":Sr{hms(ra)}#:Sd{dms(dec)}#".encode(), b"11")

    async def goto(self, ra: float, dec: float, horizontal: bool = False) -> str:
        """Send a goto, also to azimuth and altitude; return the refusal, empty if it has begun."""
        if horizontal:
            sign = "-" if dec < 0 else "+"
            await self.ask(f":Sz{ra:03.0f}*00#:Sa{sign}{abs(dec):02.0f}*00#".encode(), b"11")
        else:
            await self.target(ra, dec)
        self.program.send(b":GR#:GD#")  # programs poll
        await asyncio.sleep(1.0 + 4.0 * self.slip.latency)
        self.stage.entries.clear()
        heard = (await self.ask(b":MA#" if horizontal else b":MS#")).decode("latin-1")
        return "" if heard == "0" else heard.strip("#") or "no answer"

    async def sync(self, ra: float, dec: float) -> bytes:
        await self.target(ra, dec)
        heard = await self.ask(b":CM#", b"#")
        await asyncio.sleep(0.5)
        return heard

    async def told_place(self) -> Pair:
        """Return where the gateway says that the tube points."""
        here = await self.stage.controller.read(op.Position())
        return here.ra, here.dec

    async def set_clock(self, ahead: float) -> None:
        """Set the clock by :SG :SL :SC, in UTC."""
        moment = time.gmtime(self.now + ahead)
        await self.ask(time.strftime(":SG+00#:SL%H:%M:%S#:SC%m/%d/%y#", moment).encode(), seconds=4.0, until=b"\0")
        await asyncio.sleep(12.0)

    def notes(self) -> list[str]:
        return [entry.note for entry in self.stage.entries if entry.arrow == "!" and entry.note]
