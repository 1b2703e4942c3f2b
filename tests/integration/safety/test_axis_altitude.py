"""On an alt-az mount that tells its axes the altitude limits go by the axis. Judged by where the tube truly points."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.core.errors import Contradicted, Fault
from gateway.diagnostics.virtual_time import run
from gateway.mount.safety.altitude_axis import altitude_of, corrected
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge
from tests.support.truth import sampled


async def synced(bridge: Any, times: int, degrees: float) -> None:
    """Syncs that each take what the mount believes so many degrees north; it looks south."""
    for _ in range(times):
        here = await bridge.controller.answer(op.Position())
        await bridge.controller.perform(op.Sync(here.ra, here.dec + degrees))
        await asyncio.sleep(2.0)


async def lowest_of(bridge: Any, seconds: float) -> float:
    """How low the tube truly comes."""
    lows: list[float] = []
    async with sampled(bridge.sim, lambda truth: lows.append(truth.altitude)):
        await asyncio.sleep(seconds)
    return min(lows)


@pytest.mark.parametrize(("model", "version"), [("cpc", "4.21"), ("6-8se", None), ("cpc", "4.03")])
def test_an_arrow_stops_at_the_limit_whatever_the_syncs_were(model: str, version: str | None) -> None:
    """Four syncs of 14 degrees lift the sky by 56: what is reckoned would let the tube sink far below the ground."""

    async def program() -> None:
        async with Bridge(model, version, config={"lowest": 20.0, "sync_limit": 180.0}, latency=0.05) as bridge:
            await bridge.controller.perform(op.GotoHorizontal(180.0, 40.0))
            await asyncio.sleep(30.0)
            await synced(bridge, 4, 14.0)
            bridge.client().tell(b":RS#:Ms#")
            low = await lowest_of(bridge, 30.0)
            assert 20.0 <= low < 30.0
            assert not bridge.controller.moving

    run(program())


@pytest.mark.parametrize("pause", [0.0, 3.0])
def test_what_was_synced_wrongly_before_the_gateway_began_counts_too(pause: float) -> None:
    """At its keys, or by a program that had the line before."""

    async def program() -> None:
        bridge = Bridge("cpc", config={"lowest": 20.0})
        now = bridge.clock()
        ra, dec = bridge.sim.mechanics.truth(now)
        bridge.sim.mechanics.sync(now, ra, dec + 30.0)
        async with bridge:
            await asyncio.sleep(pause)
            bridge.client().tell(b":RS#:Ms#")
            low = await lowest_of(bridge, 30.0)
            assert 20.0 <= low < 30.0

    run(program())


def test_a_goto_ends_at_the_limit_by_where_the_axis_stands() -> None:
    """The sky is believed 28 degrees higher than it is: what is reckoned at 30 is a tube at 2."""

    async def program() -> None:
        async with Bridge("cpc", config={"lowest": 10.0, "sync_limit": 180.0}) as bridge:
            await bridge.controller.perform(op.GotoHorizontal(180.0, 40.0))
            await asyncio.sleep(30.0)
            await synced(bridge, 2, 14.0)
            sidereal = bridge.sim.mechanics.sky.sidereal(bridge.clock())
            with contextlib.suppress(Fault):
                await bridge.controller.perform(op.Goto(sidereal % 360.0, -15.0))
            await asyncio.sleep(30.0)
            assert truth_of(bridge.sim).altitude > 9.5
            await bridge.controller.perform(op.Goto(sidereal % 360.0, 0.0))
            await asyncio.sleep(30.0)
            assert truth_of(bridge.sim).altitude == pytest.approx(17.0, abs=0.5)

    run(program())


def test_a_wrong_clock_in_the_hand_control_itself_neither_stops_it_nor_lets_it_sink() -> None:
    """Three hours slow, set at its keys: the sky it tells jumps by 45 degrees, and the tube stands where it stood."""

    async def program() -> None:
        async with Bridge("cpc", config={"lowest": 20.0}) as bridge:
            client = bridge.client()
            await bridge.controller.perform(op.GotoHorizontal(180.0, 40.0))
            await asyncio.sleep(30.0)
            bridge.sim.feed(b"H" + bytes((19, 0, 0, 1, 15, 26, 0, 0)))
            for _ in range(60):
                await client.ask(b":GR#")
                await asyncio.sleep(1.0)
            assert bridge.sim.tracking
            client.tell(b":RS#:Ms#")
            low = await lowest_of(bridge, 20.0)
            assert 20.0 <= low < 30.0

    run(program())


@pytest.mark.parametrize("written", [True, False])
def test_a_clock_that_contradicts_this_computers_matters_where_a_limit_is_written(written: bool) -> None:
    """An hour fast: 14 degrees by the mount, less by this computer's clock. Which of them is right nobody knows."""

    async def program() -> None:
        config = {"lowest": 10.0} if written else {}
        async with Bridge("cpc", config=config, host_ahead=3600.0) as bridge:
            seen = bridge.controller.astrometry.equatorial(op.GotoHorizontal(240.0, 14.0))
            if written:
                with pytest.raises(Contradicted, match="differ by 60 minutes"):
                    await bridge.controller.perform(op.Goto(seen.ra, seen.dec))
                return
            await bridge.controller.perform(op.Goto(seen.ra, seen.dec))
            await asyncio.sleep(40.0)
            assert truth_of(bridge.sim).altitude == pytest.approx(14.0, abs=0.5)

    run(program())


def test_it_costs_the_line_one_exchange_a_second_in_motion_and_none_at_rest() -> None:
    async def program() -> None:
        async with Bridge("cpc") as bridge:
            client = bridge.client()

            async def asked(words: bytes, seconds: int) -> int:
                client.tell(words)
                before = len(bridge.sent())
                for _ in range(2 * seconds):
                    client.tell(b":GR#")
                    await asyncio.sleep(0.5)
                return sum(request in (b"z", b"Z") for request in bridge.sent()[before:])

            await asked(b"", 10)
            assert await asked(b"", 60) == 0
            assert 8 <= await asked(b":RG#:Mn#", 10) <= 12
            await asked(b":Qn#", 10)
            assert await asked(b"", 60) == 0

    run(program())


@pytest.mark.parametrize(("reading", "altitude"), [(40.0, 40.0), (100.0, 80.0), (-10.0, -10.0), (350.0, -10.0)])
def test_an_axis_beyond_the_zenith_tells_the_altitude_on_the_other_side(reading: float, altitude: float) -> None:
    assert altitude_of(reading) == pytest.approx(altitude)


@pytest.mark.parametrize(
    ("tilt", "difference", "speed", "then"),
    [
        (None, 0.5, 0.0, 0.0),
        (None, 5.0, 0.0, 5.0),
        (5.0, 0.4, 0.0, 5.4),
        (5.0, 0.4, 4.0, 5.0),
        (5.0, -4.5, 0.0, 0.0),
        (0.0, 1.8, 4.0, 0.0),
        (0.0, 3.0, 4.0, 3.0),
    ],
)
def test_only_what_no_alignment_and_no_motion_explains_is_a_difference(
    tilt: float | None, difference: float, speed: float, then: float
) -> None:
    assert corrected(tilt, difference, speed) == pytest.approx(then)


@pytest.mark.parametrize("latency", [0.02, 0.05, 0.2])
@pytest.mark.parametrize("speed", [2.0, 5.0, 25.0])
def test_a_simulated_mount_that_hurries_is_neither_tilted_nor_stopped(speed: float, latency: float) -> None:
    """The gateway does not know how fast it slews (``sim --speed``): axes and position are read at two instants."""

    async def program() -> None:
        async with Bridge("cpc", simulated={"speed": speed}, latency=latency, config={"sun": 0.0}) as bridge:
            client = bridge.client()
            for goal in (b"08:00:00#:Sd-20", b"04:00:00#:Sd+70", b"12:30:00#:Sd+10", b"00:30:00#:Sd+05"):
                assert (await client.ask(b":Sr" + goal + b"*00:00#:MS#", until=b"110"))[-1:] == b"0"
                for _ in range(60):
                    await asyncio.sleep(0.5)
                    client.tell(b":GR#:GD#:D#")
                ra, dec = bridge.sim.truth()
                assert abs(ra / 15.0 - int(goal[:2]) - int(goal[3:5]) / 60.0) < 0.05
                assert abs(dec - float(goal[-3:])) < 0.3
            said = [entry.note for entry in bridge.entries if "axis reads" in entry.note or "stopped" in entry.note]
            assert not said

    run(program())
