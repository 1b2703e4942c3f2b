"""A program for hand controls at a whole gateway, a simulated hand control behind it, on virtual time."""

from __future__ import annotations

import asyncio

import pytest

from gateway.astro.spherical import separation
from tests.support.in_process_gateway import Bridge
from tests.support.nexstar_flows import ARCSECOND, HALT, NORTH, off, on_a_bridge, place, polled, precise, settled, up

# --- gotos ------------------------------------------------------------------------------------------------------------

FORKS = [("6-8se", "6-8se"), ("cge", "cge"), ("cpc", "6-8se"), ("nexstar-gps", "nexstar-gps")]


@pytest.mark.parametrize(("mount", "surface"), FORKS)
@pytest.mark.parametrize("site", [(45.0, 10.0), (-34.0, 18.5)])
def test_nexstar_goto_arrives(mount: str, surface: str, site: tuple[float, float]) -> None:
    @on_a_bridge(mount=mount, surface=surface, site=site)
    async def goto(bridge: Bridge) -> None:
        client = bridge.client()
        await polled(client)
        for letter, east in ((b"r", 20.0), (b"R", -25.0)):
            ra, dec = up(bridge, east)
            began = asyncio.get_running_loop().time()
            frame = (
                precise(letter, ra, dec)
                if letter == b"r"
                else b"R%04X,%04X" % (round(ra / 360 * 65536) % 65536, round(dec / 360 * 65536) % 65536)
            )
            assert await client.ask(frame) == b"#"
            assert asyncio.get_running_loop().time() - began < 0.02, "acknowledged at once"
            assert await client.ask(b"L") == b"1#"
            await settled(client)
            assert off(bridge, ra, dec) < (ARCSECOND if letter == b"r" else 20 * ARCSECOND)
            seen = place(await client.ask(b"e"))
            assert separation(*seen, *bridge.sim.true_position()) < ARCSECOND
            assert bridge.sim.tracking

    goto()


@on_a_bridge(latency=0.3)
async def test_nexstar_reports_a_goto_in_progress_from_its_acknowledgement_on(bridge: Bridge) -> None:
    """However late the hand control hears of the goto, and however late it begins."""
    client = bridge.client()
    await polled(client)
    ra, dec = up(bridge)
    assert await client.ask(precise(b"r", ra, dec)) == b"#"
    heard = []
    while off(bridge, ra, dec) > 0.1:
        heard.append(await client.ask(b"L"))
        await asyncio.sleep(0.1)
    assert len(heard) > 10
    assert set(heard) == {b"1#"}
    await settled(client)
    assert off(bridge, ra, dec) < ARCSECOND


@on_a_bridge()
async def test_nexstar_goto_query_sent_with_the_goto_says_in_progress(bridge: Bridge) -> None:
    client = bridge.client()
    await polled(client)
    assert await client.ask(precise(b"r", *up(bridge)) + b"L", ending=b"1#") == b"#1#"


@on_a_bridge()
async def test_first_nexstar_query_after_a_goto_says_in_progress(bridge: Bridge) -> None:
    """A program that has asked nothing before."""
    client = bridge.client()
    assert await client.ask(precise(b"r", *up(bridge))) == b"#"
    assert await client.ask(b"L") == b"1#"


@on_a_bridge(aligned=False)
async def test_nexstar_goto_without_alignment_is_acknowledged_but_not_begun(bridge: Bridge) -> None:
    client = bridge.client()
    assert await client.ask(b"J") == b"\0#"
    assert await client.ask(precise(b"r", *up(bridge))) == b"#"
    await settled(client, 5)
    assert not bridge.sim.slewing
    assert any("not aligned" in entry.note for entry in bridge.entries)


# --- motion by hand ---------------------------------------------------------------------------------------------------


@on_a_bridge()
async def test_nexstar_cancel_leaves_motion_by_hand_alone(bridge: Bridge) -> None:
    client = bridge.client()
    await polled(client)
    await client.ask(bytes((80, 2, 16, 36, 7, 0, 0, 0)))
    await asyncio.sleep(1)
    await client.ask(b"M")
    before = bridge.sim.true_position()
    await asyncio.sleep(2)
    assert off(bridge, *before) > 0.5
    await client.ask(HALT[1])
    await asyncio.sleep(3)
    before = bridge.sim.true_position()
    await asyncio.sleep(10)
    assert off(bridge, *before) < ARCSECOND


@on_a_bridge()
async def test_nexstar_halt_stops_only_its_axis(bridge: Bridge) -> None:
    client = bridge.client()
    await polled(client)
    await client.ask(NORTH[:4] + b"\x06\0\0\0")
    await client.ask(bytes((80, 2, 16, 36, 6, 0, 0, 0)))
    await asyncio.sleep(1)
    await client.ask(HALT[2])
    await asyncio.sleep(0.5)
    before = bridge.sim.encoders()
    await asyncio.sleep(2)
    after = bridge.sim.true_position() and bridge.sim.encoders()
    assert after[0] - before[0] > 0.1
    assert after[1] == pytest.approx(before[1], abs=0.001)
    await client.ask(HALT[1])


# --- tracking, sync, clock --------------------------------------------------------------------------------------------


@on_a_bridge(mount="cge", surface="cge")
async def test_nexstar_tracking_rates_reach_the_motor_unchanged(bridge: Bridge) -> None:
    client = bridge.client()
    await polled(client)
    for code in (b"\xff\xfe", b"\xff\xfd"):
        frame = b"P\3\x10\6" + code + b"\0\0"
        assert await client.ask(frame) == b"#"
        await asyncio.sleep(1)
        assert frame in bridge.sent_requests()
        assert await client.ask(b"L") == b"0#"
        before = bridge.sim.true_position()
        await asyncio.sleep(10)
        assert off(bridge, *before) < 20 * ARCSECOND, "nothing runs away"


@on_a_bridge()
async def test_site_and_time_on_an_aligned_mount_read_back_as_set(bridge: Bridge) -> None:
    client = bridge.client()
    await polled(client)
    assert await client.ask(b"W\x21\x32\x29\0\x76\x14\x11\1") == b"#"
    assert await client.ask(b"H\x0f\x1a\0\4\6\x1a\xfb\1") == b"#"
    assert await client.ask(b"w") == b"\x21\x32\x29\0\x76\x14\x11\1#"
    assert await client.ask(b"h") == b"\x0f\x1a\0\4\6\x1a\xfb\1#"
    await asyncio.sleep(60)
    assert await client.ask(b"h") == b"\x0f\x1b\0\4\6\x1a\xfb\1#"
    assert await client.ask(b"J") == b"\1#"


@on_a_bridge(aligned=False)
async def test_site_and_time_are_sent_to_an_unaligned_mount(bridge: Bridge) -> None:
    client = bridge.client()
    assert await client.ask(b"W\x21\x32\x29\0\x76\x14\x11\1") == b"#"
    assert await client.ask(b"H\x0f\x1a\0\4\6\x1a\xfb\1") == b"#"
    await asyncio.sleep(3)
    assert b"W\x21\x32\x29\0\x76\x14\x11\1" in bridge.sent_requests()
    assert await client.ask(b"w") == b"\x21\x32\x29\0\x76\x14\x11\1#"
    reply = await client.ask(b"h")
    assert reply[:2] + reply[3:] == b"\x0f\x1a\4\6\x1a\xfb\1#"
    assert reply[2] in (2, 3), "the mount's clock shows whole seconds"
