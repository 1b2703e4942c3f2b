"""Two gateways in a row: each of four surfaces driven by another gateway, over each of four mounts.

What a program orders at one end is read at the other, from the simulated mount itself; programs of both kinds, in both
hemispheres, take turns. Site and time are read at both gateways.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.astro.ephemeris.closed_forms import sidereal_time
from gateway.astro.spherical import separation, wrap180, wrap360
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge
from tests.support.sampling import as_a_rule
from tests.support.two_gateways import TwoGateways
from tests.support.typed_programs import Face

#: What the inner gateway presents, and what it drives; the model that a nexstar surface has over it of itself.
SURFACES = [("lx200", "lx200gps"), ("lx200", "lx200"), ("lx200", "lx200-16"), ("nexstar", None)]
MOUNTS = [
    ("nexstar", "cge", "cge"),
    ("lx200", "lx200gps", "6-8se"),
    ("lx200", "lx200", "cpc"),
    ("lx200", "lx200-16", "cpc"),
]
#: More of what differs: a model that is named, a StarSense at each end, a fork on its wedge.
MORE = [
    (("nexstar", "6-8se/starsense-1.20"), ("nexstar", "cpc/starsense-1.20", "6-8se")),
    (("nexstar", "cge"), ("lx200", "lx200", "cge")),
    (("nexstar", "avx/5.31"), ("nexstar", "cgx/5.31", "cgx")),
    (("lx200", "autostar"), ("lx200", "autostar", "6-8se")),
]
#: In this order every third one is of another surface and another mount.
PAIRS = MORE + [(surface, mount) for surface in SURFACES for mount in MOUNTS]
CASES = [
    pytest.param(
        surface,
        mount,
        number // 2 % 2 == 1,
        (number + number // 4) % 2 == 1,
        id=f"{surface[1] or surface[0]}-on-{mount[1]}",
    )
    for number, (surface, mount) in enumerate(PAIRS)
]
NORTH, SOUTH = (45.0, 10.0), (-33.5, -70.25)
SECOND = 1.0 / 3600.0
#: Half a second of right ascension and of declination, and what 24 bits lose.
EXACT = 8.0 * SECOND


def _parts(named: str | None) -> tuple[str | None, str | None]:
    model, _, version = (named or "").partition("/")
    return model or None, version or None


def row(surface: tuple[str, str | None], mount: tuple[str, str, str], nexstar: bool, **more: Any) -> TwoGateways:
    """The chain of a case; its outer surface is the program's."""
    driven, named, fits = mount
    (model, version), (shown, shown_as) = _parts(named), _parts(surface[1] or fits)
    assert model is not None
    bridge = Bridge(
        model,
        version,
        driven=driven,
        presented=surface[0],
        surface=shown,
        surface_version=shown_as,
        latency=0.02,
        config={"lowest": -90.0, "sun": 0.0},
        **more,
    )
    return TwoGateways(bridge, surface[0], "nexstar" if nexstar else "lx200", fits if nexstar else "autostar")


def faces(chain: TwoGateways, surface: tuple[str, str | None], nexstar: bool) -> tuple[Face, Face]:
    """A program at the outer gateway, and one at the inner."""
    inner = chain.inner
    return Face(inner, chain.client(), nexstar), Face(inner, inner.client(), surface[0] == "nexstar")


def apart(one: tuple[float, float], other: tuple[float, float]) -> float:
    return separation(*one, *other)


async def does_what_is_ordered(chain: TwoGateways, one: Face, site: tuple[float, float]) -> None:
    """Gotos are exact, stops stop, arrows move, and a sync moves the sky for the program and not the tube."""
    sim, sidereal, south = chain.inner.sim, sidereal_time(chain.inner.clock(), site[1]), site[0] < 0.0

    async def stops() -> tuple[float, float]:
        await one.stop()
        await asyncio.sleep(3.5)
        stood: tuple[float, float] = sim.truth()
        await asyncio.sleep(2.0)
        assert apart(sim.truth(), stood) < EXACT and sim.tracking
        return stood

    assert apart(await one.place(), sim.truth()) < 2.0 * EXACT
    target = round(wrap360(sidereal + 20.0) * 240.0) / 240.0, (-33.2575 if south else 33.2575)
    await one.goto(*target)
    assert apart(sim.truth(), target) < EXACT
    assert apart(await one.place(), target) < EXACT
    await one.leave(wrap360(sidereal - 40.0), -10.0 if south else 10.0)
    await asyncio.sleep(3.0)
    assert sim.slewing
    stood = await stops()
    await one.arrows()
    await asyncio.sleep(2.0)
    assert apart(sim.truth(), stood) > 0.5
    stood = await stops()
    ra, dec = await one.place()
    centred = round(wrap360(ra + 0.5) * 240.0) / 240.0, round((dec + 0.5) * 3600.0) / 3600.0
    await one.sync(*centred)
    await asyncio.sleep(2.0)
    assert apart(await one.place(), centred) < 2.0 * EXACT
    assert apart(sim.truth(), stood) < 2.0 * EXACT


@pytest.mark.sampled(every=3)
@pytest.mark.parametrize(("surface", "mount", "south", "nexstar"), CASES)
def test_two_gateways_in_a_row_move_the_mount(
    surface: tuple[str, str | None], mount: tuple[str, str, str], south: bool, nexstar: bool
) -> None:
    """A sync moves the sky at both ends."""

    async def program() -> None:
        site = SOUTH if south else NORTH
        chain = row(surface, mount, nexstar, site=site)
        async with chain:
            one, inner = faces(chain, surface, nexstar)
            await does_what_is_ordered(chain, one, site)
            assert apart(await one.place(), await inner.place()) < 2.0 * EXACT

    run(program())


#: Classics cannot park: the surface of one does not, and on one the gateway cannot.
PARKS = [
    case
    for case in CASES[4:] + [CASES[number] for number in (0, 3, 1, 2)]
    if case.values[0][1] != "lx200" and case.values[1][1] != "lx200"
]  # type: ignore[index]


@pytest.mark.sampled(every=2)
@pytest.mark.parametrize(("surface", "mount", "south", "nexstar"), PARKS)
def test_park_order_passes_two_gateways(
    surface: tuple[str, str | None], mount: tuple[str, str, str], south: bool, nexstar: bool
) -> None:
    """``:hP#`` at one end: at the pole, or low in the north, and standing; a 16 inch only by its own ``:hP#``."""

    async def program() -> None:
        chain = row(surface, mount, False, site=SOUTH if south else NORTH)
        sim = chain.inner.sim
        async with chain:
            chain.client().tell(b":hP#")
            for _ in range(40):
                await asyncio.sleep(4.0)
                if not (sim.slewing or sim.tracking):
                    break
            axes = sim.mechanics.axes(chain.inner.clock())
            equatorial_mount = mount[1] in ("cge", "lx200-16", "cgx/5.31")
            if equatorial_mount:
                assert axes[1] == pytest.approx(90.0, abs=0.2)
            else:
                assert wrap180(axes[0]) == pytest.approx(0.0, abs=0.2) and axes[1] == pytest.approx(0.0, abs=0.6)
            if (surface[0], mount[1]) != ("nexstar", "lx200-16"):  # its tracking is switched off by its own park alone
                assert not sim.tracking

    run(program())


CLOCKS = [(-5, 1), (9, 0), (12, 1), (5.5, 0), (-3.5, 0)]


@pytest.mark.sampled(every=3)
@pytest.mark.parametrize(("surface", "mount", "south", "nexstar"), CASES)
def test_site_and_time_pass_two_gateways(
    surface: tuple[str, str | None], mount: tuple[str, str, str], south: bool, nexstar: bool
) -> None:
    """East and west, half-hour zones, daylight saving: the same at both gateways and on the mount.

    A classic cannot say that it is not aligned: over a nexstar surface it is told neither, the outer one keeps both.
    """
    kept = surface[0] == "nexstar" and mount[1] in ("lx200", "lx200-16")

    async def program() -> None:
        chain = row(surface, mount, nexstar, aligned=False)
        sim, began = chain.inner.sim, chain.inner.clock
        async with chain:
            one, inner = faces(chain, surface, nexstar)
            for site in ((33.5, -118.25), (-33.75, 151.25), (0.25, -0.5)):
                await one.set_site(*site)
                await asyncio.sleep(4.0)
                sky = sim.mechanics.sky
                told = [await one.site()] + ([] if kept else [await inner.site(), (sky.latitude, sky.longitude)])
                for latitude, longitude in told:
                    assert latitude == pytest.approx(site[0], abs=1e-6)
                    assert wrap180(longitude - site[1]) == pytest.approx(0.0, abs=1e-6)
            number, of_two = PAIRS.index((surface, mount)), as_a_rule(2, whole=1)
            for zone, dst in CLOCKS[number // 3 % of_two :: of_two]:  # the others at the next pair
                if nexstar and zone != int(zone):
                    continue
                wanted = float(round(began() + 10000.0 * (zone + 14.0)))
                ahead = wanted - began()
                await one.set_clock(wanted, zone + dst, dst)
                await asyncio.sleep(25.0 if mount[1] in ("lx200", "lx200-16") else 5.0)
                # whole seconds each way, at two gateways
                assert -2.1 < await one.clock() - ahead - began() < 1.1, (zone, dst)
                if not kept:
                    sim.feed(b"")
                    assert -1.6 < sim.utc() - ahead - began() < 1.1, (zone, dst)
                    assert -3.1 < await inner.clock() - ahead - began() < 1.1, (zone, dst)

    run(program())
