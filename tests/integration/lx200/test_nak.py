"""An LX200GPS that says NAK (0x15: busy) is asked again a few times; no program ever hears a NAK."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge

NAK = b"\x15"


def gps(presented: str) -> Bridge:
    surface = "lx200gps" if presented == "lx200" else "cpc"
    return Bridge(
        "lx200gps", driven="lx200", presented=presented, surface=surface, config={"lowest": -90.0, "sun": 0.0}
    )


@pytest.mark.parametrize(
    ("presented", "said", "heard"),
    [
        ("lx200", b":Sr08:00:00#:Sd+30*00:00#:MS#", b"110"),
        ("lx200", b":Gt#", b"+45*00#"),
        ("nexstar", b"T\x02", b"#"),
        ("nexstar", b"r55555500,15555500", b"#"),
    ],
)
async def test_lx200gps_is_asked_again_after_a_nak(presented: str, said: bytes, heard: bytes) -> None:
    async with gps(presented) as bridge:
        client = bridge.client()
        bridge.sim.busy_until = bridge.clock() + 1.5
        assert await client.ask(said, 3.5, ending=heard[-1:]) == heard
        await asyncio.sleep(4.0)
        if said[-3:-1] == b"MS" or said[:1] == b"r":
            assert bridge.sim.slewing


@pytest.mark.parametrize(
    ("presented", "said"),
    [("lx200", b":Sr08:00:00#:Sd+30*00:00#:MS#:GR#:GD#:GZ#"), ("nexstar", b"eztr55555500,15555500")],
)
async def test_repeated_nak_ends_the_retries_and_reaches_no_program(presented: str, said: bytes) -> None:
    async with gps(presented) as bridge:
        client = bridge.client()
        bridge.sim.busy_until = bridge.clock() + 30.0
        client.send(said)
        await asyncio.sleep(20.0)
        assert NAK not in client.received
        assert len([one for one in bridge.sent_requests() if one[:3] in (b":MS", b":Sr")]) < 10
        await asyncio.sleep(20.0)
        assert not bridge.sim.slewing


@pytest.mark.parametrize("times", [1, 3, 5])
def test_goto_accepted_after_a_nak_is_reported_as_slewing(times: int) -> None:
    """Programs look meanwhile whether it slews, and the bars of a mount that was not told yet are empty."""

    async def program() -> None:
        async with gps("lx200") as bridge:
            client, left, feed = bridge.client(), times, bridge.controller.line.wire.feed  # type: ignore[attr-defined]

            def busy_for_gotos_alone(data: bytes) -> bytes:
                nonlocal left
                if data != b":MS#" or not left:
                    return bytes(feed(data))
                left -= 1
                return NAK

            bridge.controller.line.wire.feed = busy_for_gotos_alone  # type: ignore[attr-defined]
            client.send(b":Sr08:00:00#:Sd+30*00:00#:MS#")
            while not bridge.sim.slewing:
                await bridge.controller.read(op.Slewing())
                await asyncio.sleep(0.1)
            await asyncio.sleep(2.0)
            assert bridge.sim.slewing
            assert bridge.controller.slewing
            assert bridge.controller.reconciler.busy  # else neither the marker on disk nor the watchdog knows of it
            assert not any("a person at its keys ended it" in entry.note for entry in bridge.entries)

    run(program())
