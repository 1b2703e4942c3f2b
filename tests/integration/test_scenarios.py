"""An evening at every kind of hand control: the same LX200 program, what the version lacks made up for by the gateway.

The client's bytes are typed by hand; what happened is read from the simulated mount itself.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.astro.spherical import separation
from gateway.core.operations import Equatorial
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge, Visitor

OLD_SITE = {"site": (45.0, 10.0), "mode": "alt-az"}
#: model, version, what the user must say because the hand control cannot
MOUNTS: list[tuple[str, str, dict[str, Any]]] = [
    ("nexstar-gps", "1.2", OLD_SITE),
    ("nexstar-gps", "1.6", {"mode": "alt-az"}),
    ("i-series", "2.2", OLD_SITE),
    ("cge", "3.02", {}),
    ("slt", "4.10", {}),
    ("gt", "104.0", {}),
    ("cpc", "4.21", {}),
    ("cgem", "5.31", {}),
    ("avx", "5.31", {}),
    ("evolution", "5.31", {}),
    ("6-8se", "starsense-1.20", {}),
]
SITES = [(45.0, 10.0), (-34.0, 18.5)]
ARCSECOND = 1.0 / 3600.0


def hms(degrees: float) -> str:
    seconds = round(degrees * 240) % 86400
    return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"


def dms(degrees: float) -> str:
    seconds = round(abs(degrees) * 3600)
    return f"{'-' if degrees < 0 else '+'}{seconds // 3600:02d}*{seconds // 60 % 60:02d}:{seconds % 60:02d}"


def parse_ra(text: bytes) -> float:
    h, m, s = text.rstrip(b"#").split(b":")
    return (int(h) + int(m) / 60 + int(s) / 3600) * 15


def parse_dec(text: bytes) -> float:
    sign = -1 if text[:1] == b"-" else 1
    d, rest = text[1:].rstrip(b"#").split(b"*")
    m, s = rest.split(b":")
    return sign * (int(d) + int(m) / 60 + int(s) / 3600)


async def where(client: Visitor) -> Equatorial:
    return Equatorial(parse_ra(await client.ask(b":GR#")), parse_dec(await client.ask(b":GD#")))


def apart(one: Equatorial, other: Equatorial) -> float:
    return separation(one.ra, one.dec, other.ra, other.dec)


def truth(bridge: Bridge) -> Equatorial:
    return Equatorial(*bridge.sim.truth())


def target_near(bridge: Bridge, site: tuple[float, float], hour_angle: float, dec: float) -> Equatorial:
    """A place at a small hour angle and a declination that is well up at that site."""
    from gateway.astro.ephemeris.closed_forms import sidereal_time
    from gateway.astro.spherical import wrap360

    return Equatorial(wrap360(sidereal_time(bridge.clock(), site[1]) - hour_angle), dec if site[0] > 0 else -dec)


async def goto(client: Visitor, target: Equatorial) -> bytes:
    command = f":Sr{hms(target.ra)}#:Sd{dms(target.dec)}#:MS#".encode()
    return await client.ask(command, 15, until=b"110")


async def arrive(bridge: Bridge, client: Visitor) -> tuple[list[bytes], list[Equatorial]]:
    """Poll as programs do until :D# says that it is over -> the bars and positions seen."""
    bars, places = [], []
    for _ in range(400):
        bars.append(await client.ask(b":D#"))
        places.append(await where(client))
        if bars[-1] == b"#":
            return bars, places
        await asyncio.sleep(1.0)
    raise AssertionError("the goto never ended")


@pytest.mark.parametrize("site", SITES, ids=["north", "south"])
@pytest.mark.parametrize(("model", "version", "config"), MOUNTS, ids=[f"{m} {v}" for m, v, _ in MOUNTS])
def test_an_evening(model: str, version: str, config: dict[str, Any], site: tuple[float, float]) -> None:
    config = {**config, **({"site": site} if "site" in config else {})}
    run(_evening(model, version, config, site))


async def _evening(model: str, version: str, config: dict[str, Any], site: tuple[float, float]) -> None:
    # a second of right ascension is 15 arcseconds, a tick of the 16-bit commands 20
    coarse = 30 * ARCSECOND if version == "1.2" else 12 * ARCSECOND
    async with Bridge(model, version, site=site, config=config, latency=0.1) as bridge:
        client = bridge.client()
        # the first look
        assert await client.ask(b"\x06") in (b"A", b"P")
        assert apart(await where(client), truth(bridge)) < coarse + 3 * ARCSECOND
        assert parse_dec(await client.ask(b":GA#")) == pytest.approx(45.0, abs=0.1) or bridge.sim.german
        assert await client.ask(b":Gt#") == f"{dms(site[0])[:6]}#".encode()

        # a goto
        target = target_near(bridge, site, 15.0, 30.0)
        assert await goto(client, target) == b"110"
        bars, places = await arrive(bridge, client)
        assert bars[0] == b"\x7f#"
        assert len({(p.ra, p.dec) for p in places}) >= 3
        assert apart(await where(client), target) < 30 * ARCSECOND
        assert apart(truth(bridge), target) < 30 * ARCSECOND

        # tracking holds it
        await asyncio.sleep(20)
        assert apart(truth(bridge), target) < 30 * ARCSECOND

        # below the horizon: refused with words, and nothing moves
        below = Equatorial((target.ra + 180) % 360, -target.dec)
        command = f":Sr{hms(below.ra)}#:Sd{dms(below.dec)}#:MS#".encode()
        assert (await client.ask(command, 5, until=b".#")).startswith(b"111")
        assert await client.ask(b":D#") == b"#"

        # abort
        assert await goto(client, target_near(bridge, site, -40.0, 10.0)) == b"110"
        await asyncio.sleep(2)
        client.tell(b":Q#")
        await asyncio.sleep(3.0)  # it runs on for a second, and two positions show the end of that
        assert await client.ask(b":D#") == b"#"
        stood = truth(bridge)
        await asyncio.sleep(5)
        assert apart(truth(bridge), stood) < 30 * ARCSECOND

        # the arrows, and tracking afterwards as before
        mode = bridge.sim.tracking
        for direction in b"nsew":
            before = await where(client)
            client.tell(b":RM#:M%c#" % direction)
            await asyncio.sleep(2)
            client.tell(b":Q%c#" % direction)
            await asyncio.sleep(3)
            after = await where(client)
            assert apart(before, after) > 0.2, chr(direction)
            _check_sense(bridge, direction, before, after)
            still = truth(bridge)
            await asyncio.sleep(3)
            assert apart(truth(bridge), still) < 5 * ARCSECOND, chr(direction)
        assert bridge.sim.tracking == mode

        # a sync moves the sky, not the mount; and the next goto goes by it
        here = await where(client)
        there = Equatorial((here.ra + 0.5) % 360, here.dec + 0.5)
        encoders = truth(bridge)
        command = f":Sr{hms(there.ra)}#:Sd{dms(there.dec)}#:CM#".encode()
        assert (await client.ask(command, 5, until=b"'#")).startswith(b"11 M31")
        assert apart(await where(client), there) < coarse + 5 * ARCSECOND
        assert apart(truth(bridge), encoders) < 30 * ARCSECOND
        assert await goto(client, Equatorial((there.ra + 5) % 360, there.dec)) == b"110"
        await arrive(bridge, client)
        assert apart(await where(client), Equatorial((there.ra + 5) % 360, there.dec)) < 30 * ARCSECOND

        # a sync to the other end of the sky is not done
        command = f":Sr{hms(there.ra + 90)}#:Sd{dms(0.0)}#:CM#".encode()
        assert await client.ask(command, 5, until=b"#") == b"11#"


def _check_sense(bridge: Bridge, direction: int, before: Equatorial, after: Equatorial) -> None:
    """North raises the declination and west lowers the right ascension on an equatorial mount."""
    if not bridge.sim.german:
        return
    east = (after.ra - before.ra + 180) % 360 - 180
    if direction in b"ns":
        assert (after.dec > before.dec) == (direction in b"n"), chr(direction)
    else:
        assert (east > 0) == (direction in b"e"), chr(direction)
