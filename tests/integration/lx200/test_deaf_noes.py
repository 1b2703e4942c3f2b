"""While a classic calculates its planets it hears nothing but a stop: an arrow or a pulse is told no at once.

Meade's paper: ``:SC`` answers, then updates planetary data. NexStar protocol: ``H`` sets time and date; the no-response
form is ``00 23`` for a command that asks for no byte.
"""

from __future__ import annotations

import asyncio

import pytest

from tests.support.in_process_gateway import Bridge

NO = b"\0#"
SET_TIME = b"H\x15\x1e\x28\x03\x0e\x1b\x0a\x00"


@pytest.mark.parametrize("after", [0.05, 0.3, 0.8, 2.0])
@pytest.mark.parametrize(
    "motion", [b"P\x02\x10\x24\x05\0\0\0", b"P\x03\x11\x26\x64\x64\0\0", b"P\x03\x10\x06\x02\x58\0\0"]
)
async def test_arrow_that_a_busy_meade_ignores_gets_the_no_response_form(after: float, motion: bytes) -> None:
    async with Bridge(
        "lx200",
        driven="lx200",
        presented="nexstar",
        surface="cpc",
        aligned=True,
        config={"lowest": -90.0, "sun": 0.0, "site_time": "always"},
    ) as bridge:
        client = bridge.client()
        assert await client.ask(b"e", 5.0)
        assert await client.ask(SET_TIME) == b"#"
        await asyncio.sleep(after)
        before = len(bridge.sent_requests())
        answer = await client.ask(motion, 4.0)
        stop = await client.ask(bytes((80, 2, 0x21 - motion[2], 0x24, 0, 0, 0, 0)), 1.0)
        assert stop == b"#"
        await asyncio.sleep(20.0)
        begun = [sent for sent in bridge.sent_requests()[before:] if sent[:2] == b":M"]
        assert any(sent.startswith(b":SC") for sent in bridge.sent_requests())
        assert answer == (b"#" if begun else NO)
