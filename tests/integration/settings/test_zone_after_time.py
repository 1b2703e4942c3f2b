"""Local time, date and zone with pauses between them: in the end the hand control shows what the manual says."""

from __future__ import annotations

import asyncio
import itertools
from datetime import UTC, datetime

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge
from tests.support.typed_programs import unix_of

#: 9 o'clock in the evening of 14 March, five hours west of Greenwich: 15 March, 02:00 UTC.
PIECES = {"SL": b":SL21:00:00#", "SC": b":SC03/14/27#", "SG": b":SG+05#"}
TRUE = datetime(2027, 3, 15, 2, 0, tzinfo=UTC).timestamp()


def shown(bridge: Bridge) -> float:
    """UTC as the hand control shows it."""
    return unix_of(bridge.sim.feed(b"h"))


@pytest.mark.parametrize("surface", ["autostar", "lx200", "lx200-16", "lx200gps"])
@pytest.mark.parametrize("pause", [0.0, 1.0, 2.3, 4.0, 25.0])
@pytest.mark.parametrize("before", [0, -6])
def test_time_date_and_zone_set_in_any_order_reach_the_hand_control(surface: str, pause: float, before: int) -> None:
    async def program(order: tuple[str, ...]) -> None:
        start = TRUE - 40.0
        async with Bridge("6-8se", "4.21", surface=surface, aligned=False, start=start) as bridge:
            bridge.sim.feed(b"H" + bytes((12, 0, 0, 3, 14, 27, before % 256, 0)))
            client = bridge.client()
            await asyncio.sleep(130)
            set_at = None
            for name in order:
                set_at = bridge.clock() if name == "SL" else set_at
                assert (await client.ask(PIECES[name]))[:1] == b"1"
                await asyncio.sleep(pause)
            await asyncio.sleep(6)
            assert set_at is not None
            wanted = TRUE + bridge.clock() - set_at
            assert shown(bridge) == pytest.approx(wanted, abs=2.0), order
            assert bridge.sim.feed(b"h")[6] == 256 - 5
            told = [(await client.ask(question, ending=b"#")).decode() for question in (b":GC#", b":GL#", b":GG#")]
            assert told[0] == "03/14/27#"
            assert told[2] == "+05#"
            told_at = datetime.strptime(told[1], "%H:%M:%S#")
            assert told_at.hour == 21

    for order in itertools.permutations(PIECES):
        run(program(order))
