"""What a hand control keeps over power-off, through the surface, with the gateway begun anew between."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from gateway.core.operations import Place
from gateway.protocols.base.session import NamedSite
from gateway.protocols.wireformat.command_set import load
from tests.support.in_process_gateway import Bridge, RehearsalClient

MODELS = sorted(load("lx200").presented_models)
#: For every model: what ``:W`` calls the four sites, and the longest name it takes, by Meade's manual.
SITES = {"lx200": (b"1234", 3), "lx200-16": (b"0123", 3), "autostar": (b"0123", 15), "lx200gps": (b"1234", 15)}
PLACES = [(b"+45*30", b"+122*25"), (b"-33*52", b"-151*12"), (b"+51*28", b"+000*00"), (b"-89*59", b"+179*59")]


@pytest.mark.parametrize("model", MODELS)
async def test_four_named_sites_survive_a_restart(tmp_path: Path, model: str) -> None:
    numbers, longest = SITES[model]
    names = [(b"%c site of a telescope" % letter)[:longest] for letter in b"ABCD"]
    async with Bridge(state=tmp_path, surface=model, aligned=False) as bridge:
        client = bridge.client()
        for number, letter, name, (latitude, longitude) in zip(numbers, b"MNOP", names, PLACES, strict=True):
            client.send(b":W%c#" % number)
            assert await client.ask(b":St%s#:Sg%s#" % (latitude, longitude), ending=b"11") == b"11"
            assert await client.ask(b":S%c%s#" % (letter, name)) == b"1"
            assert (await client.ask(b":S%c%s#" % (letter, b"x" * (longest + 1)))) == b"0"
    async with Bridge(state=tmp_path, surface=model, aligned=False, on=bridge) as bridge:
        client = bridge.client()
        for number, letter, name, (latitude, longitude) in zip(numbers, b"MNOP", names, PLACES, strict=True):
            assert await client.ask(b":G%c#" % letter, ending=b"#") == name.strip() + b"#"
            client.send(b":W%c#" % number)
            await asyncio.sleep(3)
            assert (await client.ask(b":Gt#")).startswith(latitude)
            assert (await client.ask(b":Gg#")).startswith(longitude)
        assert bridge.warned == []


async def test_site_name_too_long_for_a_model_is_truncated(tmp_path: Path) -> None:
    async with Bridge(state=tmp_path, surface="autostar") as bridge:
        assert await bridge.client().ask(b":SMGornergrat#") == b"1"
    async with Bridge(state=tmp_path, surface="lx200") as bridge:
        assert await bridge.client().ask(b":GM#") == b"Gor#"


@pytest.mark.parametrize("name", [b"caf\xe9", b"a\x01b", b"\xff", b""])
async def test_site_name_that_cannot_be_stored_is_refused(tmp_path: Path, name: bytes) -> None:
    async with Bridge(state=tmp_path) as bridge:
        client = bridge.client()
        assert await client.ask(b":SMgood#") == b"1"
        assert await client.ask(b":SM%s#" % name, 1.0) in (b"0", b"")
    async with Bridge(state=tmp_path) as bridge:
        assert await bridge.client().ask(b":GM#") == b"good#"
        assert bridge.warned == []


async def test_program_that_selects_no_site_gets_the_last_selected_one(tmp_path: Path) -> None:
    async with Bridge(state=tmp_path, aligned=False) as bridge:
        bridge.client().send(b":W2#")
        await asyncio.sleep(1)
    async with Bridge(state=tmp_path, aligned=False, on=bridge) as bridge:
        assert await bridge.client().ask(b":St+10*00#:Sg010*00#", ending=b"11") == b"11"
        assert bridge.store is not None
        assert bridge.store.shared.settings.sites[2] == NamedSite(None, 10.0, -10.0)


async def test_last_selected_site_is_used_for_a_mount_without_a_site(tmp_path: Path) -> None:
    mount = {"mount": "nexstar-gps", "version": "1.2", "state": tmp_path}
    async with Bridge(**mount) as bridge:
        client = bridge.client("10.0.0.5")
        client.send(b":W1#:St+10*30#")
        await asyncio.sleep(1)
        assert bridge.store is not None
        assert bridge.site_clock.site_to_store() is None, "half a site is none"
        client.send(b":Sg010*00#")
        await asyncio.sleep(1)
    async with Bridge(on=bridge, **mount) as bridge:
        assert bridge.controller.sources.sites()[0].source == "a program (10.0.0.5, 2026-01-15)"
        assert bridge.controller.sources.site() == Place(10.5, -10.0)


async def _hex(client: RehearsalClient, command: bytes, until: bytes = b"#") -> str:
    return (await client.ask(command, ending=until)).hex()


async def test_settings_of_a_celestron_program_survive_a_restart(tmp_path: Path) -> None:
    """Backlash (AUX 0x10, 0x40), guide rate (0x46, 0x47), zone and daylight saving (H, h), on a Meade."""
    kinds = {"driven": "lx200", "presented": "nexstar", "mount": "lx200gps", "surface": None, "state": tmp_path}
    async with Bridge(**kinds) as bridge:  # type: ignore[arg-type]
        client = bridge.client()
        await client.ask(b"P\x02\x10\x10\x2a\0\0\0")
        await client.ask(b"P\x02\x11\x46\x40\0\0\0")
        await client.ask(b"H" + bytes((23, 30, 0, 1, 15, 26, 256 - 5, 1)))
        await asyncio.sleep(2)
    async with Bridge(on=bridge, **kinds) as bridge:  # type: ignore[arg-type]
        client = bridge.client()
        assert await _hex(client, b"P\x01\x10\x40\0\0\0\x01") == "2a23"
        assert await _hex(client, b"P\x01\x11\x47\0\0\0\x01") == "4023"
        clock = await client.ask(b"h")
        assert clock[6:8] == bytes((256 - 5, 1))


async def test_home_and_park_state_survive_a_restart(tmp_path: Path) -> None:
    """:hS stores home, :hP parks; a mount that tracks again when the gateway is back is not parked any more."""
    async with Bridge("cge", state=tmp_path, surface="lx200gps", speed=50) as bridge:
        client = bridge.client()
        client.send(b":hS#")
        await asyncio.sleep(2)
        client.send(b":hP#")
        await asyncio.sleep(60)
        assert bridge.driver.parked
        home = bridge.driver.home_axes
    async with Bridge("cge", state=tmp_path, surface="lx200gps", on=bridge) as bridge:
        assert bridge.driver.home_axes == home is not None
        assert await bridge.client().ask(b":h?#") == b"1"
        bridge.sim.track(2)
    async with Bridge("cge", state=tmp_path, surface="lx200gps", on=bridge) as bridge:
        assert not bridge.driver.parked
        bridge.client().send(b":hF#")
        await asyncio.sleep(1)
        assert bridge.controller.slewing
