"""The Alpaca surface over a whole gateway on virtual time: motions are told exactly as long as they last."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest

from gateway.clients.access import AccessRules
from gateway.core import errors
from gateway.diagnostics.rehearsal.stage import RehearsalMount, Visitor
from gateway.diagnostics.virtual_time import run
from gateway.protocols.alpaca.tables import NUMBERS, number
from tests.support import exact_sky

START = 1769634000.0
CRAB = "RightAscension=5.5756 Declination=22.0145"
MOUNTS = [("6-8se", "nexstar"), ("cge", "nexstar"), ("lx200", "lx200"), ("lx200gps", "lx200")]


def stage(mount: str = "6-8se", driven: str = "nexstar", **settings: Any) -> RehearsalMount:
    return RehearsalMount(mount, start=START, driven=driven, presented="alpaca", named=True, **settings)


async def ask(program: Visitor, line: str) -> Any:
    """A value; an error as its number."""
    told = json.loads(await program.ask(line.encode() + b"\n", until=b"\n"))
    return -told["ErrorNumber"] if isinstance(told, dict) else told


async def connected(own: RehearsalMount, host: str = "127.0.0.1") -> Visitor:
    client = own.client(host)
    assert await ask(client, "put connected Connected=True") is None
    assert await ask(client, "get connected") is True
    return client


@pytest.mark.parametrize("mount", MOUNTS, ids="-".join)
def test_slewing_is_true_until_the_goto_is_over(mount: tuple[str, str]) -> None:
    async def program() -> None:
        async with stage(*mount) as own:
            exact_sky.load(own.controller.astrometry.sky)
            client, other = await connected(own), await connected(own, "192.0.2.7")
            assert await ask(client, "get slewing") is False
            assert await ask(client, f"put slewtocoordinatesasync {CRAB}") is None
            for _ in range(300):
                seen = [await ask(one, "get slewing") for one in (client, other)]
                moves = own.sim.slewing
                if not moves and seen == [False, False]:
                    break
                assert seen[0] or not moves, "nobody is told that it rests while it slews"
                await asyncio.sleep(0.5)
            else:
                raise AssertionError("it never ends")
            assert abs(await ask(client, "get rightascension") - 5.5756) < 0.01
            assert abs(await ask(client, "get declination") - 22.0145) < 0.1
            assert await ask(client, "get targetdeclination") == 22.0145
            assert await ask(other, "get targetdeclination") == -0x402, "targets are each program's own"

    run(program())


@pytest.mark.parametrize("mount", MOUNTS, ids="-".join)
def test_a_pulse_is_told_as_long_as_it_lasts(mount: tuple[str, str]) -> None:
    """Both axes at once, looked at twenty times a second. A motor in azimuth takes 1.4 times as long at 45 degrees."""

    async def program() -> None:
        async with stage(*mount) as own:
            client, clock = await connected(own), own.controller.now
            began = clock()
            assert await ask(client, "put pulseguide Direction=0 Duration=800") is None
            assert await ask(client, "put pulseguide Direction=3 Duration=1200") is None
            assert await ask(client, "get slewing") is False
            while await ask(client, "get ispulseguiding"):
                await asyncio.sleep(0.05)
            assert 1.15 < clock() - began < (2.3 if mount[0] == "lx200gps" else 2.0)

    run(program())


def test_an_axis_turns_until_it_is_told_to_rest() -> None:
    async def program() -> None:
        async with stage() as own:
            client = await connected(own)
            assert await ask(client, "put moveaxis Axis=0 Rate=2.0") is None
            before = await ask(client, "get azimuth")
            await asyncio.sleep(2.0)
            assert 2.0 < await ask(client, "get azimuth") - before < 5.0
            assert await ask(client, "get slewing") is True
            assert await ask(client, "put moveaxis Axis=0 Rate=0") is None
            assert await ask(client, "get slewing") is True, "it runs on"
            await asyncio.sleep(2.0)
            assert await ask(client, "get slewing") is False
            assert await ask(client, "get tracking") is True

    run(program())


def test_whoever_vanishes_moves_nothing_any_more() -> None:
    """Half a minute after its last request the axis rests; the requests of another program do not hold it."""

    async def program() -> None:
        async with stage() as own:
            client, other = await connected(own), await connected(own, "192.0.2.7")
            await ask(client, "put moveaxis Axis=1 Rate=0.1")
            for _ in range(28):
                await asyncio.sleep(1.0)
                assert await ask(other, "get slewing") is True
            await asyncio.sleep(4.0)
            assert await ask(other, "get slewing") is False

    run(program())


def test_abort_ends_everything_whoever_asks() -> None:
    async def program() -> None:
        async with stage() as own:
            client, other = await connected(own), own.client("192.0.2.7")
            await ask(client, f"put slewtocoordinatesasync {CRAB}")
            await asyncio.sleep(1.0)
            assert own.sim.slewing
            assert await ask(other, "put abortslew") is None, "also of a program that has not connected"
            await asyncio.sleep(2.0)
            assert not own.sim.slewing and await ask(client, "get slewing") is False

    run(program())


@pytest.mark.parametrize("mount", [("6-8se", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200")], ids="-".join)
def test_parking(mount: tuple[str, str]) -> None:
    """Between Park and AtPark there is no moment at which it neither slews nor is parked."""

    async def program() -> None:
        async with stage(*mount, speed=4.0) as own:
            client = await connected(own)
            assert await ask(client, "put park") is None
            for _ in range(1200):
                slews, parked = await ask(client, "get slewing"), await ask(client, "get atpark")
                if parked:
                    assert await ask(client, "get slewing") is False, "what is parked is at rest"
                    break
                assert slews or await ask(client, "get atpark")
                await asyncio.sleep(0.1)
            else:
                raise AssertionError("it is never parked")
            assert await ask(client, "get tracking") is False
            for line in (f"put slewtocoordinatesasync {CRAB}", "put moveaxis Axis=0 Rate=1.0",
                         "put tracking Tracking=true", "put pulseguide Direction=0 Duration=100",
                         f"put synctocoordinates {CRAB}"):  # fmt: skip
                assert await ask(client, line) == -0x408, line
            assert await ask(client, "put park") is None, "a parked mount stays so"
            assert await ask(client, "put unpark") is None
            assert await ask(client, "get atpark") is False and await ask(client, "get tracking") is True

    run(program())


def test_who_may_only_look_changes_nothing() -> None:
    async def program() -> None:
        async with stage(access=AccessRules(read_only=True)) as own:
            client = await connected(own)
            assert isinstance(await ask(client, "get rightascension"), float)
            for line in (f"put slewtocoordinatesasync {CRAB}", "put tracking Tracking=false", "put park",
                         "put utcdate UTCDate=2020-01-01T00:00:00Z", "put sitelatitude SiteLatitude=10"):  # fmt: skip
                assert await ask(client, line) == -0x40B, line
            assert await ask(client, "put abortslew") is None, "a stop is never refused"
            assert not own.sim.slewing

    run(program())


def test_gotos_over_the_horizon_take_a_mount_that_does_not_track() -> None:
    async def program() -> None:
        async with stage() as own:
            exact_sky.load(own.controller.astrometry.sky)
            client = await connected(own)
            assert await ask(client, "put slewtoaltazasync Azimuth=200 Altitude=40") == -0x40B
            await ask(client, "put tracking Tracking=false")
            assert await ask(client, f"put slewtocoordinatesasync {CRAB}") == -0x40B
            assert await ask(client, f"put synctocoordinates {CRAB}") == -0x40B
            assert await ask(client, "put slewtoaltazasync Azimuth=200 Altitude=40") is None
            while await ask(client, "get slewing"):
                await asyncio.sleep(0.5)
            assert abs(await ask(client, "get azimuth") - 200.0) < 0.2

    run(program())


def test_site_and_clock_are_taken() -> None:
    async def program() -> None:
        async with stage(aligned=False) as own:
            client = await connected(own)
            await ask(client, "put sitelatitude SiteLatitude=48.5")
            await ask(client, "put sitelongitude SiteLongitude=-11.25")
            await asyncio.sleep(3.0)
            assert abs(await ask(client, "get sitelatitude") - 48.5) < 0.01
            assert abs(await ask(client, "get sitelongitude") + 11.25) < 0.01
            await ask(client, "put utcdate UTCDate=2026-06-01T12:00:00.5")
            assert (await ask(client, "get utcdate")).startswith("2026-06-01T12:00:0")
            await ask(client, "put siteelevation SiteElevation=520.5")
            assert await ask(client, "get siteelevation") == 520.5

    run(program())


def test_a_sync_moves_the_sky() -> None:
    async def program() -> None:
        async with stage() as own:
            client = await connected(own)
            ra, dec = await ask(client, "get rightascension"), await ask(client, "get declination")
            assert (
                await ask(client, f"put synctocoordinates RightAscension={ra + 0.01} Declination={dec + 0.1}") is None
            )
            await asyncio.sleep(1.0)
            assert abs(await ask(client, "get declination") - dec - 0.1) < 0.02

    run(program())


def test_every_refusal_has_a_number() -> None:
    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, errors.Fault)]
    assert len(kinds) > 15
    assert all(number(kind()) in NUMBERS for kind in kinds)


@pytest.mark.parametrize("latitude", [45.0, -45.0])
@pytest.mark.parametrize(("mount", "version"), [("cge", "4.21"), ("cgem", "5.31")])
def test_the_side_of_the_pier_is_the_one_that_was_foretold(mount: str, version: str, latitude: float) -> None:
    """East of the pier it looks west, in either hemisphere and whatever letter the hand control tells."""

    async def program() -> None:
        async with stage(mount, version=version, site=(latitude, 10.0), speed=20.0) as own:
            exact_sky.load(own.controller.astrometry.sky)
            client = await connected(own)
            for hours, side in ((2.0, 0), (-2.0, 1)):
                ra = (await ask(client, "get siderealtime") - hours) % 24.0
                place = f"RightAscension={ra} Declination={latitude / 3.0}"
                assert await ask(client, f"get destinationsideofpier {place}") == side
                assert await ask(client, f"put slewtocoordinatesasync {place}") is None
                while await ask(client, "get slewing"):
                    await asyncio.sleep(0.5)
                assert await ask(client, "get sideofpier") == side

    run(program())
