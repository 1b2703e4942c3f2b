"""Programs of four protocols over Alpaca telescopes of three kinds, step by step, judged by the true axes.

What a step found is a figure, or *refused* with the reason, or nothing where the protocol has no words for it. Anything
else is wrong, and there must be none. ``python -m tests.integration.alpaca.test_faces`` prints the whole table.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable
from itertools import product
from typing import Any

import pytest

from gateway.astro.spherical import separation, wrap180, wrap360
from gateway.core.errors import Fault
from gateway.diagnostics.virtual_time import run
from tests.support.faces import FACES, Face, Refusal, face
from tests.support.in_process_gateway import Bridge
from tests.support.owner import Cable
from tests.support.truth import altitude, moving, sampled

KINDS = ("german", "altaz", "polar")
NORTH, SOUTH = (45.0, 10.0), (-33.5, -70.25)
LOWEST = 5.0
#: Arcseconds: what the coarsest notation loses, twice.
EXACT = 20.0


class Wrong(Exception):
    """What is wrong."""


def must(holds: bool, words: str) -> None:
    if not holds:
        raise Wrong(words)


def off(one: tuple[float, float], other: tuple[float, float]) -> float:
    return separation(*one, *other) * 3600.0


class Play:
    """One program over one simulated telescope."""

    def __init__(self, bridge: Bridge, one: Face) -> None:
        self.bridge, self.sim, self.one = bridge, bridge.sim, one
        self.cable = bridge.controller.line.wire = Cable(bridge.controller.line.wire)

    def high(self, east: float, height: float = 30.0) -> tuple[float, float]:
        """Return a place east of the meridian, in round seconds."""
        ra = wrap360(self.sim.mechanics.true_sky.sidereal(self.bridge.clock()) + east)
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
        before = self.sim.truth()
        await asyncio.sleep(4.0)
        must(off(self.sim.truth(), before) < 3.0, f"it does not stand: {off(self.sim.truth(), before):.0f}″ in 4 s")

    async def follows(self) -> float:
        """Return how far the program's position is from the truth."""
        await asyncio.sleep(3.0)
        found = off(await self.one.place(), self.sim.truth())
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
            worst = max(worst, off(self.sim.truth(), there))
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
        return f"{seconds:.1f} s"

    async def sync(self) -> str:
        stood = self.sim.truth()
        ra, dec = await self.one.place()
        there = round(wrap360(ra + 0.5) * 240.0) / 240.0, round((dec + 0.5) * 3600.0) / 3600.0
        await self.one.sync(*there)
        await asyncio.sleep(2.0)
        must(off(self.sim.truth(), stood) < EXACT, "the tube has moved")
        found = off(await self.one.place(), there)
        must(found < EXACT, f"told {found:.0f}″ from what was synced")
        await self.one.sync(*stood)
        await asyncio.sleep(2.0)
        return f"{found:.1f}″"

    def _turned(self, direction: str, before: tuple[float, float, float, float]) -> float:
        """Return how far the tube has turned in a direction; on an alt-az mount n is up and w is along the azimuth."""
        ra, dec, az, height = (now - then for now, then in zip(self._now(), before, strict=True))
        if self.sim.kind.mode == 0:
            return {"n": height, "s": -height, "w": wrap180(az), "e": -wrap180(az)}[direction]
        return {"n": dec, "s": -dec, "w": -wrap180(ra), "e": wrap180(ra)}[direction]

    def _now(self) -> tuple[float, float, float, float]:
        return *self.sim.truth(), *self.sim.horizon()

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
            must(turned > 0.5, f"{direction}: {turned:.2f}°")
            await self.stands()
            found.append(turned)
        return f"{min(found):.1f}…{max(found):.1f}°"

    async def tap(self) -> str:
        before = self._now()
        await self.one.arrow("n", 0.1)
        await self.rests(5.0)
        await self.stands()
        turned = abs(self._turned("n", before))
        must(0.001 < turned < 1.5, f"{turned:.3f}°")
        return f"{turned:.2f}°"

    async def pulses(self) -> str:
        worst = 0.0
        for direction in "nswe":
            before = self._now()
            await self.one.pulse(direction, 1000)
            await asyncio.sleep(3.0)
            turned = self._turned(direction, before) * 3600.0
            if "pulseguide" in self.sim.lacks:
                must(off(self.sim.truth(), before[:2]) < 1.0, "it moves without PulseGuide")
                raise Refusal("nothing moves")
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

    async def park(self) -> str:
        await self.one.park()
        for _ in range(60):
            await asyncio.sleep(2.0)
            if self.sim.at == "park":
                break
        must(self.sim.at == "park" and not self.sim.tracking, "it is not parked")
        await self.one.unpark()
        await asyncio.sleep(3.0)
        must(self.sim.at == "", "it is parked")
        await self.one.goto(*self.high(25.0))
        await self.stands()
        return "parked, unparked, a goto"

    async def limits(self) -> str:
        before = self.sim.truth()[1]  # right ascension passes where it does not track
        try:
            await self.one.leave(*self.high(0.0, -70.0))
            must(self.one.nexstar, "a goto below the limit is not refused")  # it has no words for that
        except Refusal:
            pass
        await asyncio.sleep(3.0)
        must(abs(self.sim.truth()[1] - before) < 0.1, "the refused goto moves it")
        latitude = self.sim.mechanics.true_sky.latitude
        await self.one.goto(self.high(0.0)[0], round(latitude - math.copysign(78.0, latitude)))
        if self.one.arrow is None:
            return "refused"
        down, heights, high = "s", list[float](), altitude(self.sim)
        await self.one.arrow(down, 0.5)
        if altitude(self.sim) > high:
            down = "n"
        async with sampled(self.sim, lambda seen: heights.append(seen.altitude)):
            await self.one.arrow(down, 15.0)
            await asyncio.sleep(3.0)
        must(min(heights) > LOWEST - 0.3, f"{min(heights):.1f}°")
        must(min(heights) < LOWEST + 6.0, f"not down to the limit: {min(heights):.1f}°")
        return f"refused; an arrow to {min(heights):.1f}°"

    async def keypad(self) -> str:
        """The owner moves it by its own hand control, which no program hears of."""
        sent = len(self.bridge.wire)
        self.sim.advance_to_now()
        self.sim.move_axis(2, 1.0)
        await asyncio.sleep(3.0)
        must(moving(self.sim), "the gateway has ended the owner's motion")
        self.sim.advance_to_now()
        self.sim.move_axis(2, 0.0)
        await self.rests()
        found = await self.follows()
        orders = [line for line in self.bridge.wire[sent:] if line.startswith((b"put moveaxis", b"put slew"))]
        must(not orders, f"the gateway has sent {orders}")
        return f"{found:.1f}″"

    async def lost(self) -> str:
        """The server answers nothing for 20 s; then everything is as it was."""
        answer = self.sim._answer
        self.sim._answer = lambda frame, later: b""
        await asyncio.sleep(20.0)
        self.sim._answer = answer
        waited = 0
        while waited < 40:
            try:
                if off(await self.one.place(), self.sim.truth()) < EXACT:
                    break
            except (Refusal, ValueError, IndexError, TypeError):
                pass
            await asyncio.sleep(1.0)
            waited += 1
        must(waited < 40, "no position for 40 s after the server came back")
        await self.one.goto(*self.high(25.0))
        must(off(self.sim.truth(), self.high(25.0)) < 3600.0, "the goto goes elsewhere")
        return f"{waited} s"

    async def killed(self) -> str:
        """The server's process is killed during a goto; the new one is not connected to the mount, which goes on."""
        goal = self.high(-50.0)
        await self.one.leave(*goal)
        await asyncio.sleep(2.0)
        self.cable.pull()
        self.sim.connected_since = math.inf
        await asyncio.sleep(2.0)
        must(moving(self.sim), "it does not move")
        self.cable.out = False
        await asyncio.sleep(9.0)
        must(not moving(self.sim), "it moves on")
        must(off(self.sim.truth(), goal) > 3600.0, "it was not stopped")
        return f"{await self.follows():.1f}″"

    async def site(self) -> str:
        sky = self.sim.mechanics.sky
        there = round(sky.latitude) + 1.25, round(sky.longitude) - 2.5
        await self.one.set_site(*there)
        await asyncio.sleep(5.0)
        now = self.sim.mechanics.sky
        must(abs(now.latitude - there[0]) + abs(now.longitude - there[1]) < 1e-3, f"the mount has {now[:2]}")
        told = await self.one.site()
        must(max(abs(one - other) for one, other in zip(told, there, strict=True)) < 0.02, f"read back: {told}")
        return "set, read back"

    async def time(self) -> str:
        wanted = float(round(self.bridge.clock() + 7200.0))
        ahead = wanted - self.bridge.clock()
        await self.one.set_clock(wanted, 1.0, 0)
        await asyncio.sleep(6.0)
        kept = "utcdate" in self.sim.lacks  # then it is in the gateway
        must(
            kept or abs(self.sim.mechanics.sky.ahead - ahead) < 2.5,
            f"the mount is ahead by {self.sim.mechanics.sky.ahead:.1f} s",
        )
        told = await self.one.clock() - self.bridge.clock() - ahead
        must(abs(told) < 2.5, f"read back: {told:.1f} s off")
        return f"{abs(told):.1f} s"


#: The steps in order, and what a program must have words for.
STEPS: dict[str, tuple[Callable[[Play], Awaitable[str]], tuple[str, ...]]] = {
    "position": (Play.position, ()), "goto": (Play.goto, ()), "abort": (Play.abort, ("stop",)),
    "sync": (Play.sync, ("sync",)), "arrows": (Play.arrows, ("arrow",)), "tap": (Play.tap, ("arrow",)),
    "pulses": (Play.pulses, ("pulse",)), "tracking": (Play.tracking, ("tracking",)),
    "owner at the keypad": (Play.keypad, ()), "lost line": (Play.lost, ()), "killed server": (Play.killed, ()),
    "park": (Play.park, ("park", "unpark")),
    "limits": (Play.limits, ()), "site": (Play.site, ("set_site",)), "time": (Play.time, ("set_clock",)),
}  # fmt: skip


async def judged(presented: str, kind: str, *, south: bool = False, **made: Any) -> dict[str, str]:
    """Return what each step found: a figure, ``refused: …``, ``wrong: …``, or - without words for it."""
    surface = {"lx200": "lx200gps", "nexstar": "cge" if kind == "german" else "cpc"}.get(presented)
    bridge = Bridge(
        kind, driven="alpaca", presented=presented, surface=surface, latency=0.02, site=SOUTH if south else NORTH,
        config={"lowest": LOWEST, "sun": 0.0, "park": "mount", "site_time": "always"}, simulated=made,
    )  # fmt: skip
    found: dict[str, str] = {}
    async with bridge:
        one = face(presented, bridge)
        play = Play(bridge, one)
        await one.begin()
        for name, (step, needs) in STEPS.items():
            if any(getattr(one, word) is None for word in needs):
                found[name] = "-"
                continue
            try:
                found[name] = await step(play)
            except Refusal as error:
                found[name] = f"refused: {error}"
            except (Wrong, AssertionError, Fault, ValueError, IndexError, TypeError) as error:
                found[name] = f"wrong: {type(error).__name__} {error}"
            await asyncio.sleep(2.0)
    return found


#: What a program is refused, by the server's abilities: alt-az mounts do not guide here.
REFUSED = {("altaz", "pulses")}


@pytest.mark.sampled(1)
@pytest.mark.parametrize("south", [False, True], ids=["north", "south"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("presented", FACES)
def test_nothing_is_wrong(presented: str, kind: str, south: bool) -> None:
    found = run(judged(presented, kind, south=south))
    assert not {step: words for step, words in found.items() if words.startswith("wrong")}
    refused = {(kind, step) for step, words in found.items() if words.startswith("refused: ")}
    assert refused == (REFUSED & {(kind, step) for step, words in found.items() if words != "-"})


#: What a server lacks or does otherwise -> the steps that are refused then.
SERVERS: dict[str, tuple[dict[str, Any], set[str]]] = {
    "platform 6": ({"platform": 6}, set()),
    "slewing is false while an axis is moved": ({"quiet_axes": True}, set()),
    "J2000": ({"sends_j2000": True}, set()),
    "slews are answered at their end": ({"blocks": True}, set()),
    "no asynchronous slews": ({"lacks": frozenset({"slewtocoordinatesasync"})}, set()),
    "no MoveAxis": ({"lacks": frozenset({"moveaxis"})}, {"arrows", "tap", "limits"}),
    "no PulseGuide": ({"lacks": frozenset({"pulseguide"})}, {"pulses"}),
    "no sync": ({"lacks": frozenset({"synctocoordinates"})}, {"sync"}),
    "no park": ({"lacks": frozenset({"park", "unpark", "atpark"})}, {"park"}),
    "no clock": ({"lacks": frozenset({"utcdate", "siderealtime"})}, set()),
    "a clock of its own": ({"keeps_clock": True}, {"time"}),
    "no side of the pier": ({"lacks": frozenset({"sideofpier", "destinationsideofpier"})}, set()),
    "of date, declared as other": ({"tells": {"equatorialsystem": 0}}, set()),
    "declared as german": ({"tells": {"alignmentmode": 2, "sideofpier": -1}}, set()),
}


@pytest.mark.sampled(1, every=4)
@pytest.mark.parametrize("server", SERVERS)
@pytest.mark.parametrize("kind", KINDS)
def test_other_servers(kind: str, server: str) -> None:
    made, refused = SERVERS[server]
    found = run(judged("alpaca", kind, **made))
    assert not {step: words for step, words in found.items() if words.startswith("wrong")}
    assert {step for step, words in found.items() if words.startswith("refused: ")} - refused <= {
        step for one, step in REFUSED if one == kind
    }


if __name__ == "__main__":
    import sys

    for words, (made, _) in SERVERS.items() if "servers" in sys.argv else ():
        for kind in KINDS:
            for presented in ("lx200", "alpaca"):
                found = run(judged(presented, kind, **made))
                odd = {step: said for step, said in found.items() if said.startswith(("wrong", "refused:"))}
                odd = {step: said for step, said in odd.items() if (kind, step) not in REFUSED}
                print(presented, kind, words, odd)
    for presented in FACES if "servers" not in sys.argv else ():
        for kind in KINDS:
            for south in (False, True):
                if not sys.argv[1:] or f"{presented}-{kind}-{'south' if south else 'north'}".startswith(
                    tuple(sys.argv[1:])
                ):
                    print(presented, kind, "south" if south else "north")
                    for step, words in run(judged(presented, kind, south=south)).items():
                        print(f"    {step:<20} {words}")
