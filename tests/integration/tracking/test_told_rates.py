"""Drive rates: one that cannot run is refused, and ``:GT#`` tells the one that runs. Tracking goes off by ``T 0``."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core.operations import TrackRate
from tests.support.in_process_gateway import Bridge

#: In alt-az, and on hand controls that have no way to the motors.
SIDEREAL_ALONE = [
    ("cpc", "4.21"),
    ("slt", "4.03"),
    ("gt", "101.0"),
    ("nexstar-gps", "1.2"),
    ("nexstar-gps", "2.2"),
    ("evolution", "5.31"),
    ("6-8se", "4.21"),
]


@pytest.mark.parametrize(("model", "version"), SIDEREAL_ALONE)
async def test_impossible_drive_rate_is_refused_and_not_reported(model: str, version: str) -> None:
    async with Bridge(model, version, surface="lx200gps") as bridge:
        client = bridge.client()
        before = len(bridge.sent_requests())
        for hertz, reply in ((b"055.5", b"0"), (b"57.9", b"0"), (b"060.0", b"0"), (b"060.1", b"1"), (b"060.2", b"1")):
            assert await client.ask(b":ST%s#" % hertz, ending=reply) == reply
            assert await client.ask(b":GT#", ending=b"#") == b"60.1#"
        client.send(b":TL#")
        assert await client.ask(b":GT#", ending=b"#") == b"60.1#"
        client.send(b":TS#:T+#:TM#:TQ#")
        assert await client.ask(b":GT#", ending=b"#") == b"60.1#"
        assert [one for one in bridge.sent_requests()[before:] if one[:1] in b"PT"] == []
        assert any("Tracking rate" in entry.note for entry in bridge.entries)


@pytest.mark.parametrize(
    ("command", "told"),
    [(b":TL#", b"58.7#"), (b":TS#", b"60.0#"), (b":TQ#", b"60.1#"), (b":ST057.9#", b"57.9#"), (b":ST060.3#", b"60.3#")],
)
async def test_reported_drive_rate_is_the_running_one_even_without_tracking(command: bytes, told: bytes) -> None:
    """The motors' lunar rate is 14.685 arcseconds a second: 60.164 hertz of 15.041 are 58.7."""
    async with Bridge("cge", "4.21") as bridge:
        client = bridge.client()
        await client.ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", ending=b"0")
        await asyncio.sleep(40.0)
        client.send(command)
        await asyncio.sleep(2.0)
        assert await client.ask(b":GT#", ending=b"#") == told
        before, began = bridge.sim.true_position()[0], bridge.clock()
        await asyncio.sleep(20.0)
        drift = (bridge.sim.true_position()[0] - before) * 3600.0 / (bridge.clock() - began)
        assert (15.041 - drift) / 15.041 * 60.164 == pytest.approx(float(told[:-1]), abs=0.08)
        client.send(b":AL#")
        assert await client.ask(b":GT#", ending=b"#") == told


async def test_drive_rate_set_over_another_protocol_is_reported() -> None:
    async with Bridge("cge", "4.21") as bridge:
        await bridge.controller.perform(TrackRate(name="lunar"))
        assert await bridge.client().ask(b":GT#", ending=b"#") == b"58.7#"


@pytest.mark.parametrize("version", ["1.6", "2.2"])
async def test_hand_control_that_hides_its_mode_can_be_told_to_stop_tracking(version: str) -> None:
    async with Bridge("nexstar-gps", version, surface="lx200gps", config={"lowest": -90.0}) as bridge:
        client = bridge.client()
        await asyncio.sleep(2.0)
        assert bridge.sim.tracking
        client.send(b":AL#")
        await asyncio.sleep(2.0)
        assert b"T\x00" in bridge.sent_requests()
        assert not bridge.sim.tracking
        assert (await client.ask(b":GW#"))[1:2] == b"N"
        client.send(b":AA#")
        await asyncio.sleep(2.0)
        assert b"T\x01" in bridge.sent_requests() and bridge.sim.tracking
        assert sum("fits the mount's type" in entry.note for entry in bridge.entries) == 1
        client.send(b":hP#")
        await asyncio.sleep(90.0)
        assert not bridge.sim.tracking and (await client.ask(b":GW#"))[1:2] == b"N"


@pytest.mark.parametrize("version", ["1.6", "2.2"])
async def test_mount_tracks_again_after_an_arrow(version: str) -> None:
    """``T 0`` goes before fast motion, as the paper has it, and afterwards tracking is put back."""
    async with Bridge("nexstar-gps", version, surface="lx200gps", config={"lowest": -90.0}) as bridge:
        client = bridge.client()
        await asyncio.sleep(2.0)
        client.send(b":RS#:Mn#")
        await asyncio.sleep(2.0)
        assert b"T\x00" in bridge.sent_requests()
        client.send(b":Qn#")
        await asyncio.sleep(5.0)
        assert bridge.sim.tracking
