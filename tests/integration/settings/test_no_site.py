"""A hand control that tells no site (before 2.3): programs are told the one that another program, or the GPS, knows."""

from __future__ import annotations

import asyncio

import pytest

from gateway.protocols.nexstar.simulator.hand_control import HANDLERS
from tests.support.in_process_gateway import Bridge, RehearsalClient


async def site(program: RehearsalClient) -> tuple[bytes, ...]:
    return tuple([await program.ask(question, 5.0, ending=b"#") for question in (b":Gt#", b":Gg#", b":GS#")])


async def test_site_set_by_one_program_is_reported_to_all() -> None:
    async with Bridge("6-8se", "2.2") as bridge:
        phone, other = bridge.client("192.168.1.7"), bridge.client()
        assert await site(other) == (b"", b"", b"")
        assert await phone.ask(b":St+45*30#") + await phone.ask(b":Sg350*00#") == b"11"
        await asyncio.sleep(5.0)
        latitude, longitude, sidereal = await site(other)
        assert (latitude, longitude) == (b"+45*30#", b"-010*00#")
        assert sidereal.startswith(b"06:2")


async def test_site_is_reported_once_a_late_gps_finds_satellites(monkeypatch: pytest.MonkeyPatch) -> None:
    linked = {"linked": 0}
    monkeypatch.setitem(HANDLERS, "gps_linked", lambda sim, _: linked)
    async with Bridge("nexstar-gps", "1.6") as bridge:
        client = bridge.client()
        assert await site(client) == (b"", b"", b"")
        linked["linked"] = 1
        await asyncio.sleep(60.0)
        latitude, longitude, sidereal = await site(client)
        assert (latitude, longitude) == (b"+45*00#", b"-010*00#")
        assert sidereal.startswith(b"06:2")


async def test_mount_without_a_site_is_not_polled_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A program may poll; the receiver needs minutes."""
    asked: list[int] = []
    monkeypatch.setitem(HANDLERS, "gps_linked", lambda sim, _: asked.append(1) or {"linked": 0})
    async with Bridge("nexstar-gps", "1.6") as bridge:
        client = bridge.client()
        await client.ask(b":Gt#", 1.0)
        before = len(asked)
        for _ in range(20):
            await client.ask(b":Gt#", 1.0)
        assert len(asked) <= before + 1
