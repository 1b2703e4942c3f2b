"""Periodic error correction: the toggle counts with the two commands that say which way, and keeps its colon."""

from __future__ import annotations

import asyncio

import pytest

from tests.support.in_process_gateway import Bridge


def _said(bridge: Bridge, *letters: bytes) -> list[bytes]:
    return [data for data in bridge.sent_requests() if any(letter in data for letter in letters)]


@pytest.mark.parametrize("model", ["lx200", "lx200-16"])
async def test_pec_toggle_without_a_colon_reaches_a_classic_with_one(model: str) -> None:
    async with Bridge(model, driven="lx200", surface=model) as bridge:
        bridge.client().send(b"$Q#")
        await asyncio.sleep(1.0)
        assert _said(bridge, b"$Q") == [b":$Q#"]
        assert bridge.sim.accessories["pec 1"] is True


async def test_second_pec_toggle_switches_the_other_way() -> None:
    """``P 2 16 13 on``, as the motors of a CGE have it."""
    async with Bridge("cge", surface="lx200gps") as bridge:
        client = bridge.client()
        for command in (b":$QZ+#", b"$Q#", b"$Q#", b":$QZ-#", b":$Q#"):
            client.send(command)
            await asyncio.sleep(1.0)
        switched = [data[4] for data in bridge.sent_requests() if data[:4] == b"P\x02\x10\x0d"]
        assert switched == [1, 0, 1, 0, 1]


@pytest.mark.parametrize("command", [b":$QA+#", b":$QA-#"])
async def test_log_says_that_a_nexstar_declination_motor_has_no_pec(command: bytes) -> None:
    async with Bridge("cge", surface="lx200gps") as bridge:
        client = bridge.client()
        client.send(command)
        await asyncio.sleep(1.0)
        assert not [data for data in bridge.sent_requests() if data[3:4] == b"\x0d"]
        assert any("right-ascension" in entry.note for entry in bridge.entries)
        client.send(b"$Q#")
        await asyncio.sleep(1.0)
        assert bridge.sent_requests()[-1][:5] == b"P\x02\x10\x0d\x01", "and the toggle does not count it"


@pytest.mark.parametrize("command", [b":$QA+#", b":$QA-#", b":$QZ+#", b":$QZ-#"])
async def test_lx200gps_gets_the_pec_command_unchanged(command: bytes) -> None:
    async with Bridge("lx200gps", driven="lx200", surface="lx200gps") as bridge:
        bridge.client().send(command)
        await asyncio.sleep(1.0)
        assert _said(bridge, b"$Q") == [command]


async def test_pec_of_one_axis_is_refused_on_a_classic_that_toggles_both() -> None:
    async with Bridge("lx200", driven="lx200", surface="lx200gps") as bridge:
        bridge.client().send(b":$QA+#")
        await asyncio.sleep(1.0)
        assert _said(bridge, b"$Q") == []
