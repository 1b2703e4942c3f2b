"""An evening of N.I.N.A. and PHD2 at once over Alpaca, in the calls and the rhythm of these programs.

N.I.N.A. connects, reads what the mount can do, polls the device state every two seconds, slews, aborts, slews again and
parks. PHD2 connects by itself, and guides both axes while it asks twice a second whether it still does. What either is
told of motion is compared with what the simulated mount does.
"""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest

from gateway.diagnostics.rehearsal.stage import RehearsalGateway
from gateway.protocols.alpaca.http.programs import AlpacaClient
from tests.support import exact_sky

START = 1769634000.0
#: N.I.N.A.'s reads at connecting, and what it asks again and again.
FIRST = [
    "interfaceversion", "name", "description", "driverinfo", "driverversion", "alignmentmode", "equatorialsystem",
    "canfindhome", "canpark", "cansetpark", "cansettracking", "canslew", "canslewasync", "canslewaltaz", "cansync",
    "canunpark", "canpulseguide", "cansetpierside", "cansetdeclinationrate", "cansetrightascensionrate",
    "cansetguiderates", "trackingrates", "sitelatitude", "sitelongitude",
]  # fmt: skip
AGAIN = [
    "rightascension", "declination", "altitude", "azimuth", "siderealtime", "tracking", "trackingrate", "slewing",
    "atpark", "athome", "sideofpier", "utcdate", "ispulseguiding", "devicestate",
]  # fmt: skip
#: How late a program may be told of an end, seconds: two positions must show it, and are asked for twice a second.
LATE = 2.0
MOUNTS = [("6-8se", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200")]


class Program:
    """One of the two."""

    def __init__(self, stage: RehearsalGateway, host: str) -> None:
        self.own, self._lines = stage, AlpacaClient(stage.acceptor.accept, f"{host}:id-1", host)

    async def _ask(self, line: str) -> Any:
        told = json.loads(await self._lines.ask(line.encode() + b"\n"))
        assert not isinstance(told, dict), (line, told)
        return told

    async def get(self, line: str) -> Any:
        return await self._ask(f"get {line}")

    async def put(self, line: str) -> None:
        assert await self._ask(f"put {line}") is None


async def slewed(nina: Program) -> None:
    """Until it is told that the goto is over: never while the mount slews, and soon after it rests."""
    rests: float | None = None
    while True:
        before = nina.own.sim.slewing
        told = await nina.get("slewing")
        rests = None if nina.own.sim.slewing else rests or nina.own.controller.now()
        if not told:
            assert not before, "it slews"
            return
        assert rests is None or nina.own.controller.now() - rests < LATE, "it rests, and is said to slew"
        await asyncio.sleep(0.5)


async def guide(phd2: Program, seconds: float) -> int:
    """Pulses on both axes every two seconds; ``IsPulseGuiding`` twice a second and at the ends -> how many."""
    clock, sent, end = phd2.own.controller.now, 0, phd2.own.controller.now() + seconds
    while clock() < end:
        began = clock()
        await phd2.put(f"pulseguide Direction={sent % 2} Duration=700")
        acknowledged = clock()
        await phd2.put(f"pulseguide Direction={2 + sent % 2} Duration=900")
        over = clock() + 0.9
        sent += 2
        assert await phd2.get("ispulseguiding")
        await asyncio.sleep(max(0.0, acknowledged + 0.65 - clock()))
        assert await phd2.get("ispulseguiding") and not await phd2.get("slewing")
        await asyncio.sleep(max(0.0, over + 0.6 - clock()))
        assert not await phd2.get("ispulseguiding"), "both are over"
        while clock() < began + 3.0:
            await asyncio.sleep(0.5)
            assert not await phd2.get("ispulseguiding")
    return sent


async def polling(nina: Program) -> None:
    while True:
        for name in AGAIN:
            await nina.get(name)
        await asyncio.sleep(2.0)


@pytest.mark.parametrize("mount", MOUNTS, ids="-".join)
async def test_nina_and_phd2_sharing_a_mount_slew_guide_and_park(mount: tuple[str, str]) -> None:
    async with RehearsalGateway(mount[0], start=START, driven=mount[1], presented="alpaca", named=True) as own:
        exact_sky.load(own.controller.astrometry.sky)
        nina, phd2 = Program(own, "192.168.1.7"), Program(own, "192.168.1.8")
        for one in (nina, phd2):
            await one.put("connect")
            assert not await one.get("connecting") and await one.get("connected")
        for name in FIRST:
            await nina.get(name)
        poll = asyncio.create_task(polling(nina))
        target = (await nina.get("siderealtime") - 1.0) % 24.0
        # near the zenith a pulse takes the azimuth motor of an alt-az Meade several times as long
        dec = -5.0 if mount[0] == "lx200gps" else 35.0
        await nina.put(f"slewtocoordinatesasync RightAscension={target} Declination={dec}")
        assert await nina.get("slewing") and await phd2.get("slewing"), "whoever asks"
        await asyncio.sleep(2.0)
        await nina.put("abortslew")
        await slewed(nina)
        await nina.put(f"slewtocoordinatesasync RightAscension={target} Declination={dec}")
        await slewed(nina)
        assert abs(await nina.get("declination") - dec) < 0.1
        assert await guide(phd2, 12.0) == 8
        await phd2.put("disconnect")
        assert await nina.get("connected") and not await phd2.get("connected")
        await nina.put("park")
        for _ in range(3000):
            if await nina.get("atpark"):
                assert not await nina.get("slewing"), "what is parked is at rest"
                break
            assert await nina.get("slewing") or await nina.get("atpark")
            await asyncio.sleep(0.1)
        assert not own.sim.slewing and not await nina.get("tracking")
        poll.cancel()
        await nina.put("disconnect")
