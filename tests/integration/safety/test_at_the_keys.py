"""Motion at the mount's own keys: what the limits leave alone, and what they end. Judged by the true axes.

The owner is a second connection to the simulated mount. A program polls the position, with or without the state of a
goto, or nobody does. 2026-01-15 22:00 UTC.
"""

from __future__ import annotations

import asyncio
from contextlib import asynccontextmanager
from typing import Any

import pytest

from gateway.astro.axes import Build
from gateway.astro.spherical import horizon_to_hour_angle, hour_angle_to_horizon, separation, wrap360
from gateway.protocols.mechanics.truth import Truth, truth_of
from tests.support.in_process_gateway import Bridge, RehearsalClient
from tests.support.owner import Owner
from tests.support.truth import altitude, sampled

NORTH, SOUTH = (45.0, 10.0), (-33.0, 150.0)
#: Degrees that a mount runs on after a stop if both axes turn at full speed, and a degree to see and to stop it.
RUN_ON = {"lx200": 5.7 + 1.0, "nexstar": 3.2 + 1.0}
POLLS = [b":GR#:GD#", b":GR#:GD#:D#"]
NOBODY = b""
#: 2026-03-20 11:27 UTC: in the north the Sun is at the meridian, 45 degrees high.
EQUINOX_NOON = 1774006020.0
GERMAN = [("cge", None), ("cgem", "5.31"), ("avx", "5.24"), ("cge", "4.10")]
FORKS = [("cpc", "nexstar"), ("6-8se", "nexstar"), ("lx200gps", "lx200"), ("autostar", "lx200"), ("lx200", "lx200")]


async def _poll(client: RehearsalClient, words: bytes) -> None:
    while words:
        client.send(words)
        await asyncio.sleep(0.7)


@asynccontextmanager
async def owned(mount: str, version: str | None = None, *, polls: bytes = POLLS[0], **settings: Any) -> Any:
    """A gateway whose mount is used by its owner while a program polls it; the stage, the owner, what was seen."""
    driven = settings.setdefault("driven", "nexstar")
    settings["config"] = {"sun": 0.0, **settings.get("config", {})}
    async with Bridge(mount, version, **settings) as bridge:
        owner, seen = Owner(bridge, driven), list[Truth]()
        polling = asyncio.ensure_future(_poll(bridge.client("10.0.0.9"), polls))
        await asyncio.sleep(1.0)
        try:
            async with sampled(bridge.sim, seen.append):
                yield bridge, owner, seen
        finally:
            polling.cancel()


def at(bridge: Any, az: float, alt: float) -> tuple[float, float]:
    """Return right ascension and declination of a direction now."""
    sky = bridge.sim.mechanics.true_sky
    hour_angle, dec = horizon_to_hour_angle(az, alt, sky.latitude)
    return wrap360(sky.lst(bridge.sim.clock()) - hour_angle), dec


async def rests(bridge: Any, seconds: float = 120.0) -> None:
    """Wait until nothing moves but by tracking."""
    still = 0
    for _ in range(round(seconds * 2)):
        await asyncio.sleep(0.5)
        still = 0 if truth_of(bridge.sim).moving else still + 1
        if still >= 4:
            return
    raise AssertionError("the mount is still moving")


async def goes(bridge: Any, owner: Owner, az: float, alt: float) -> float:
    """Let the owner send the mount there, and return how far from there it comes to rest."""
    ra, dec = at(bridge, az, alt)
    owner.goto(ra, dec)
    await asyncio.sleep(1.0)
    assert truth_of(bridge.sim).moving
    await rests(bridge)
    return separation(*bridge.sim.true_position(), ra, dec)


# --- the hour angle -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("polls", POLLS)
@pytest.mark.parametrize("site", [NORTH, SOUTH])
@pytest.mark.parametrize(("mount", "version"), GERMAN)
async def test_keypad_meridian_flip_is_not_stopped_by_the_hour_angle_limit(
    mount: str, version: str | None, site: tuple[float, float], polls: bytes
) -> None:
    config = {"hour_angle_limit": 0.5}
    async with owned(mount, version, site=site, config=config, polls=polls) as (bridge, owner, _):
        south = 180.0 if site[0] > 0 else 0.0
        for az in (south - 10.0, south + 20.0, south - 40.0, south + 60.0):
            assert await goes(bridge, owner, wrap360(az), 50.0) < 0.3
            assert not owner.ended()
        await asyncio.sleep(20.0)
        assert bridge.sim.tracking


@pytest.mark.parametrize("site", [NORTH, SOUTH])
@pytest.mark.parametrize(("mount", "version"), GERMAN)
async def test_keypad_arrow_ends_at_the_hour_angle_limit(
    mount: str, version: str | None, site: tuple[float, float]
) -> None:
    async with owned(mount, version, site=site, config={"hour_angle_limit": 0.5}) as (bridge, owner, seen):
        south = 180.0 if site[0] > 0 else 0.0
        assert await goes(bridge, owner, wrap360(south - 20.0), 50.0) < 0.3
        assert abs(truth_of(bridge.sim).axis1 - 90.0) > 30.0
        owner.keys(pier_key(bridge))
        await rests(bridge)
        past = [one.past_meridian for one in seen if one.past_meridian is not None]
        assert owner.ended()
        assert past[-1] > -12.0 and max(past) < 7.5 + RUN_ON["nexstar"]


@pytest.mark.parametrize("polls", POLLS)
@pytest.mark.parametrize("site", [NORTH, SOUTH])
async def test_keypad_goto_beyond_the_hour_angle_limit_arrives_before_tracking_ends(
    site: tuple[float, float], polls: bytes
) -> None:
    async with owned("6-8se", site=site, config={"hour_angle_limit": 3.0}, polls=polls) as (bridge, owner, _):
        bridge.sim.feed(b"T\x02" if site[0] > 0 else b"T\x03")
        await asyncio.sleep(10.0)
        for az in (90.0, 270.0):
            assert await goes(bridge, owner, az, 25.0) < 0.3
            assert abs(truth_of(bridge.sim).hour_angle) > 45.0
        assert bridge.sim.tracking
        await asyncio.sleep(25.0)
        assert not bridge.sim.tracking, "in the west it leads farther beyond the limit"


# --- altitude -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("polls", POLLS)
@pytest.mark.parametrize("site", [NORTH, SOUTH])
@pytest.mark.parametrize(("mount", "driven"), [*FORKS, ("cgem", "nexstar")])
@pytest.mark.safety_line(3)
async def test_default_limits_do_not_end_a_keypad_arrow(
    mount: str, driven: str, site: tuple[float, float], polls: bytes
) -> None:
    async with owned(mount, driven=driven, site=site, polls=polls) as (bridge, owner, _):
        assert await goes(bridge, owner, 90.0, 15.0) < 0.3
        owner.keys(sinking_key(bridge, driven))
        for _ in range(100):
            await asyncio.sleep(0.2)
            if altitude(bridge.sim) < -4.0:
                break
            assert truth_of(bridge.sim).moving and not owner.ended()
        assert altitude(bridge.sim) < -4.0
        owner.keys("let go", "first let go")
        await rests(bridge)


def sinking_key(bridge: Any, driven: str) -> str:
    """Return the key that lowers the tube in the east."""
    geometry = bridge.sim.mechanics.geometry
    if geometry.build is Build.ALTAZ:
        return "down"
    if driven == "lx200":
        return "first back"  # its keys are directions on the sky
    first, second = bridge.sim.mechanics.axes(bridge.sim.now)
    hour_angle, dec = geometry.ha_dec_of_axes(first + 1.0, second)
    higher = hour_angle_to_horizon(hour_angle, dec, bridge.sim.mechanics.true_sky.latitude)[1]
    return "first on" if higher < altitude(bridge.sim) else "first back"


@pytest.mark.parametrize("polls", POLLS)
@pytest.mark.parametrize("site", [NORTH, SOUTH])
@pytest.mark.parametrize(("mount", "driven"), [*FORKS, ("cgem", "nexstar")])
@pytest.mark.safety_line(3)
async def test_configured_altitude_limit_ends_keypad_arrows_and_gotos(
    mount: str, driven: str, site: tuple[float, float], polls: bytes
) -> None:
    config = {"lowest": 20.0}
    async with owned(mount, driven=driven, site=site, config=config, polls=polls) as (bridge, owner, seen):
        for az, alt in ((110.0, 60.0), (115.0, 24.0), (110.0, 21.0), (140.0, 40.0)):
            assert await goes(bridge, owner, az, alt) < 0.3, "it stays above the limit"
        assert not owner.ended()
        assert await goes(bridge, owner, 130.0, 3.0) > 5.0
        assert min(one.altitude for one in seen) > 20.0 - RUN_ON[driven]
        assert owner.ended()
        assert await goes(bridge, owner, 130.0, 45.0) < 0.3
        owner.keys(sinking_key(bridge, driven))
        await rests(bridge)
        assert owner.ended() and min(one.altitude for one in seen) > 20.0 - RUN_ON[driven]


#: Seconds at rest after which an owner presses a key: whenever the position was read last.
RESTED = (15.0, 16.3, 17.6, 18.9)


@pytest.mark.parametrize("site", [NORTH, SOUTH])
@pytest.mark.parametrize(("mount", "driven"), [("cpc", "nexstar"), ("lx200gps", "lx200")])
async def test_keypad_arrows_end_at_the_altitude_limit_with_no_program_polling(
    mount: str, driven: str, site: tuple[float, float]
) -> None:
    async with owned(mount, driven=driven, site=site, config={"lowest": 20.0}, polls=NOBODY) as (bridge, owner, seen):
        for rested in RESTED:
            await goes(bridge, owner, 110.0, 22.0)
            await asyncio.sleep(rested)
            owner.keys("down")
            await rests(bridge)
            assert owner.ended() and min(one.altitude for one in seen) > 20.0 - RUN_ON[driven]


@pytest.mark.parametrize("site", [NORTH, SOUTH])
async def test_keypad_arrows_end_at_the_hour_angle_limit_with_no_program_polling(site: tuple[float, float]) -> None:
    async with owned("cge", site=site, config={"hour_angle_limit": 0.5}, polls=NOBODY) as (bridge, owner, seen):
        south = 180.0 if site[0] > 0 else 0.0
        for rested in RESTED:
            for az in (south - 10.0, south + 3.0):
                await goes(bridge, owner, wrap360(az), 50.0)
            await asyncio.sleep(rested)
            seen.clear()  # a flip is no arrow
            owner.keys(pier_key(bridge))
            await rests(bridge)
            assert owner.ended() and max(one.past_meridian for one in seen) < 7.5 + RUN_ON["nexstar"]


@pytest.mark.parametrize(("mount", "driven"), [("cpc", "nexstar"), ("lx200gps", "lx200")])
async def test_keypad_arrows_end_at_the_sun_limit_with_no_program_polling(mount: str, driven: str) -> None:
    settings = {"driven": driven, "start": EQUINOX_NOON, "site": NORTH, "config": {"sun": 20.0}}
    async with owned(mount, polls=NOBODY, **settings) as (bridge, owner, seen):
        for rested in RESTED:
            await goes(bridge, owner, 180.0, 67.0)  # 22 degrees above the Sun
            await asyncio.sleep(rested)
            seen.clear()
            owner.keys("down")
            await rests(bridge)
            assert owner.ended() and min(one.sun_distance for one in seen) > 20.0 - RUN_ON[driven]


def pier_key(bridge: Any) -> str:
    """Return the key that turns the tube of a German mount towards its pier."""
    return "first on" if truth_of(bridge.sim).axis1 > 90.0 else "first back"
