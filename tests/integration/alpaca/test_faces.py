"""Programs of four protocols over Alpaca telescopes of three kinds, step by step, judged by the true axes.

What a step found is a figure, or *refused* with the reason, or nothing where the protocol has no words for it. Anything
else is wrong, and there must be none.
"""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.evening import EXACT, LOWEST, NORTH, SOUTH, STEPS, Play, Steps, must, off, play
from tests.support.in_process_gateway import Bridge
from tests.support.truth import moving
from tests.support.typed_programs import FACES, Refusal, face

KINDS = ("german", "altaz", "polar")


class Server(Play):
    """The steps that are other ones on an Alpaca telescope."""

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

    async def keypad(self) -> str:
        """The owner moves it by its own hand control, which no program hears of."""
        await self.one.goto(*self.high(25.0))
        sent = len(self.bridge.rx_data)
        self.sim.advance_to_now()
        self.sim.move_axis(2, 1.0)
        await asyncio.sleep(3.0)
        must(moving(self.sim), "the gateway has ended the owner's motion")
        self.sim.advance_to_now()
        self.sim.move_axis(2, 0.0)
        await self.rests()
        found = await self.follows()
        orders = [line for line in self.bridge.rx_data[sent:] if line.startswith((b"put moveaxis", b"put slew"))]
        must(not orders, f"the gateway has sent {orders}")
        return f"{found:.1f}″"

    async def lost(self) -> str:
        """The server answers nothing for 20 s; then everything is as it was."""
        answer = self.sim.answer
        self.sim.answer = lambda frame, later: b""
        await asyncio.sleep(20.0)
        self.sim.answer = answer
        waited = 0
        while waited < 40:
            try:
                if off(await self.one.place(), self.sim.true_position()) < EXACT:
                    break
            except (Refusal, ValueError, IndexError, TypeError):
                pass
            await asyncio.sleep(1.0)
            waited += 1
        must(waited < 40, "no position for 40 s after the server came back")
        await self.one.goto(*self.high(25.0))
        must(off(self.sim.true_position(), self.high(25.0)) < 3600.0, "the goto goes elsewhere")
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
        must(off(self.sim.true_position(), goal) > 3600.0, "it was not stopped")
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
            kept or abs(self.sim.mechanics.sky.clock_ahead - ahead) < 2.5,
            f"the mount is ahead by {self.sim.mechanics.sky.clock_ahead:.1f} s",
        )
        told = await self.one.clock() - self.bridge.clock() - ahead
        must(abs(told) < 2.5, f"read back: {told:.1f} s off")
        return f"{abs(told):.1f} s"


SERVER: Steps = {
    **STEPS, "owner at the keypad": (Server.keypad, ()), "lost line": (Server.lost, ()),
    "killed server": (Server.killed, ()), "park": (Server.park, ("park", "unpark")),
    "site": (Server.site, ("set_site",)), "time": (Server.time, ("set_clock",)),
}  # fmt: skip


async def judged(presented: str, kind: str, *, south: bool = False, **made: Any) -> dict[str, str]:
    """Return what each step found: a figure, ``refused: …``, ``wrong: …``, or - without words for it."""
    surface = {"lx200": "lx200gps", "nexstar": "cge" if kind == "german" else "cpc"}.get(presented)
    bridge = Bridge(
        kind, driven="alpaca", presented=presented, surface=surface, latency=0.02, site=SOUTH if south else NORTH,
        config={"lowest": LOWEST, "sun": 0.0, "park": "mount", "site_time": "always", "guide_directions": "sky"},
        simulated=made,
    )  # fmt: skip
    async with bridge:
        return await play(Server(bridge, face(presented, bridge), "alpaca"), SERVER)


#: What a program is refused, by the server's abilities: alt-az mounts do not guide here.
REFUSED = {("altaz", "pulses")}


@pytest.mark.sampled(1)
@pytest.mark.parametrize("south", [False, True], ids=["north", "south"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("presented", FACES)
def test_observing_session_in_any_protocol_on_alpaca_mounts_has_no_wrong_result(
    presented: str, kind: str, south: bool
) -> None:
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
    "no MoveAxis": ({"lacks": frozenset({"moveaxis"})}, {"arrows", "held", "tap", "limits"}),
    "no PulseGuide": ({"lacks": frozenset({"pulseguide"})}, {"pulses"}),
    "no sync": ({"lacks": frozenset({"synctocoordinates"})}, {"sync"}),
    "no park": ({"lacks": frozenset({"park", "unpark", "atpark"})}, {"park"}),
    "no clock": ({"lacks": frozenset({"utcdate", "siderealtime"})}, set()),
    "a clock of its own": ({"keeps_clock": True}, {"time"}),
    "no side of the pier": ({"lacks": frozenset({"sideofpier", "destinationsideofpier"})}, set()),
    "of date, declared as other": ({"answers": {"equatorialsystem": 0}}, set()),
    "declared as german": ({"answers": {"alignmentmode": 2, "sideofpier": -1}}, set()),
}


def test_observing_session_on_an_alpaca_server_with_synchronous_slews_has_no_wrong_result() -> None:
    """A stop that is written again spares the goto; a site that was read while it was set is no site of the owner."""
    found = run(judged("alpaca", "german", **SERVERS["no asynchronous slews"][0]))
    assert not {step: words for step, words in found.items() if words.startswith("wrong")}


@pytest.mark.sampled(1, every=4)
@pytest.mark.parametrize("server", SERVERS)
@pytest.mark.parametrize("kind", KINDS)
def test_observing_session_on_alpaca_servers_of_any_maker_has_no_wrong_result(kind: str, server: str) -> None:
    made, refused = SERVERS[server]
    found = run(judged("alpaca", kind, **made))
    assert not {step: words for step, words in found.items() if words.startswith("wrong")}
    assert {step for step, words in found.items() if words.startswith("refused: ")} - refused <= {
        step for one, step in REFUSED if one == kind
    }
