"""AUX 0x26 (guide pulse) that cannot be done: the no-response form, and 0x27 then tells of no pulse.

NexStar AUX: ``P 03 dev 26 rate ticks 00 00``; the no-response form is ``00 23`` where no byte is asked for.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from tests.support.in_process_gateway import Bridge, RehearsalClient

NO = b"\0#"
PULSE_AZM, ACTIVE_AZM = b"P\x03\x10\x26\x32\x32\0\0", b"P\x01\x10\x27\0\0\0\x01"
PULSE_ALT, ACTIVE_ALT = b"P\x03\x11\x26\xce\x32\0\0", b"P\x01\x11\x27\0\0\0\x01"


@pytest.mark.parametrize(("surface", "none"), [(None, b"\0\0#"), ("avx", b"\0#")])
async def test_alt_az_fork_without_motor_pulses_refuses_guide_pulses(surface: str | None, none: bytes) -> None:
    """Where nothing is named, the motors themselves say that they do not know 0x27 either."""
    async with Bridge("cpc", "4.21", presented="nexstar", surface=surface) as bridge:
        client = bridge.client()
        before = len(bridge.sent_requests())
        for pulse, active in ((PULSE_AZM, ACTIVE_AZM), (PULSE_ALT, ACTIVE_ALT)):
            assert await client.ask(pulse) == NO
            assert await client.ask(active) == none
        assert not [
            sent for sent in bridge.sent_requests()[before:] if sent[:1] == b"P" and sent[3:4] in b"\x06\x07\x26"
        ]


async def test_fork_on_a_wedge_carries_out_and_acknowledges_guide_pulses() -> None:
    async with Bridge("cpc", "4.21", presented="nexstar", surface="cpc") as bridge:
        client = bridge.client()
        assert await client.ask(b"T\x02") == b"#"
        await asyncio.sleep(1.0)
        assert await client.ask(PULSE_AZM) == b"#"
        assert await client.ask(ACTIVE_AZM) == b"\x01#"


async def test_guide_pulse_is_accepted_if_the_pending_tracking_mode_allows_it() -> None:
    """The program has asked for tracking as on a wedge, and pulses at once: nobody is told no for what will be."""
    async with Bridge("cpc", "4.21", presented="nexstar", surface="cpc", latency=0.3) as bridge:
        client = bridge.client()
        assert await client.ask(b"T\x02" + PULSE_AZM) == b"##"


@asynccontextmanager
async def _set_out(mount: str, driven: str) -> AsyncIterator[tuple[Bridge, RehearsalClient]]:
    """Two seconds of a goto by the precise command, 40 degrees away in right ascension."""
    config = {"lowest": -90.0, "sun": 0.0}
    async with Bridge(mount, driven=driven, presented="nexstar", surface="avx", config=config) as bridge:
        client, (ra, dec) = bridge.client(), bridge.sim.true_position()
        words = [round((angle % 360.0) / 360.0 * 2**32) for angle in (ra + 40.0, dec - 10.0)]
        assert await client.ask(f"r{words[0]:08X},{words[1]:08X}".encode()) == b"#"
        await asyncio.sleep(2.0)
        yield bridge, client


@pytest.mark.parametrize(("driven", "mount"), [("nexstar", "avx"), ("lx200", "lx200gps"), ("lx200", "lx200")])
async def test_guide_pulse_is_refused_during_a_goto_and_done_after_a_stop(driven: str, mount: str) -> None:
    async with _set_out(mount, driven) as (_, client):
        assert await client.ask(b"L") == b"1#"
        assert await client.ask(PULSE_AZM) == NO
        assert await client.ask(ACTIVE_AZM) == b"\0#"
        assert await client.ask(b"M") == b"#"
        await asyncio.sleep(4.0)
        assert await client.ask(b"L") == b"0#"
        assert await client.ask(PULSE_AZM) == b"#"
        await asyncio.sleep(2.0)


@pytest.mark.parametrize(("driven", "mount"), [("nexstar", "avx"), ("lx200", "lx200gps")])
async def test_guide_pulse_right_after_the_end_of_a_goto_is_done(driven: str, mount: str) -> None:
    async with _set_out(mount, driven) as (bridge, client):
        before = len(bridge.sent_requests())
        assert await client.ask(b"M" + PULSE_AZM) == b"##"
        await asyncio.sleep(3.0)
        pulses = [sent for sent in bridge.sent_requests()[before:] if sent.startswith((b":Mg", b"P\x03\x10\x26"))]
        assert len(pulses) == 1
