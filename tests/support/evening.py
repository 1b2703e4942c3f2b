"""One evening of a program on a mount, step by step, judged by the true axes of the simulated mount.

What a step found is a figure, or *refused* with the reason, or - where the protocol has no words for it. Anything else
is wrong. ``python -m tests.support.evening [MODEL…]`` prints the table of other makers' mounts, in both hemispheres.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import sys
from collections.abc import Awaitable, Callable, Mapping
from itertools import product
from typing import Any

from gateway.astro.axes import Build
from gateway.astro.spherical import hour_angle_to_horizon, separation, wrap180, wrap360
from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.diagnostics.virtual_time import run
from tests.support import exact_sky
from tests.support.in_process_gateway import Bridge
from tests.support.owner import Owner
from tests.support.truth import altitude, moving, sampled
from tests.support.typed_programs import FACES, Face, Refusal, face

NORTH, SOUTH = (45.0, 10.0), (-33.5, -70.25)
LOWEST = 5.0
#: Arcseconds: what the coarsest notation loses, twice.
EXACT = 20.0
MODELS, SYNSCANS = ("onstep", "teenastro"), ("synscan", "synscan-az")
#: The keys of the mount's own keypad that switch tracking off, as a command on another connection.
OFF = {"lx200": b":Td#", "nexstar": b"T\0"}


class Wrong(Exception):
    """What is wrong."""


def must(holds: bool, words: str) -> None:
    if not holds:
        raise Wrong(words)


def off(one: tuple[float, float], other: tuple[float, float]) -> float:
    return separation(*one, *other) * 3600.0


class Play:
    """One program over one simulated telescope."""

    def __init__(self, bridge: Bridge, one: Face, driven: str) -> None:
        self.bridge, self.sim, self.one = bridge, bridge.sim, one
        self.owner = Owner(bridge, driven)
        self.cable = self.owner.cable

    def high(self, east: float, height: float = 30.0) -> tuple[float, float]:
        """Return a place east of the meridian, in round seconds."""
        ra = wrap360(self.sim.mechanics.true_sky.lst(self.bridge.clock()) + east)
        north = 1.0 if self.sim.mechanics.true_sky.latitude > 0 else -1.0
        return round(ra * 240.0) / 240.0, north * height

    async def rests(self, most: float = 30.0) -> float:
        """Wait until no motor turns; return the seconds."""
        for tenths in range(int(most * 10)):
            if not moving(self.sim):
                return tenths / 10
            await asyncio.sleep(0.1)
        raise Wrong(f"it moves for more than {most:g} s")

    async def stands(self) -> None:
        """It tracks, and stands among the stars."""
        await asyncio.sleep(2.0)
        before = self.sim.true_position()
        await asyncio.sleep(4.0)
        must(
            off(self.sim.true_position(), before) < 3.0,
            f"it does not stand: {off(self.sim.true_position(), before):.0f}″ in 4 s",
        )

    async def follows(self) -> float:
        """Return how far the program's position is from the truth."""
        await asyncio.sleep(3.0)
        found = off(await self.one.place(), self.sim.true_position())
        must(found < EXACT, f"told {found:.0f}″ from the truth")
        return found

    # --- the steps ---------------------------------------------------------------------------------------------------

    async def position(self) -> str:
        return f"{await self.follows():.1f}″"

    async def goto(self) -> str:
        worst = 0.0
        for east in (25.0, -25.0):
            there = self.high(east)
            await self.one.goto(*there)
            await self.rests()
            worst = max(worst, off(self.sim.true_position(), there))
            must(worst < EXACT, f"{worst:.0f}″ off")
            await self.follows()
            await self.stands()
        return f"{worst:.1f}″"

    async def abort(self) -> str:
        await self.one.leave(*self.high(50.0))
        await asyncio.sleep(3.0)
        must(self.sim.slewing, "it does not move")
        await self.one.stop()
        seconds = await self.rests(5.0)
        await self.stands()
        await self.one.leave(*self.high(50.0))
        await asyncio.sleep(3.0)
        await self.one.stop()
        there = self.high(25.0)
        await self.one.goto(*there)
        await self.rests()
        must(off(self.sim.true_position(), there) < EXACT, "a goto just after an abort does not arrive")
        return f"{seconds:.1f} s"

    async def sync(self) -> str:
        stood = self.sim.true_position()
        ra, dec = await self.one.place()
        there = round(wrap360(ra + 0.5) * 240.0) / 240.0, round((dec + 0.5) * 3600.0) / 3600.0
        await self.one.sync(*there)
        await asyncio.sleep(2.0)
        must(off(self.sim.true_position(), stood) < EXACT, "the tube has moved")
        found = off(await self.one.place(), there)
        must(found < EXACT, f"told {found:.0f}″ from what was synced")
        await self.one.sync(*stood)
        await asyncio.sleep(2.0)
        return f"{found:.1f}″"

    @property
    def altaz(self) -> bool:
        return bool(self.sim.mechanics.build is Build.ALTAZ)

    def _turned(self, direction: str, before: tuple[float, float, float, float]) -> float:
        """Return how far the tube has turned in a direction; on an alt-az mount n is up and w is along the azimuth."""
        ra, dec, az, height = (now - then for now, then in zip(self._now(), before, strict=True))
        if self.altaz:
            return {"n": height, "s": -height, "w": wrap180(az), "e": -wrap180(az)}[direction]
        return {"n": dec, "s": -dec, "w": -wrap180(ra), "e": wrap180(ra)}[direction]

    def _now(self) -> tuple[float, float, float, float]:
        ra, dec = self.sim.true_position()
        ground = self.sim.mechanics.true_sky
        return ra, dec, *hour_angle_to_horizon(ground.lst(self.sim.now) - ra, dec, ground.latitude)

    async def arrows(self) -> str:
        """On both sides of the meridian, and so of the pier."""
        found = []
        for east, direction in product((25.0, -25.0), "nwse"):
            if direction == "n":
                await self.one.goto(*self.high(east))
            before = self._now()
            await self.one.arrow(direction, 2.0)
            await self.rests(5.0)
            turned = self._turned(direction, before)
            if self.one.of_motors:
                turned = abs(turned)
            must(turned > 0.3, f"{direction}: {turned:.2f}°")
            await self.stands()
            found.append(turned)
        return f"{min(found):.1f}…{max(found):.1f}°"

    async def held(self) -> str:
        """An arrow of 25 s, which an OnStep ends after 10."""
        await self.one.goto(*self.high(25.0, 0.0))
        before, seen = self._now(), list[float]()
        arrow = asyncio.ensure_future(self.one.arrow("n", 25.0))
        for _ in range(2):
            await asyncio.sleep(10.0)
            seen.append(abs(self._turned("n", before)))
        await arrow
        await self.rests(5.0)
        await self.stands()
        must(seen[1] > 1.5 * seen[0] > 0.5, f"it has ended: {seen[0]:.1f}° in 10 s, {seen[1]:.1f}° in 20 s")
        return f"{seen[1] / 20.0:.2f}°/s"

    async def tap(self) -> str:
        await self.one.goto(*self.high(25.0))
        before = self._now()
        await self.one.arrow("n", 0.1)
        await asyncio.sleep(1.0)
        await self.rests(5.0)
        await self.stands()
        turned = abs(self._turned("n", before))
        must(0.001 < turned < 1.5, f"{turned:.3f}°")
        return f"{turned:.2f}°"

    async def pulses(self) -> str:
        worst = 0.0
        await self.one.goto(*self.high(25.0))
        for direction in "nswe":
            before = self._now()
            await self.one.pulse(direction, 1000)
            await asyncio.sleep(3.0)
            turned = self._turned(direction, before) * 3600.0
            if "pulseguide" in getattr(self.sim, "lacks", ()):
                must(off(self.sim.true_position(), before[:2]) < 1.0, "it moves without PulseGuide")
                raise Refusal("nothing moves")
            if self.altaz:
                turned = off(self.sim.true_position(), before[:2])
            if self.one.nexstar:
                turned = abs(turned)
            must(2.0 < turned < 30.0, f"{direction}: {turned:.1f}″")
            worst = max(worst, turned)
        return f"{worst:.1f}″"

    async def tracking(self) -> str:
        await self.one.tracking(False)
        await asyncio.sleep(2.0)
        must(not self.sim.tracking, "it tracks")
        await self.one.tracking(True)
        await asyncio.sleep(2.0)
        must(self.sim.tracking, "it does not track")
        return "off, on"

    async def limits(self) -> str:
        before = self.sim.true_position()[1]  # right ascension passes where it does not track
        with contextlib.suppress(Refusal):
            await self.one.leave(*self.high(0.0, -70.0))
            must(self.one.nexstar, "a goto below the limit is not refused")  # it has no words for that
        await asyncio.sleep(3.0)
        must(abs(self.sim.true_position()[1] - before) < 0.1, "the refused goto moves it")
        latitude = self.sim.mechanics.true_sky.latitude
        await self.one.goto(self.high(0.0)[0], round(latitude - math.copysign(80.0, latitude)))
        if self.one.arrow is None:
            return "refused"
        down, heights = "s", list[float]()
        for _ in range(3):  # the gateway may turn the arrows round after one of them
            high = altitude(self.sim)
            await self.one.arrow(down, 0.2)
            await asyncio.sleep(2.0)
            if altitude(self.sim) > high:
                down = "n" if down == "s" else "s"
        async with sampled(self.sim, lambda seen: heights.append(seen.altitude)):
            await self.one.arrow(down, 28.0)
            await asyncio.sleep(3.0)
        must(min(heights) > LOWEST - 0.3, f"{min(heights):.1f}°")
        must(min(heights) < LOWEST + 3.0, f"not down to the limit: {min(heights):.1f}°")
        return f"refused; an arrow to {min(heights):.1f}°"


Steps = Mapping[str, tuple[Callable[[Any], Awaitable[str]], tuple[str, ...]]]
#: The steps in order that are alike on every mount, and what a program must have words for.
STEPS: Steps = {
    "position": (Play.position, ()), "goto": (Play.goto, ()), "abort": (Play.abort, ("stop",)),
    "sync": (Play.sync, ("sync",)), "arrows": (Play.arrows, ("arrow",)), "held": (Play.held, ("arrow",)),
    "tap": (Play.tap, ("arrow",)), "pulses": (Play.pulses, ("pulse",)), "tracking": (Play.tracking, ("tracking",)),
    "limits": (Play.limits, ()),
}  # fmt: skip


async def play(one: Play, steps: Steps) -> dict[str, str]:
    """Return what each step found."""
    found: dict[str, str] = {}
    await one.one.begin()
    for name, (step, needs) in steps.items():
        if any(getattr(one.one, word) is None for word in needs):
            found[name] = "-"
            continue
        try:
            found[name] = await step(one)
        except Refusal as error:
            found[name] = f"refused: {error}"
        except (Wrong, AssertionError, Fault, ValueError, IndexError, TypeError) as error:
            found[name] = f"wrong: {type(error).__name__} {error}"
        await asyncio.sleep(2.0)
    return found


class Evening(Play):
    """The steps that are other ones on a mount with a line of its own."""

    @property
    def synscan(self) -> bool:
        return self.bridge.sim.model in SYNSCANS

    async def _tracks(self) -> bool:
        return (await self.bridge.controller.answer(op.GetStatus())).tracking is not op.Tracking.OFF

    async def keypad(self) -> str:
        """The owner switches tracking off, presses an arrow, and begins a goto; no program hears of it."""
        await self.one.goto(*self.high(25.0))
        must(await self._tracks(), "it is told not to track")
        stop_tracking = OFF["nexstar" if self.synscan else "lx200"]
        self.sim.connection()(stop_tracking)
        if self.one.tracking is not None:
            await asyncio.sleep(1.0)
            await self.one.tracking(True)
            await asyncio.sleep(2.0)
            must(self.sim.tracking, "tracking is not turned on again")
            self.sim.connection()(stop_tracking)
        await asyncio.sleep(8.0)
        must(not await self._tracks(), "it is told to track")
        await self.bridge.controller.perform(op.SetTracking(on=True))
        await asyncio.sleep(8.0)
        must(await self._tracks() and self.sim.tracking, "it does not track")
        self.owner.keys("up")
        await asyncio.sleep(3.0)
        must(moving(self.sim), "the gateway has ended the owner's arrow")
        self.owner.keys("let go")
        await self.rests()
        await self.follows()
        self.owner.goto(*self.high(-40.0))
        await asyncio.sleep(3.0)
        must(self.sim.slewing, "the gateway has ended the owner's goto")
        await self.rests(60.0)
        must(not self.owner.begun(), f"the gateway has sent {self.owner.begun()}")
        return f"{await self.follows():.1f}″"

    async def lost(self) -> str:
        """The cable is out during a goto: the mount is stopped before anything else."""
        await self.one.leave(*self.high(45.0))
        await asyncio.sleep(2.0)
        must(self.sim.slewing, "it does not move")
        await self.owner.cable_out(5.0)
        await asyncio.sleep(30.0)
        must(not moving(self.sim), "it moves on")
        return f"{await self.follows():.1f}″"

    async def own_limit(self) -> str:
        """A goto that the gateway allows, below the mount's own horizon. A SynScan has none."""
        if self.synscan:
            return "-"
        kept, stood = self.sim.stored_values["lowest"], self.sim.true_position()
        self.sim.stored_values["lowest"] = 60.0
        try:
            await self.one.leave(*self.high(50.0, 0.0))
            must(self.one.nexstar or self.one.stop is None, "the goto is not refused")  # these have no words for that
        finally:
            await asyncio.sleep(2.0)
            self.sim.stored_values["lowest"] = kept
            must(off(self.sim.true_position(), stood) < EXACT, "it went")
        raise Refusal("without words")

    async def site(self) -> str:
        """Another one. A TeenAstro takes it at home or parked only, and the log says so."""
        sky = self.sim.mechanics.sky
        there = round(sky.latitude) + 1.25, round(sky.longitude) - 2.5
        await self.one.set_site(*there)
        await asyncio.sleep(6.0)
        now, told = self.sim.mechanics.sky, await self.one.site()
        must(abs(told[0] - now.latitude) + abs(told[1] - now.longitude) < 0.02, f"it has {now[:2]}, read back: {told}")
        if abs(now.latitude - there[0]) + abs(now.longitude - there[1]) < 0.02:
            return "set, read back"
        words = [one.note for one in self.bridge.entries if "did not take the site" in (one.note or "")]
        must(bool(words), f"it has {now[:2]}, and nobody is told")
        raise Refusal(str(words[-1]))

    async def time(self) -> str:
        worst = 0.0
        for ahead in (90.0, 0.0):
            await self.one.set_clock(round(self.bridge.clock() + ahead), 1.0, 0)
            await asyncio.sleep(12.0)
            kept = self.sim.utc() - self.sim.now - ahead
            told = await self.one.clock() - self.bridge.clock() - ahead
            worst = max(worst, abs(kept), abs(told))
            must(worst < 3.0, f"the mount is {kept:.1f} s off, told {told:.1f} s off")
        return f"{worst:.1f} s"

    async def park(self) -> str:
        await self.one.park()
        await asyncio.sleep(2.0)
        await self.rests(60.0)
        await asyncio.sleep(4.0)
        driver = self.bridge.controller.driver
        must(driver.parked and not self.sim.tracking, "it is not parked")
        if not (self.synscan and not self.one.of_motors):  # the next goto of some programs takes a SynScan up again
            with contextlib.suppress(Refusal):
                await self.one.leave(*self.high(25.0))
            await asyncio.sleep(2.0)
            must(driver.parked and not self.sim.slewing, "parked, it goes")
        await self.one.unpark()
        await asyncio.sleep(4.0)
        must(not driver.parked and self.sim.tracking, "it is not unparked")
        await self.one.goto(*self.high(25.0))
        await self.stands()
        return "parked, unparked, a goto"


EVENING: Steps = {
    **STEPS, "its own limit": (Evening.own_limit, ()), "owner at the keypad": (Evening.keypad, ()),
    "lost line": (Evening.lost, ()), "time": (Evening.time, ("set_clock",)), "park": (Evening.park, ("park", "unpark")),
    "site": (Evening.site, ("set_site",)),
}  # fmt: skip


async def evening(model: str, presented: str, south: bool = False) -> dict[str, str]:
    """Return step -> what it found."""
    driven = "nexstar" if model in SYNSCANS else "lx200"
    surface = {"lx200": "autostar", "nexstar": "cpc" if model == "synscan-az" else "cge"}.get(presented)
    config = {"site_time": "always", "lowest": LOWEST, "sun": 0.0, "guide_directions": "sky"}
    config |= {"park": "mount"} if driven == "lx200" else {}
    bridge = Bridge(
        model, driven=driven, presented=presented, surface=surface, config=config, site=SOUTH if south else NORTH,
        latency=0.02,
    )  # fmt: skip
    async with bridge:
        exact_sky.load(bridge.controller.astrometry.sky)
        return await play(Evening(bridge, face(presented, bridge), driven), EVENING)


def main() -> None:
    for model, presented, south in product(sys.argv[1:] or (*SYNSCANS, *MODELS), FACES, (False, True)):
        for step, words in run(evening(model, presented, south)).items():
            print(f"{model:10} {presented:10} {'south' if south else 'north'} {step:20} {words}")


if __name__ == "__main__":
    main()
