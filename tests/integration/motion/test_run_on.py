"""A mount that runs on is told as moving until it rests, on Alpaca always, elsewhere after gotos; pulses wait for it.

The truth is the simulated axes: they slow down for most of a second after every end.
"""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest

from gateway.diagnostics.rehearsal.stage import RehearsalClient, RehearsalGateway
from gateway.diagnostics.virtual_time import run
from tests.support import exact_sky
from tests.support.truth import moving

START = 1769634000.0
CRAB = "RightAscension=5.5756 Declination=22.0145"
MOUNTS = [("cpc", "nexstar"), ("cgem", "nexstar"), ("gt", "nexstar"), ("lx200gps", "lx200"), ("lx200", "lx200")]
#: Seconds from rest until everybody has been told: two positions and the program's own question.
LATE = 1.2


async def ask(program: RehearsalClient, line: str) -> Any:
    told = json.loads(await program.ask(line.encode() + b"\n", ending=b"\n"))
    return -told["ErrorNumber"] if isinstance(told, dict) else told


async def connected(own: RehearsalGateway) -> RehearsalClient:
    exact_sky.load(own.controller.astrometry.sky)
    client = own.client()
    assert await ask(client, "put connected Connected=True") is None
    return client


async def told_until_rest(own: RehearsalGateway, client: RehearsalClient) -> None:
    """Ask twenty times a second: never at rest while the axes move, and soon at rest after that."""
    clock, rests = own.controller.now, None
    while True:
        told, moves = await ask(client, "get slewing"), moving(own.sim)
        assert told or not moves, "told to be at rest while it moves"
        rests = None if moves else rests or clock()
        if not told:
            return
        assert rests is None or clock() - rests < LATE, "it rests, and is told to move"
        await asyncio.sleep(0.05)


@pytest.mark.parametrize("latency", [0.02, 0.15])
@pytest.mark.parametrize("end", ["put abortslew", "put moveaxis Axis=0 Rate=0"])
@pytest.mark.parametrize("mount", MOUNTS, ids="-".join)
async def test_slewing_is_reported_until_the_mount_rests(mount: tuple[str, str], end: str, latency: float) -> None:
    async with RehearsalGateway(
        mount[0], start=START, driven=mount[1], presented="alpaca", named=True, latency=latency
    ) as own:
        client = await connected(own)
        fastest = max(one["Maximum"] for one in await ask(client, "get axisrates Axis=0"))
        assert await ask(client, f"put moveaxis Axis=0 Rate={fastest}") is None
        await asyncio.sleep(3.0)
        assert await ask(client, end) is None
        assert moving(own.sim)
        await told_until_rest(own, client)


@pytest.mark.parametrize("mount", MOUNTS, ids="-".join)
def test_aborted_goto_reports_slewing_until_rest_on_every_surface(mount: tuple[str, str]) -> None:
    async def program(presented: str, goto: list[bytes], stop: bytes, slews: bytes, done: bytes) -> None:
        async with RehearsalGateway(mount[0], start=START, driven=mount[1], presented=presented, named=True) as own:
            exact_sky.load(own.controller.astrometry.sky)
            client = own.client()
            for frame in goto:
                assert await client.ask(frame)
            await asyncio.sleep(4.0)
            assert own.sim.slewing
            client.send(stop)
            ran_on = False
            for _ in range(200):
                told, moves = await client.ask(slews), moving(own.sim)
                assert told != done or not moves, "told to be at rest while it moves"
                ran_on |= moves
                if told == done:
                    break
                await asyncio.sleep(0.05)
            assert ran_on and not moving(own.sim)

    run(program("lx200", [b":Sr05:34:32#", b":Sd+22*00:52#", b":MS#"], b":Q#", b":D#", b"#"))
    run(program("nexstar", [b"R3B79,0FA8"], b"M", b"L", b"0#"))


async def test_motion_by_hand_reports_no_slewing_to_lx200_and_nexstar_programs() -> None:
    """INDI would never leave *slewing*, and Hamlib drops its gotos."""
    async with RehearsalGateway("cpc", start=START, presented="lx200", named=True) as own:
        client = own.client()
        client.send(b":RS#:Mn#")
        await asyncio.sleep(2.0)
        assert moving(own.sim) and await client.ask(b":D#") == b"#"
        client.send(b":Qn#")
        for _ in range(20):
            assert await client.ask(b":D#") == b"#"
            await asyncio.sleep(0.1)


@pytest.mark.parametrize("mount", [*MOUNTS[:2], *MOUNTS[3:]], ids="-".join)
def test_guide_pulse_right_after_an_arrow_has_its_full_length(mount: tuple[str, str]) -> None:
    async def program() -> None:
        async with RehearsalGateway(mount[0], start=START, driven=mount[1], presented="alpaca", named=True) as own:
            client = await connected(own)
            polar = await ask(client, "get alignmentmode") != 0
            if not polar:
                return
            await asyncio.sleep(1.0)
            rate = await ask(client, "get guideratedeclination")
            fastest = max(one["Maximum"] for one in await ask(client, "get axisrates Axis=1"))
            assert await ask(client, f"put moveaxis Axis=1 Rate={fastest}") is None
            await asyncio.sleep(2.0)
            assert await ask(client, "put moveaxis Axis=1 Rate=0") is None
            before = asyncio.get_running_loop().time()
            assert await ask(client, "put pulseguide Direction=0 Duration=1000") is None
            assert asyncio.get_running_loop().time() - before < 1.7
            start = own.sim.true_position()[1]
            while await ask(client, "get ispulseguiding"):
                assert await ask(client, "get slewing") is False, "a pulse is no slew"
                await asyncio.sleep(0.05)
            await asyncio.sleep(1.0)
            assert abs(own.sim.true_position()[1] - start) == pytest.approx(rate, rel=0.1)

    run(program())


async def test_slewing_becomes_unknown_when_no_position_follows_a_stop() -> None:
    async with RehearsalGateway("cpc", start=START, presented="alpaca", named=True) as own:
        client = await connected(own)
        await ask(client, "put moveaxis Axis=0 Rate=3.0")
        await asyncio.sleep(2.0)
        await ask(client, "put moveaxis Axis=0 Rate=0")
        own.controller.context.run_on.add_position = lambda *_: None  # type: ignore[method-assign]
        assert await ask(client, "get slewing") is True
        await asyncio.sleep(3.5)
        assert await ask(client, "get slewing") == -0x500
