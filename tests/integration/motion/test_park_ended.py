"""A park, or a goto by axes, that the owner ends at the keypad is told as ended; nothing calls such a mount parked."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core import operations as op
from gateway.core import requests
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge
from tests.support.owner import Owner

CONFIG = {"lowest": -90.0, "sun": 0.0}


async def polled(bridge: Bridge, seconds: int) -> None:
    for _ in range(seconds):
        await bridge.controller.answer(op.Slewing())
        await asyncio.sleep(1.0)


@pytest.mark.parametrize("mount", ["cpc", "cge"])
@pytest.mark.parametrize("cancelled", [True, False])
async def test_park_cancelled_at_the_keypad_is_not_reported_as_parked(mount: str, cancelled: bool) -> None:
    async with Bridge(mount, config=CONFIG) as bridge:
        await bridge.controller.perform(op.Goto(120.0, 30.0))
        await polled(bridge, 80)
        handler = bridge.gateway.request_handler
        await handler.carry_out(requests.ParkRequest(number="n1", who="me"))
        await polled(bridge, 3)
        if cancelled:
            Owner(bridge, "nexstar").keys("cancel")
        await polled(bridge, 5 if cancelled else 120)
        answer = await handler.carry_out(requests.ProgressRequest(number="n1"))
        parked = (await bridge.controller.answer(op.GetActivity())).parked
        assert bridge.driver.parked is parked is not cancelled
        assert bool(bridge.sim.tracking) is cancelled
        assert ("degrees from its goal" in str(answer)) is cancelled
        assert ("it is parked" in str(answer)) is not cancelled
        told = [entry.note for entry in bridge.entries if "degrees from its park position" in entry.note]
        assert len(told) == cancelled


@pytest.mark.parametrize(("mount", "driven"), [("cpc", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200")])
@pytest.mark.parametrize("goto", [op.GotoAxes(320.0, 20.0), op.GotoHorizontal(320.0, 20.0)])
@pytest.mark.parametrize("cancelled", [True, False])
async def test_axis_goto_cancelled_at_the_keypad_is_reported_as_ended_short(
    mount: str, driven: str, goto: op.Operation, cancelled: bool
) -> None:
    async with Bridge(mount, driven=driven, config=CONFIG) as bridge:
        await bridge.client().ask(b":GR#")
        await bridge.controller.perform(goto)
        await polled(bridge, 3)
        if cancelled:
            Owner(bridge, driven).keys("cancel")
        await polled(bridge, 5 if cancelled else 90)
        assert ("from its goal" in bridge.controller.wanted.value.goto_failure) is cancelled


async def test_home_search_cancelled_at_the_keypad_is_not_reported_as_found() -> None:
    async with Bridge("cge", config=CONFIG) as bridge:
        await bridge.controller.perform(op.SetHome())
        await bridge.controller.perform(op.Goto(120.0, 30.0))
        await polled(bridge, 80)
        await bridge.controller.perform(op.Home())
        await polled(bridge, 3)
        Owner(bridge, "nexstar").keys("cancel")
        await polled(bridge, 5)
        assert await bridge.controller.answer(op.HomeState()) != 1
        assert truth_of(bridge.sim).altitude < 80.0
