"""A computer that has lost its clock, before a mount that has none: nobody knows where the Sun is."""

from __future__ import annotations

import asyncio

import pytest

from tests.support.in_process_gateway import EVENING, Bridge
from tests.support.virtual import run

GOTO = b":Sr08:00:00#:Sd+30*00:00#:MS#"
SINCE_1970 = -EVENING + 1000.0


@pytest.mark.parametrize(("sun", "told", "done"), [(20.0, False, False), (20.0, True, True), (0.0, False, True)])
def test_a_goto_needs_the_time_where_the_sun_counts(sun: float, told: bool, done: bool) -> None:
    async def program() -> None:
        config = {"lowest": -90.0, "sun": sun, "site": [45.0, 10.0]}
        async with Bridge("gt", "101.0", config=config, host_ahead=SINCE_1970) as bridge:
            client = bridge.client()
            if told:
                await client.ask(b":SG+00#:SL22:00:00#:SC01/15/26#", until=b"#")
                await asyncio.sleep(3.0)
            reply = await client.ask(GOTO, until=b"0" if done else b"#")
            assert reply.endswith(b"0" if done else b"#")
            assert (b"time is unknown" in reply) is not done

    run(program())
