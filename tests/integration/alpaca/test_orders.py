"""What follows one order and precedes the next: tracking is as before, and a newer goto finds a mount that rests.

Judged by the simulated mount; the reasons of refusals by what a program is told.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.diagnostics.virtual_time import run
from gateway.protocols.alpaca.simulator.telescope import INVALID_OPERATION, AlpacaError
from tests.integration.alpaca.test_servers import arrive, goal, server
from tests.support.in_process_gateway import Bridge

Served = Callable[[str, str, dict[str, str]], Any]


def serves(bridge: Bridge, instead: Callable[[Served, str, str, dict[str, str]], Any]) -> None:
    """Let the server answer otherwise: ``instead`` gets its usual answer, the method, the member and the fields."""
    usual = bridge.sim.respond

    def respond(method: str, path: str, given: dict[str, str]) -> Any:
        return instead(lambda *_: usual(method, path, given), method, path.rpartition("/")[2], given)

    bridge.sim.respond = respond  # type: ignore[method-assign]


def refuses(bridge: Bridge, member: str, **fields: str) -> None:
    def instead(usual: Served, method: str, name: str, given: dict[str, str]) -> Any:
        if method == "PUT" and name == member and fields.items() <= given.items():
            raise AlpacaError(INVALID_OPERATION, "Not in this season")
        return usual(method, name, given)

    serves(bridge, instead)


HORIZON = op.GotoHorizontal(120.0, 50.0)


@pytest.mark.parametrize("tracks", [True, False])
@pytest.mark.parametrize("end", ["arrival", "refusal", "stop", "abort", "newer goto"])
async def test_tracking_is_unchanged_after_a_goto_over_the_horizon(tracks: bool, end: str) -> None:
    async with server("altaz", config={"lowest": -90.0}) as one:
        ask = one.controller.perform
        await ask(op.SetTracking(tracks))
        if end == "refusal":
            refuses(one, "slewtoaltazasync")
            with pytest.raises(Fault, match=r"refused this.*Not in this season"):
                await ask(HORIZON)
        else:
            await ask(HORIZON)
            assert one.sim.slewing and not one.sim.tracks
            await asyncio.sleep(4.0)
            if end == "stop":
                await one.controller.stop()
            elif end == "abort":
                await ask(op.AbortSlew())
            elif end == "newer goto":
                await ask(goal(one))
                tracks_then = one.sim.tracks
                await arrive(one)
                assert tracks_then
            else:
                assert ((await ask(op.GetStatus())).tracking is op.Tracking.ALTAZ) is tracks, "it will be on again"
                await arrive(one)
                assert separation(*one.sim.azimuth_altitude(), HORIZON.az, HORIZON.alt) < 0.02
        await asyncio.sleep(2.0 if end != "refusal" else 0.0)
        assert one.sim.tracks is (tracks or end == "newer goto")
        await asyncio.sleep(10.0)
        status = await ask(op.GetStatus())
        assert (status.tracking is op.Tracking.ALTAZ) is one.sim.tracks is (tracks or end == "newer goto")


@pytest.mark.parametrize("stop", [op.AbortMotion(), op.AbortSlew()])
def test_stop_restores_tracking_that_a_server_reports_as_off_during_a_slew(stop: op.Operation[Any]) -> None:
    """Its AbortSlew turns tracking off, too."""

    async def program() -> None:
        async with server(platform=6) as one:

            def instead(usual: Served, method: str, name: str, given: dict[str, str]) -> Any:
                if (method, name) == ("GET", "tracking") and one.sim.reports_slewing:
                    return False
                answer = usual(method, name, given)
                if name == "abortslew":
                    one.sim.track(False)
                return answer

            serves(one, instead)
            await one.controller.perform(goal(one, 90.0))
            await asyncio.sleep(8.0)
            assert one.sim.slewing
            await one.controller.perform(stop)
            assert not one.sim.tracks
            await asyncio.sleep(0.5)
            await one.controller.read_now(op.GetStatus())
            await asyncio.sleep(2.0)
            assert one.sim.tracks and not one.sim.slewing
            await one.controller.perform(goal(one, 90.0))
            await asyncio.sleep(2.0)
            await one.controller.perform(stop)
            await one.controller.perform(goal(one, 60.0))
            assert one.sim.slewing and one.sim.tracks, "a goto directly after the stop finds tracking on"

    run(program())


@pytest.mark.parametrize("first", ["goto", "arrow"])
def test_goto_waits_until_the_previous_motion_has_ended(first: str) -> None:
    """The server refuses a slew while the mount slows down, which takes its time."""

    async def program() -> None:
        async with server(config={"lowest": -90.0}) as one:
            ends = 0.0

            def instead(usual: Served, method: str, name: str, given: dict[str, str]) -> Any:
                nonlocal ends
                if name == "abortslew" or (name == "moveaxis" and not float(given["Rate"])):
                    ends = one.clock() + 1.5
                if (method, name) == ("GET", "slewing") and one.clock() < ends:
                    return True
                if name.startswith("slewto") and one.clock() < ends:
                    raise AlpacaError(INVALID_OPERATION, "The mount is not at rest")
                return usual(method, name, given)

            serves(one, instead)
            if first == "goto":
                await one.controller.perform(goal(one, 90.0))
            else:
                await one.controller.perform(op.Move(op.Direction.WEST, op.Rate(degrees=0.5)))
            await asyncio.sleep(2.0)
            there = goal(one, 60.0)
            await one.controller.perform(there)
            await arrive(one)
            assert separation(*one.sim.true_position(), there.ra, there.dec) < 0.01

    run(program())


def test_stop_cancels_a_waiting_goto() -> None:
    async def program() -> None:
        async with server(config={"lowest": -90.0}) as one:

            def instead(usual: Served, method: str, name: str, given: dict[str, str]) -> Any:
                return True if (method, name) == ("GET", "slewing") else usual(method, name, given)

            await one.controller.perform(goal(one, 90.0))
            await asyncio.sleep(2.0)
            serves(one, instead)
            newer = asyncio.ensure_future(one.controller.perform(goal(one, 60.0)))
            await asyncio.sleep(1.0)
            assert not newer.done() and not one.sim.slewing
            await one.controller.perform(op.AbortMotion())
            await asyncio.sleep(15.0)
            assert not one.sim.slewing
            with suppress(Fault):
                await newer

    run(program())


@pytest.mark.parametrize(
    ("member", "parked", "tracks", "order", "words"),
    [
        ("unpark", True, True, op.Unpark(), "refused this"),
        ("tracking", False, False, op.SetTracking(True), "refused this"),
        ("tracking", True, False, op.SetTracking(True), "refused this"),
        ("slewtoaltazasync", False, False, HORIZON, "refused this"),
        ("slewtoaltazasync", False, True, HORIZON, "refused this"),
        ("park", False, False, op.Park(), "refused this"),
        ("synctocoordinates", False, False, op.Sync(0.0, 60.0), "not track: turn tracking on first"),
        ("slewtocoordinatesasync", False, False, op.Goto(0.0, 60.0, track=False), "not track: turn tracking on first"),
        ("slewtocoordinatesasync", True, True, op.Goto(0.0, 60.0), "parked: unpark it first"),
    ],
)  # fmt: skip
async def test_alpaca_refusal_gives_a_reason_that_fits_the_order(
    member: str, parked: bool, tracks: bool, order: op.Operation[Any], words: str
) -> None:
    async with server("altaz", config={"lowest": -90.0}, parked=parked) as one:
        one.sim.track(tracks)
        await asyncio.sleep(10.0)
        refuses(one, member)
        here = await one.controller.answer(op.Position())
        given = op.Sync(here.ra, here.dec) if isinstance(order, op.Sync) else order
        with pytest.raises(Fault, match=rf"{words}.*says: .Not in this season"):
            await one.controller.perform(given)
