"""Site 1 is the mount's own: another one that a program selects never costs it, and it comes back with ``:W1#``."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.core import requests
from tests.support.fake_mount import Talk
from tests.support.in_process_gateway import Bridge, RehearsalClient

#: ``W``: degrees, minutes, seconds, 0 north and east, 1 south and west.
OWN, FORTY = b"W" + bytes((45, 0, 0, 0, 10, 0, 0, 0)), b"W" + bytes((40, 0, 0, 0, 20, 0, 0, 1))


def told(bridge: Bridge) -> list[bytes]:
    """The sites that the mount was told."""
    return [sent for sent in bridge.sent_requests() if sent[:1] == b"W"]


async def place(client: RehearsalClient) -> bytes:
    """The site in force, as this client is told it."""
    return await client.ask(b":Gt#", ending=b"#") + await client.ask(b":Gg#", ending=b"#")


async def second_site(client: RehearsalClient) -> None:
    """Select site 2 of an LX200GPS, and set it: 40 N, 20 W."""
    client.send(b":W2#")
    assert await client.ask(b":St+40*00#:Sg020*00#", ending=b"11") == b"11"
    await asyncio.sleep(3)
    assert await place(client) == b"+40*00#+020*00#"


@pytest.mark.parametrize("again", [b":W0#", b":W1#"])
@pytest.mark.parametrize("aligned", [True, False])
async def test_selecting_site_1_restores_the_mounts_site(aligned: bool, again: bytes) -> None:
    """An aligned hand control was never told the other one; an unaligned one is told its own again."""
    async with Bridge("cpc", "4.21", surface="lx200gps", aligned=aligned) as bridge:
        client = bridge.client()
        await second_site(client)
        assert told(bridge) == ([] if aligned else [FORTY])
        client.send(again)
        await asyncio.sleep(3)
        assert await place(client) == await place(bridge.client()) == b"+45*00#-010*00#"
        assert told(bridge) == ([] if aligned else [FORTY, OWN])
        client.send(b":W2#")
        await asyncio.sleep(3)
        assert await place(client) == b"+40*00#+020*00#"
        assert told(bridge) == ([] if aligned else [FORTY, OWN, FORTY])


async def test_latitude_set_for_site_2_does_not_change_site_1() -> None:
    async with Bridge("cpc", "4.21", surface="autostar", aligned=False) as bridge:
        client = bridge.client()
        client.send(b":W1#:St+40*00#")
        await asyncio.sleep(3)
        assert await place(client) == b"+40*00#-010*00#"
        client.send(b":W0#")
        await asyncio.sleep(3)
        assert await place(client) == b"+45*00#-010*00#"
        assert told(bridge)[-1] == OWN


async def test_site_entered_at_the_keys_applies_within_minutes_without_polls() -> None:
    """It was asked for at the start, and then only while a program asked for the position."""
    async with Bridge("cpc", "4.21", surface="lx200gps") as bridge:
        bridge.sim.feed(FORTY)
        await asyncio.sleep(240)
        assert await place(bridge.client()) == b"+40*00#+020*00#"


async def test_site_entered_at_the_hand_control_becomes_site_1() -> None:
    """Neither what it had before nor what a program set comes back."""
    async with Bridge("cpc", "4.21", surface="lx200gps", aligned=False) as bridge:
        client = bridge.client()
        await second_site(client)
        bridge.sim.feed(b"W" + bytes((51, 30, 0, 0, 7, 0, 0, 0)))
        await asyncio.sleep(200)
        client.send(b":W1#")
        await asyncio.sleep(3)
        assert await place(client) == b"+51*30#-007*00#"
        assert told(bridge) == [FORTY]


async def test_site_1_is_still_the_mounts_site_after_a_restart(tmp_path: Path) -> None:
    async with Bridge("cpc", "4.21", surface="lx200gps", aligned=False, state=tmp_path) as bridge:
        await second_site(bridge.client())
    async with Bridge("cpc", "4.21", surface="lx200gps", state=tmp_path, on=bridge) as bridge:
        client = bridge.client()
        client.send(b":W1#")
        await asyncio.sleep(3)
        assert await place(client) == b"+45*00#-010*00#"
        assert told(bridge) == [OWN]
    bridge.sim.feed(b"W" + bytes((51, 30, 0, 0, 7, 0, 0, 0)))
    async with Bridge("cpc", "4.21", surface="lx200gps", state=tmp_path, on=bridge) as bridge:
        client = bridge.client()
        client.send(b":W1#")
        await asyncio.sleep(3)
        assert await place(client) == b"+51*30#-007*00#"
        assert told(bridge) == []


async def test_mount_keeps_its_site_when_another_is_selected_and_deselected_in_one_packet() -> None:
    async with Bridge("cpc", "4.21", surface="lx200gps", aligned=False) as bridge:
        client = bridge.client()
        await second_site(client)
        client.send(b":W1#:W2#:W1#")
        await asyncio.sleep(5)
        assert await place(client) == b"+45*00#-010*00#"
        assert told(bridge)[-1] == OWN


@pytest.mark.parametrize("config", [{}, {"site": (52.0, 13.0)}])
async def test_site_1_of_a_mount_without_a_site_is_the_set_or_configured_one(config: dict[str, object]) -> None:
    """What a program set as site 1, else the configured one, is what stands there again."""
    async with Bridge("nexstar-gps", "1.2", surface="lx200", config=config) as bridge:
        client = bridge.client()
        if not config:
            assert await client.ask(b":St+52*00#:Sg347*00#", ending=b"11") == b"11"
        await second_site(client)
        client.send(b":W1#")
        await asyncio.sleep(3)
        assert await place(client) == b"+52*00#-013*00#"


@pytest.mark.parametrize(
    ("half", "question", "reply"), [(b":St-45*00#", b":Gt#", b"-45*00#"), (b":Sg010*30#", b":Gg#", b"+010*30#")]
)
async def test_acknowledged_half_of_a_site_is_reported_back(half: bytes, question: bytes, reply: bytes) -> None:
    """Where nobody knows the other half there is no site, and still no silence about what was said yes to."""
    async with Bridge("nexstar-gps", "1.2", surface="lx200") as bridge:
        client = bridge.client()
        assert await client.ask(half) == b"1"
        await asyncio.sleep(3)
        assert await client.ask(question, 1.0) == reply
        assert await client.ask({b":Gt#": b":Gg#", b":Gg#": b":Gt#"}[question], 1.0) == b""


# --- how they are counted -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "from_one"), [("autostar", False), ("lx200-16", False), ("lx200", True), ("lx200gps", True)]
)
def test_site_numbers_0_to_4_are_accepted_on_every_model(model: str, from_one: bool) -> None:
    """From 0 by the manual, from 1 by handbooks and programs: the one that is left over is the nearest."""
    talk = Talk(model=model)
    for number in b"30412":
        talk.send(b":W%c#" % number)
        talk.send(b":St+4%c*30#:Sg01%c*15#" % (number, number))
    sites = talk.session.shared.sites
    assert sorted(sites) == [0, 1, 2, 3]
    assert [round(sites[index].latitude or 0.0, 1) for index in range(4)] == (
        [41.5, 42.5, 43.5, 44.5] if from_one else [40.5, 41.5, 42.5, 44.5]
    )


@pytest.mark.parametrize("impossible", [b":W5#", b":W9#", b":W#", b":Wx#"])
def test_invalid_site_number_selects_no_site(impossible: bytes) -> None:
    talk = Talk(model="lx200gps")
    talk.send(b":W2#" + impossible + b":St+40*00#")
    assert talk.session.shared.sites[1].latitude == 40.0
    assert len(talk.mount.of(op.SetSite)) == 1


# --- over a Meade ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ["autostar", "lx200", "lx200-16", "lx200gps"])
async def test_selecting_site_1_restores_the_site_of_a_meade(model: str) -> None:
    """It takes a site at any time, so it was told the other one."""
    async with Bridge(model, driven="lx200", surface="lx200gps", latency=0.01) as bridge:
        client = bridge.client()
        own = await place(client)
        await second_site(client)
        assert any(sent.startswith(b":St+40*00") for sent in bridge.sent_requests())
        client.send(b":W1#")
        await asyncio.sleep(10)
        assert await place(client) == own == b"+45*00#-010*00#"
        assert [sent for sent in bridge.sent_requests() if sent.startswith(b":St")][-1] == b":St+45*00#"


@pytest.mark.parametrize(
    ("mount", "config", "aligned", "holds"),
    [
        ("cpc", {}, True, "nobody: this mount is aligned"),
        ("cpc", {}, False, "everyone: this mount takes it"),
        ("cpc", {"site_time": "never"}, False, "nobody: this mount takes no site"),
        ("cpc", {"site_time": "always"}, True, "everyone: this mount takes it"),
        ("nexstar-gps/1.2", {}, True, "everyone, as long as neither the mount"),
    ],
)
async def test_page_says_to_which_programs_its_site_applies(
    mount: str, config: dict[str, Any], aligned: bool, holds: str
) -> None:
    """And every other program reads the site then, or not."""
    model, _, version = mount.partition("/")
    async with Bridge(model, version or "4.21", config=config, aligned=aligned) as bridge:
        other = bridge.client()
        await other.ask(b":GR#", ending=b"#")
        request = requests.SetSiteRequest(40.0, 20.0, number="1", who="the console at 10.0.0.5")
        answer = await bridge.gateway.carry_out(request)
        assert answer.is_ok and answer.text.startswith(f"the site is set; it holds for {holds}")
        await asyncio.sleep(5)
        assert (await place(other) == b"+40*00#-020*00#") == holds.startswith("everyone")
