"""A goto that ends elsewhere than at its goal is told of, once, and not begun again."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core.operations import Equatorial
from gateway.diagnostics.virtual_time import run
from gateway.mount.readings.reader import missed
from tests.support.in_process_gateway import Bridge
from tests.support.owner import Owner

GOTO = b":Sr08:00:00#:Sd+30*00:00#:MS#"


@pytest.mark.parametrize(("mount", "driven"), [("cpc", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200")])
@pytest.mark.parametrize("cancelled", [True, False])
def test_a_goto_that_was_cancelled_at_the_keypad_is_told_of(mount: str, driven: str, cancelled: bool) -> None:
    async def program() -> None:
        async with Bridge(mount, driven=driven, config={"lowest": -90.0, "sun": 0.0}) as bridge:
            owner, client = Owner(bridge, driven), bridge.client()
            await client.ask(b":GR#")
            client.tell(GOTO)
            await asyncio.sleep(3.0)
            if cancelled:
                owner.keys("cancel")
            for _ in range(60):
                await client.ask(b":D#")
                await asyncio.sleep(1.0)
            told = [entry.note for entry in bridge.entries if "from its goal" in entry.note]
            assert len(told) == cancelled
            assert not bridge.controller.moving

    run(program())


def test_near_is_there() -> None:
    goal = Equatorial(10.0, 20.0)
    assert missed(goal, Equatorial(10.0, 20.4)) == ""
    assert "1.0 degrees from its goal" in missed(goal, Equatorial(10.0, 21.0))
    assert "180.0 degrees" in missed(Equatorial(0.0, 90.0), Equatorial(120.0, -90.0))
