"""The limit of the hour angle: against the pier on a German mount, to both sides on a fork.

2026-01-15 22:00 UTC at 10 E: the sidereal time is 6h 21m.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge

EAST = b":Sr06:24:00#:Sd+10*00:00#:MS#"  # three minutes before the meridian
FAR_EAST = b":Sr12:00:00#:Sd+60*00:00#:MS#"  # 5h 39m before it
WEST = b":Sr02:00:00#:Sd+60*00:00#:MS#"  # 4h 21m past it
NO = b"112Beyond the hour angle limit.#"


async def settle(client: Any) -> None:
    while await client.ask(b":D#") not in (b"#", b"       #"):
        await asyncio.sleep(1)


def notes(bridge: Any) -> list[str]:
    return [entry.note for entry in bridge.entries if entry.arrow == "!"]


@pytest.mark.parametrize(("version", "owner"), [(None, 0.2), (None, None), ("3.01", 0.2), ("4.10", 0.2)])
@pytest.mark.safety_line(5)
async def test_german_mount_tracks_as_far_past_the_meridian_as_allowed(
    version: str | None, owner: float | None
) -> None:
    """Before 4.15 it tells by its declination axis on which side of the pier its tube is. Without a limit of the
    owner's a page sets one while the mount tracks."""
    async with Bridge("cge", version, config={"hour_angle_limit": owner}) as bridge:
        client = bridge.client()
        assert await client.ask(EAST, ending=b"110") == b"110"
        await settle(client)
        if owner is None:
            bridge.controller.narrow_limits(hour_angle=3.0)
        assert version is not None or bridge.sim.feed(b"p") == b"W#"
        await asyncio.sleep(720)  # 9 minutes past it
        assert bridge.sim.tracking
        await asyncio.sleep(360)
        assert not bridge.sim.tracking
        past = [note for note in notes(bridge) if "hour angle limit (" in note]  # and no word of a drift
        assert len(past) == 1 and "0.20 hours past the meridian" in past[0]
        for there in (WEST, FAR_EAST):  # it changes sides: no goto ends against the pier
            assert await client.ask(there, ending=b"110") == b"110"
            await settle(client)
        assert bridge.sim.tracking


@pytest.mark.safety_line(5)
async def test_hour_angle_is_unlimited_without_the_setting() -> None:
    async with Bridge("cge") as bridge:
        client = bridge.client()
        assert await client.ask(EAST, ending=b"110") == b"110"
        await settle(client)
        await asyncio.sleep(2400)
        assert bridge.sim.tracking


async def test_fork_on_a_wedge_keeps_the_hour_angle_limit_on_both_sides() -> None:
    async with Bridge("6-8se", config={"hour_angle_limit": 4.5}) as bridge:
        client = bridge.client()
        bridge.sim.feed(b"T\x02")  # on a wedge, says its hand control
        await asyncio.sleep(10)
        assert await client.ask(b"\x06") == b"P"
        assert await client.ask(FAR_EAST, ending=NO) == NO
        assert await client.ask(WEST, ending=b"110") == b"110"
        await settle(client)
        await asyncio.sleep(900)
        assert not bridge.sim.tracking
        assert any("off at the hour angle limit" in note for note in notes(bridge))


@pytest.mark.parametrize("latitude", [45.0, -35.0])
@pytest.mark.parametrize("version", ["4.10", "5.24", "5.31"])
async def test_empty_pier_side_reply_means_neither_side(version: str, latitude: float) -> None:
    """In the south some versions swap the letters: no letter is neither."""
    async with Bridge("cge" if version == "4.10" else "cgem", version, site=(latitude, 10.0)) as bridge:
        assert bridge.driver.tube_side("") is None
        assert {bridge.driver.tube_side("E"), bridge.driver.tube_side("W")} == {"E", "W"}


@pytest.mark.parametrize(("mount", "site"), [("cge", (45.0, 10.0)), ("cgx", (-35.0, 10.0))])
@pytest.mark.parametrize(
    "asked", [b"b%08X,%08X" % (340 * 2**32 // 360, 40 * 2**32 // 360), b"BEAAB,238E", b"P\x04\x10\x02\xea\xaa\xab\x00"]
)
async def test_axis_gotos_keep_the_hour_angle_limit(mount: str, site: tuple[float, float], asked: bytes) -> None:
    """340 and 330 degrees of the first axis: the counterweight shaft 20 and 30 degrees above level. AUX 0x02, too."""
    config = {"hour_angle_limit": 0.5, "lowest": -90.0, "sun": 0.0}
    async with Bridge(mount, site=site, presented="nexstar", surface=mount, config=config) as bridge:
        client = bridge.client()
        await client.ask(asked, 3.0)
        worst = -180.0
        rested = 0
        for _ in range(120):
            await asyncio.sleep(0.5)
            client.send(b"e")
            seen = truth_of(bridge.sim)
            worst, rested = max(worst, seen.past_meridian), 0 if seen.moving else rested + 1
            if rested == 8:
                break
        assert worst < 7.5 + 0.5, worst
