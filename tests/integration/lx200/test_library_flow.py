"""Objects, the Moon and the help through the whole gateway: what the simulated mount does in the end."""

from __future__ import annotations

import asyncio
from itertools import pairwise
from typing import Any

import pytest
from msgspec.structs import replace

from gateway.astro.catalog import objects
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation
from gateway.clients.profiles import EquinoxConverter
from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from tests.support import exact_sky
from tests.support import in_process_gateway as bridges
from tests.support.fake_mount import Mount, Talk, unix
from tests.support.in_process_gateway import Bridge, RehearsalClient

ARCMINUTE = 1.0 / 60.0
M42 = (83.8221, -5.3911)  # J2000
MODELS = ["autostar", "lx200", "lx200-16", "lx200gps"]
DAY = 86400.0


def pointing(bridge: Bridge) -> tuple[float, float]:
    """Where the simulated hand control says that it points."""
    ra, dec = (int(part, 16) * 360.0 / 2**32 for part in bridge.sim.feed(b"e").rstrip(b"#").split(b","))
    return ra, dec if dec <= 180.0 else dec - 360.0


async def arrived(client: RehearsalClient) -> None:
    while await client.ask(b":D#") == b"\x7f#":
        await asyncio.sleep(1)


#: 2026-01-03, the day of a full moon
FULL_MOON = bridges.EVENING - 12 * DAY


def through(program: Any, **settings: Any) -> None:
    """Run a program over a gateway whose sky is exact."""

    async def whole() -> None:
        async with Bridge("cpc", **settings) as bridge:
            exact_sky.load(bridge.controller.astrometry.sky)
            await program(bridge, bridge.client())

    run(whole())


@pytest.mark.parametrize("model", MODELS)
def test_goto_to_messier_42_arrives(model: str) -> None:
    async def program(bridge: Bridge, client: RehearsalClient) -> None:
        assert await client.ask(b":LM42#:MS#") == b"0"
        await arrived(client)
        wanted = bridge.controller.astrometry.sky.from_j2000(*M42, bridge.clock())
        assert separation(*pointing(bridge), *wanted) < ARCMINUTE
        assert separation(*pointing(bridge), *M42) > 10 * ARCMINUTE  # J2000 is elsewhere

    through(program, surface=model)


def test_j2000_client_gets_catalogue_places() -> None:
    async def program(bridge: Bridge, client: RehearsalClient) -> None:
        sky = bridge.controller.astrometry.sky
        bridge.acceptor.binding = replace(
            bridge.acceptor.binding, j2000_converter=EquinoxConverter(sky, bridge.controller.sources.unix)
        )
        client = bridge.client("10.0.0.9")
        assert await client.ask(b":LM42#:Gr#") == b"05:35:16#"
        assert await client.ask(b":MS#") == b"0"
        await arrived(client)
        assert separation(*pointing(bridge), *sky.from_j2000(*M42, bridge.clock())) < ARCMINUTE
        assert (await client.ask(b":Lf#")).startswith(b"1 - Objects found M42 ")

    through(program, surface="lx200")


def test_browsing_lists_visible_objects_from_west_to_east() -> None:
    async def program(bridge: Bridge, client: RehearsalClient) -> None:
        sky, site = bridge.controller.astrometry.sky, (45.0, 10.0)
        assert await client.ask(b":Sf+06.0#:So30#:Sh70#", ending=b"111") == b"111"
        client.send(b":LF#")
        names, hours = [], []
        sidereal = sky.sidereal_time(bridge.clock(), site[1])
        for _ in range(40):
            names.append(await client.ask(b":LI#"))
            place = place_of(await client.ask(b":Gr#"), await client.ask(b":Gd#"))
            assert 29.9 < sky.az_alt(*place, *site, bridge.clock())[1] < 70.1
            hours.append((place[0] - sidereal + 180.0) % 360.0)
            client.send(b":LN#")
        period = names.index(names[0], 1)  # once round, it begins again
        assert len(set(names[:period])) == period > 10
        assert all(later > earlier - 16.0 for earlier, later in pairwise(hours[:period]))
        client.send(b":LF#:LN#:LB#")
        assert await client.ask(b":LI#") == names[0]
        assert await client.ask(b":MS#") == b"0"

    through(program, surface="lx200")


def place_of(ra: bytes, dec: bytes) -> tuple[float, float]:
    hours, minutes, seconds = (int(part) for part in ra.rstrip(b"#").split(b":"))
    degrees, rest = dec.rstrip(b"#").split(b"*")
    low, high = (int(part) for part in rest.split(b":"))
    size = abs(int(degrees)) + low / 60 + high / 3600
    return 15 * (hours + minutes / 60 + seconds / 3600), -size if dec.startswith(b"-") else size


def test_identify_names_the_objects_where_the_telescope_points() -> None:
    async def program(bridge: Bridge, client: RehearsalClient) -> None:
        await client.ask(b":LM42#:MS#")
        await arrived(client)
        assert (await client.ask(b":Lf#")).startswith(b"1 - Objects found M42 ")
        assert await client.ask(b":SF090#") == b"1"
        many = await client.ask(b":Lf#")
        assert int(many.split()[0]) > 5
        assert await client.ask(b":Sf+05.0#") == b"1"
        assert 0 < int((await client.ask(b":Lf#")).split()[0]) < int(many.split()[0])
        assert await client.ask(b":Sl500#:Ss900#", ending=b"11") == b"11"
        assert await client.ask(b":Lf#") == b"0 - Objects found#"

    through(program, surface="lx200")


def test_object_below_the_horizon_is_refused() -> None:
    async def program(bridge: Bridge, client: RehearsalClient) -> None:
        assert await client.ask(b":LC104#:MS#") == b"1Object Below Horizon.#"  # 47 Tucanae from 45 north

    through(program)


# --- the Moon and the planets -------------------------------------------------------------------------------------


def test_goto_to_a_lunar_crater_follows_the_moon() -> None:
    async def program(bridge: Bridge, client: RehearsalClient) -> None:
        sky = bridge.controller.astrometry.sky
        assert await client.ask(b":SE-43*18#:Se-011*13#", ending=b"11") == b"11"  # Tycho
        for _ in range(2):
            assert await client.ask(b":MS#") == b"0"
            asked = bridge.clock()
            await arrived(client)
            wanted = sky.moon_spot(asked, 45.0, 10.0, -43.3, -11.2167)
            assert separation(*pointing(bridge), *wanted) < 0.2 * ARCMINUTE
            middle = sky.moon(asked, 45.0, 10.0)[:2]
            assert 10 * ARCMINUTE < separation(*pointing(bridge), *middle) < 16 * ARCMINUTE
            client.send(b":Q#")
            await asyncio.sleep(900)

    through(program, start=FULL_MOON)


def test_sync_to_a_place_on_the_moon_is_carried_out() -> None:
    async def program(bridge: Bridge, client: RehearsalClient) -> None:
        await client.ask(b":SE+00*00#:Se+000*00#:MS#", ending=b"110")
        await arrived(client)
        assert await client.ask(b":SE+20*00#") == b"1"
        assert await client.ask(b":CL#", 5) == b""
        wanted = bridge.controller.astrometry.sky.moon_spot(bridge.clock(), 45.0, 10.0, 20.0, 0.0)
        assert separation(*pointing(bridge), *wanted) < 0.3 * ARCMINUTE
        client.send(b":Sr05:00:00#:Sd+20*00:00#:CL#")  # no place on the Moon: nothing to sync to
        await asyncio.sleep(5)
        assert separation(*pointing(bridge), *wanted) < 0.5 * ARCMINUTE

    through(program, start=FULL_MOON)


@pytest.mark.parametrize("site", [(45.0, 10.0), (-45.0, 10.0)])
def test_moon_below_the_horizon_is_refused_as_a_target(site: tuple[float, float]) -> None:
    for hour in range(0, 24, 3):
        mount = Mount()
        mount.site = op.Place(*site)
        mount.clock = op.Moment(unix(f"2026-01-03 {hour:02d}:00:00"), 0.0)
        sky = Sky()
        ra, dec, _ = sky.moon(mount.clock.unix, *site)
        up = sky.az_alt(ra, dec, *site, mount.clock.unix)[1] >= 0
        talk = Talk(mount)
        assert talk.send(b":LM42#:SE+10*00#") == (b"1" if up else b"0")
        assert talk.send(b":Se+010*00#") == (b"1" if up else b"0")
        assert talk.send(b":MS#") == (b"0" if up else b"1The Moon is below the horizon.#")


def test_goto_to_jupiter_arrives() -> None:
    async def program(bridge: Bridge, client: RehearsalClient) -> None:
        assert await client.ask(b":Ls0#:LS905#:MS#", ending=b"10") == b"10"
        await arrived(client)
        place = bridge.controller.astrometry.sky.planet("Jupiter", bridge.clock())
        assert place is not None
        assert separation(*pointing(bridge), *place) < ARCMINUTE

    through(program)


def test_planet_without_a_known_position_is_refused_in_words() -> None:
    talk = Talk()  # its sky has not loaded astropy
    assert talk.send(b":Ls0#:LS904#:MS#") == b"11The positions of the planets are not available yet.#"


# --- what is missing ----------------------------------------------------------------------------------------------


def test_object_commands_report_a_missing_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(objects, "find_spec", lambda name: None)
    missing = b"Object library not installed.#"
    for selecting in (b":LM42#", b":LC7331#", b":Lo1#:LC1#", b":LF#", b":LN#", b":LB#"):
        talk = Talk(model="lx200")
        assert talk.send(selecting + b":LI#").endswith(missing)
        assert talk.send(b":MS#") == b"1" + missing
    talk = Talk(model="lx200")
    assert talk.send(b":Lf#") == missing
    assert talk.send(b":Lo0#:Lo3#:Ls3#:Ls0#") == b"0021"
    assert Talk().send(b":Ls3#:Lo0#:LM42#:MS#") == b"211" + missing
    assert Talk().send(b":LS32349#:MS#") == b"1" + missing


def test_without_a_site_every_object_counts_as_risen() -> None:
    mount = Mount()
    talk = Talk(mount, model="lx200")
    talk.send(b":Sf+03.0#:LF#")
    first = talk.send(b":LI#")
    mount.faults[op.Zenith] = objects.Unsupported("The site is not known.")
    assert talk.send(b":LF#:LI#") != first
    assert b"No object" not in talk.send(b":LI#")


# --- help ---------------------------------------------------------------------------------------------------------


def test_lx200_help_names_the_mount_and_its_real_alignment() -> None:
    async def program(bridge: Bridge, client: RehearsalClient) -> None:
        lines = [await client.ask(b":??#")]
        while lines[-1] != b"#":
            lines.append(await client.ask(b":?+#"))
        text = b"".join(lines).decode("ascii")
        assert "mount-gateway" in text
        assert "Celestron NexStar cpc, version 4.21" in text
        assert ("NOT aligned" in text) == (not bridge.sim.feed(b"J").startswith(b"\x01"))
        assert all(len(line) <= 64 for line in lines)
        assert await client.ask(b":?-#") == lines[-2]

    for aligned in (True, False):
        through(program, surface="lx200", aligned=aligned)


def test_each_program_turns_only_its_help_pages() -> None:
    mount = Mount()
    one, other = Talk(mount, model="lx200"), Talk(mount, model="lx200")
    first = one.send(b":??#")
    second = one.send(b":?+#")
    assert other.send(b":??#") == first
    assert one.send(b":?-#") == first
    assert other.send(b":?+#") == second
