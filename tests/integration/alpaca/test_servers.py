"""What real Alpaca servers do differently, on a simulated telescope: what it lacks, refuses, declares wrongly, forgets.

The simulated telescope was not written from the tables that the driver uses. Judged by where its tube is.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from typing import Any

import pytest

from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, Fault, NoAnswer, Refused, Unsupported
from gateway.diagnostics.virtual_time import run
from gateway.protocols.alpaca.tables import Parked
from tests.support.in_process_gateway import Bridge
from tests.support.truth import moving

ARCMINUTE = 1.0 / 60.0


def server(model: str = "german", config: dict[str, Any] | None = None, **simulated: Any) -> Bridge:
    return Bridge(
        model, driven="alpaca", config={"sun": 0.0, **(config or {})}, latency=0.02, ramps=False, simulated=simulated
    )


def notes(bridge: Bridge) -> str:
    return "\n".join(entry.note for entry in bridge.entries if entry.note)


def goal(bridge: Bridge, east: float = 30.0, dec: float = 40.0) -> op.Goto:
    return op.Goto((bridge.sim.mechanics.sky.lst(bridge.clock()) + east) % 360.0, dec)


async def arrive(bridge: Bridge) -> None:
    await asyncio.sleep(1.0)
    for _ in range(120):
        if not await bridge.controller.answer(op.Slewing()):
            return
        await asyncio.sleep(1.0)
    raise AssertionError("the goto never ends")


@pytest.mark.parametrize(
    ("lacks", "operation", "words"),
    [
        ("moveaxis", op.Move(op.Direction.NORTH, op.Rate(key=5)), "it has no arrows"),
        ("pulseguide", op.Pulse(op.Direction.NORTH, 500), "it cannot be guided"),
        ("park", op.Park(), "it cannot be parked"),
        ("findhome", op.Home(), "it has no home position"),
        ("tracking_put", op.SetTracking(on=False), "its tracking cannot be turned on or off"),
        ("synctocoordinates", op.Sync(10.0, 40.0), "it cannot be synced"),
        ("guideratedeclination_put", op.SetGuideRate(2, 0.3), "its guide rates cannot be set"),
    ],
)
def test_operation_that_an_alpaca_mount_lacks_is_refused_in_words(
    lacks: str, operation: op.Operation[Any], words: str
) -> None:
    async def program() -> None:
        async with server(lacks=frozenset({lacks})) as one:
            if isinstance(operation, op.Sync):
                here = await one.controller.answer(op.Position())
                with pytest.raises(Fault, match=words):
                    await one.controller.perform(op.Sync(here.ra, here.dec - 1.0))
                return
            with pytest.raises(Fault, match=words):
                await one.controller.perform(operation)
            assert not any(
                line.startswith(b"put " + lacks.removesuffix("_put").encode()) for line in one.sent_requests()
            )

    run(program())


async def test_refusal_quotes_the_message_of_the_alpaca_server() -> None:
    async with server(parked=True) as one:
        with pytest.raises(Parked, match=r"unpark it first.*slewtocoordinatesasync"):
            await one.controller.perform(goal(one))
        await one.controller.perform(op.Unpark())
        one.sim.lowest_altitude = 50.0
        with pytest.raises(Refused, match="target is below the limit of 50"):
            await one.controller.perform(goal(one, 60.0, 0.0))
        one.sim.track(False)
        with pytest.raises(Refused, match=r"does not track.*SlewToCoordinates"):
            await one.controller.perform(op.Goto(goal(one).ra, 40.0, track=False))
    async with server(lowest_altitude=5.0, config={"lowest": -20.0}) as one:
        with pytest.raises(BelowHorizon, match=r"below the horizon.*target is below"):
            await one.controller.perform(goal(one, 100.0, 0.0))


@pytest.mark.parametrize("model", ["german", "altaz"])
async def test_first_arrow_teaches_the_gateway_the_sign_of_moveaxis(model: str) -> None:
    async def north(one: Bridge) -> float:
        before, height = one.sim.true_position()[1], one.sim.azimuth_altitude()[1]
        await one.controller.perform(op.Move(op.Direction.NORTH, op.Rate(degrees=0.5)))
        await asyncio.sleep(3.0)
        await one.controller.perform(op.StopAxis(2))
        await asyncio.sleep(2.0)
        return one.sim.true_position()[1] - before if model == "german" else one.sim.azimuth_altitude()[1] - height

    async with server(model, senses=(-1, -1)) as one:
        await one.controller.perform(goal(one))
        await arrive(one)
        assert await north(one) < -0.5
        assert "has moved the tube to the south" in notes(one)
        assert await north(one) > 0.5
    async with server(model, {"reversed_axes": "second"}, senses=(-1, -1)) as one:
        await one.controller.perform(goal(one))
        await arrive(one)
        assert await north(one) > 0.5 and "MoveAxis counts" not in notes(one)


@pytest.mark.parametrize(
    ("sends", "declares", "key", "told"),
    [
        ("jnow", 1, None, ""),
        ("j2000", 2, None, ""),
        ("jnow", 2, None, "declares j2000 coordinates, but its altitude and azimuth fit jnow ones"),
        ("jnow", 2, "jnow", "fit jnow ones"),
        ("j2000", 1, "j2000", "declares jnow coordinates, but its altitude and azimuth fit j2000 ones"),
        ("j2000", 0, None, "an equinox that the gateway does not know: j2000"),
        ("jnow", 3, None, "an equinox that the gateway does not know: jnow"),
    ],
)
async def test_equinox_is_checked_against_what_the_alpaca_server_reports(
    sends: str, declares: int, key: str | None, told: str
) -> None:
    config = {} if key is None else {"equinox": key}
    made = server("altaz", config, sends_j2000=sends == "j2000", answers={"equatorialsystem": declares})
    async with made as one:
        await one.controller.perform(goal(one))
        await arrive(one)
        await asyncio.sleep(5.0)
        there = goal(one, 20.0, 30.0)
        await one.controller.perform(there)
        await arrive(one)
        missed = separation(*one.sim.true_position(), there.ra, there.dec) / ARCMINUTE
        contradicted = bool(told) and key is None and declares in (1, 2)
        assert (missed > 10.0) if contradicted else (missed < 0.5)
        assert told in notes(one) if told else "equinox" not in notes(one)


async def test_stop_reaches_a_server_that_answers_a_slew_only_at_its_end() -> None:
    async with server(blocks=True) as one:
        await one.controller.perform(goal(one, 80.0, 20.0))
        assert one.sim.slewing and await one.controller.answer(op.Slewing())
        await one.controller.stop()
        await asyncio.sleep(1.0)
        assert not one.sim.slewing and one.sim.tracking


async def test_motion_by_hand_is_stopped_though_the_server_reports_no_slew() -> None:
    async with server(quiet_axes=True) as one:
        await one.controller.perform(goal(one))
        await arrive(one)
        await one.controller.perform(op.Move(op.Direction.WEST, op.Rate(degrees=1.0)))
        await asyncio.sleep(1.0)
        assert (await one.controller.answer(op.GetActivity())).by_hand and not one.sim.reports_slewing
        await one.controller.stop()
        await asyncio.sleep(1.5)
        stood = one.sim.true_position()
        await asyncio.sleep(3.0)
        assert separation(*one.sim.true_position(), *stood) < 0.1 * ARCMINUTE


async def test_clock_that_the_server_accepts_but_does_not_set_is_refused() -> None:
    async with server(config={"site_time": "always"}, keeps_clock=True) as one:
        with pytest.raises(Refused, match="reports another one"):
            await one.controller.perform(op.SetClock(one.clock() + 3600.0, 0.0, heard=True))


async def test_mount_lost_by_its_server_is_reported_lost_and_reconnected() -> None:
    async with server() as one:
        one.sim.connected_since = math.inf
        await asyncio.sleep(10.0)
        assert one.sim.connected and "the mount does not answer" not in notes(one)
        await one.controller.perform(goal(one))
        assert one.sim.slewing
        one.sim.connected_since = math.inf
        one.sim.lacks |= {"connected_put"}
        await asyncio.sleep(10.0)
        assert one.controller.line.state == "down"
        with pytest.raises(NoAnswer):
            await one.controller.perform(goal(one))
        one.sim.lacks -= {"connected_put"}
        await asyncio.sleep(10.0)
        assert one.controller.line.state == "up" and not one.sim.slewing
        assert not any(
            line.startswith((b"put disconnect", b"put connected Connected=false")) for line in one.sent_requests()
        )


async def test_program_is_told_that_the_mount_has_no_motion_by_hand() -> None:
    async with server(lacks=frozenset({"moveaxis"})) as one:
        with pytest.raises(Unsupported):
            await one.controller.perform(op.MoveAxis(1, 1, op.Rate(degrees=0.5)))
        assert "MoveAxis" not in (await one.controller.answer(op.GetAbilities())).can


async def test_stop_succeeds_though_one_of_its_requests_is_refused() -> None:
    async with server(lacks=frozenset({"abortslew"})) as one:
        await one.controller.perform(op.Move(op.Direction.SOUTH, op.Rate(degrees=1.0)))
        await asyncio.sleep(1.0)
        await one.controller.stop()
        await asyncio.sleep(1.0)
        stood = one.sim.true_position()
        await asyncio.sleep(2.0)
        assert separation(*one.sim.true_position(), *stood) < 0.1 * ARCMINUTE


@pytest.mark.parametrize("since", [0.3, 1.7, 4.0])
async def test_stop_does_not_wait_for_a_hanging_server(since: float) -> None:
    async with server(config={"lowest": -90.0}) as one:
        await one.controller.perform(op.Move(op.Direction.EAST, op.Rate(degrees=2.0)))
        await asyncio.sleep(1.0)
        wire = one.controller.line.wire
        wire.newest_only = True  # type: ignore[attr-defined]
        answered = wire.write
        wire.write = lambda data: None if data.startswith(b"get") else answered(data)  # type: ignore[method-assign]
        await asyncio.sleep(since)
        assert moving(one.sim)
        with contextlib.suppress(NoAnswer):
            async with asyncio.timeout(0.6):
                await one.controller.perform(op.AbortMotion())
        assert not moving(one.sim)


@pytest.mark.parametrize("first", [True, False], ids=["reversed first", "reversed later"])
async def test_another_server_at_the_same_address_is_examined_anew(first: bool) -> None:
    """The sense of its arrows and its equinox are its own."""

    async def north(one: Bridge) -> float:
        before = one.sim.true_position()[1]
        await one.controller.perform(op.Move(op.Direction.NORTH, op.Rate(degrees=0.5)))
        await asyncio.sleep(3.0)
        await one.controller.perform(op.StopAxis(2))
        await asyncio.sleep(2.0)
        return one.sim.true_position()[1] - before

    async with server("polar", senses=(-1, -1) if first else (1, 1), answers={"equatorialsystem": 1}) as one:
        await one.controller.perform(goal(one))
        await arrive(one)
        await asyncio.sleep(5.0)
        await north(one)
        assert await north(one) > 0.5
        one.sim.senses, one.sim.answers["equatorialsystem"] = (1, 1) if first else (-1, -1), 2
        one.controller.line.transaction.connection_lost("another server")
        await asyncio.sleep(10.0)
        assert (await north(one) > 0.5) is first
        assert await north(one) > 0.5
        assert "declares j2000 coordinates, but" in notes(one)
