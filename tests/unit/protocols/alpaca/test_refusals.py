"""What the mount refused, Alpaca raises, and an error has a value of the type of its member."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from gateway.diagnostics.rehearsal.stage import RehearsalGateway
from gateway.protocols.alpaca.tables import empty_value
from gateway.protocols.lx200.simulator.server import SimulatedLx200
from gateway.protocols.wireformat.command_set import load
from tests.support import exact_sky
from tests.support.each import each
from tests.unit.protocols.alpaca.test_surface import CRAB, ask, connected, stage

NOT_POSSIBLE, PARKED, INVALID, NOT_CONNECTED = -0x40B, -0x408, -0x401, -0x407


def answering(own: RehearsalGateway, instead: Callable[[bytes], bytes | None]) -> None:
    """Let the simulated Meade answer these frames otherwise, and not carry them out."""
    assert isinstance(own.sim, SimulatedLx200)
    usual = own.sim.answer

    def answer(frame: bytes, later: object) -> bytes:
        told = instead(frame)
        return usual(frame, later) if told is None else told  # type: ignore[arg-type]

    own.sim.answer = answer  # type: ignore[method-assign]


@each("kept", [b":SL", b":SC"])
async def test_clock_refused_by_the_mount_is_an_alpaca_error(kept: bytes) -> None:
    async with stage("lx200gps", "lx200") as own:
        client = await connected(own)
        assert await ask(client, "put utcdate UTCDate=2026-06-01T12:00:00Z") is None
        answering(own, lambda frame: b"0" if frame.startswith(kept) else None)
        assert await ask(client, "put utcdate UTCDate=2026-09-01T12:00:00Z") == NOT_POSSIBLE
        assert (await ask(client, "get utcdate")).startswith("2026-06-01T12:00"), "the mount's own counts"


async def test_alpaca_utc_date_is_set_with_a_zone_that_the_mount_accepts() -> None:
    async with stage("lx200gps", "lx200") as own:
        client = await connected(own)
        answering(own, lambda frame: b"0" if frame.startswith(b":SG") and frame[:6] != b":SG+00" else None)
        assert await ask(client, "put utcdate UTCDate=2026-06-01T12:00:00Z") is None
        await asyncio.sleep(30.0)
        assert "2026-06-01T12:00:29" <= await ask(client, "get utcdate") < "2026-06-01T12:00:32"  # in whole seconds


async def test_tracking_that_does_not_begin_is_an_alpaca_error_and_gotos_still_pass() -> None:
    """Its :GW# goes on saying N: the program is told, and its gotos are let through all the same."""
    async with stage("lx200gps", "lx200") as own:
        exact_sky.load(own.controller.astrometry.sky)
        client = await connected(own)
        assert await ask(client, "put tracking Tracking=false") is None
        assert await ask(client, f"put slewtocoordinatesasync {CRAB}") == NOT_POSSIBLE
        assert await ask(client, f"put synctocoordinates {CRAB}") == NOT_POSSIBLE
        answering(own, lambda frame: b"" if frame in (b":AP#", b":AA#") else None)
        assert await ask(client, "put tracking Tracking=true") == NOT_POSSIBLE
        assert await ask(client, "get tracking") is False
        assert await ask(client, f"put slewtocoordinatesasync {CRAB}") is None
        await asyncio.sleep(1.0)
        assert own.sim.slewing


async def test_alpaca_abort_on_a_parked_mount_is_sent_and_answered_as_parked() -> None:
    async with stage(speed=20.0) as own:
        client, other = await connected(own), own.client("192.0.2.7")
        await ask(client, "put park")
        while not await ask(client, "get atpark"):
            await asyncio.sleep(0.5)
        own.rx_data.clear()
        assert await ask(other, "put abortslew") == PARKED
        assert b"M" in own.rx_data and await ask(client, "get atpark") is True


async def test_alpaca_moveaxis_between_two_rates_moves_at_the_slower_one() -> None:
    async with stage("lx200gps", "lx200") as own:
        client = await connected(own)
        rates = [one["Maximum"] for one in await ask(client, "get axisrates Axis=1")]
        slower, faster = max(rate for rate in rates if rate < 0.5), max(rates)
        for sign in (-1.0, 1.0):
            before = own.sim.true_position()[1]
            assert await ask(client, f"put moveaxis Axis=1 Rate={sign * 0.5}") is None
            await asyncio.sleep(10.0)
            assert abs(abs(own.sim.true_position()[1] - before) / 10.0 - slower) < 0.1 * slower
            assert (own.sim.true_position()[1] > before) is (sign > 0.0)
            assert await ask(client, "put moveaxis Axis=1 Rate=0") is None
            await asyncio.sleep(2.0)
        for rate in (min(rates) / 2.0, faster * 1.1, -faster * 1.1):
            assert await ask(client, f"put moveaxis Axis=1 Rate={rate}") == INVALID, rate
        [told] = {word.text for word in own.wire_log.recent_notices if "MoveAxis" in word.text}
        assert "0.5 degrees a second is done at" in told


def test_alpaca_error_reply_has_an_empty_value_of_its_members_type() -> None:
    commands = load("alpaca").commands
    values = {name: empty_value(commands[name]).get("Value") for name in ("atpark", "altitude", "rightascension",
              "sideofpier", "axisrates", "utcdate", "name", "trackingrates")}  # fmt: skip
    assert values == {
        "atpark": False, "altitude": 0.0, "rightascension": 0.0, "sideofpier": 0, "axisrates": [], "utcdate": "",
        "name": "", "trackingrates": [],
    }  # fmt: skip
    assert all("Value" in empty_value(one) for one in commands.values() if one.request.source.startswith("get "))
    assert empty_value(commands["park"]) == {}
