"""Parking and the altitude limits: the place that nobody chose lies within them, the owner's own may lie beyond."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.core.errors import UserError
from gateway.diagnostics.virtual_time import run
from gateway.protocols.mechanics.truth import truth_of
from tests.support import truth
from tests.support.in_process_gateway import Bridge
from tests.support.looks import at_rest, notes
from tests.unit.app.config.test_config import flags


def parked(config: dict[str, Any], mount: str = "cpc", driven: str = "nexstar") -> tuple[float, bool, list[str]]:
    """``:hP#`` until nothing moves -> where the tube truly points, whether the mount tracks, what was said."""
    seen: list[Any] = []

    async def program() -> None:
        async with Bridge(mount, driven=driven, config=config) as bridge:
            client = bridge.client()
            await client.ask(b":GR#")
            client.send(b":hP#")
            rested = 0
            for _ in range(60):
                client.send(b":D#")
                await asyncio.sleep(1.0)
                rested = 0 if truth.moving(bridge.sim) else rested + 1
                if rested == 8:
                    break
            seen.append((truth_of(bridge.sim).altitude, truth_of(bridge.sim).tracking, notes(bridge)))

    run(program())
    found: tuple[float, bool, list[str]] = seen[0]
    return found


@pytest.mark.parametrize(("lowest", "altitude"), [(0.0, 0.5), (10.0, 10.5), (-0.2, 0.3), (-90.0, 0.0)])
def test_fork_parks_at_the_lowest_allowed_altitude(lowest: float, altitude: float) -> None:
    """The sample configuration has lowest = 10: it parked nowhere, and no program was told."""
    where, tracks, said = parked({"lowest": lowest})
    assert where == pytest.approx(altitude, abs=0.01)
    assert not tracks
    assert not any("Park" in line for line in said)


@pytest.mark.parametrize(("mount", "version"), [("nexstar-gps", "2.2"), ("cpc", "4.21"), ("6-8se", "4.21")])
async def test_fork_tracks_after_it_is_unparked(mount: str, version: str) -> None:
    """It stood at the lowest altitude to the last digit, and tracking was put off again at once."""
    async with Bridge(mount, version) as bridge:
        client = bridge.client()
        client.send(b":hP#")
        await at_rest(bridge, most=90.0)
        assert not truth_of(bridge.sim).tracking
        client.send(b":hW#")
        for _ in range(20):
            await client.ask(b":GR#")
            await asyncio.sleep(1.0)
        assert truth_of(bridge.sim).tracking, notes(bridge)


def test_configured_park_position_may_lie_beyond_the_limits() -> None:
    where, tracks, _ = parked({"lowest": 10.0, "highest": 80.0, "park": (90.0, 4.0)})
    assert where == pytest.approx(4.0, abs=0.01)
    assert not tracks
    where, _, _ = parked({"lowest": 10.0, "highest": 80.0, "park": (90.0, 85.0)})
    assert where == pytest.approx(85.0, abs=0.01)


def test_park_at_a_pole_below_the_limit_is_refused_with_what_to_do() -> None:
    where, _, said = parked({"lowest": 50.0}, "cge")
    assert where == pytest.approx(45.0, abs=0.1)
    assert any("Write park = [AZ, ALT]" in line for line in said)


async def test_refused_park_is_reported_as_failed() -> None:
    """``:hP#`` has no reply; ``:h?#`` is 1 at home or parked, 0 where that failed."""
    async with Bridge("cge", config={"lowest": 50.0}) as bridge:
        client = bridge.client()
        client.send(b":hS#")
        await asyncio.sleep(2.0)
        assert await client.ask(b":h?#") == b"1"
        client.send(b":hP#")
        await asyncio.sleep(2.0)
        assert await client.ask(b":h?#") == b"0"


@pytest.mark.parametrize("mount", ["autostar", "lx200gps"])
def test_meade_parks_at_its_default_position_only_where_no_limit_is_crossed(mount: str) -> None:
    """It parks at the horizon: with lowest = 10 the tube came to 0.00."""
    where, _, said = parked({"lowest": 10.0}, mount, "lx200")
    assert where > 10.0
    assert any('Write park = "mount"' in line for line in said)
    assert parked({"lowest": 10.0, "park": "mount"}, mount, "lx200")[0] == pytest.approx(0.0, abs=0.05)
    assert parked({}, mount, "lx200")[0] == pytest.approx(0.0, abs=0.05)


def test_park_setting_is_refused_where_the_mount_does_not_support_it() -> None:
    assert flags("--mount", "lx200@sim", "--park", "mount").mount[0].park == "mount"
    assert flags("--park", "3,4").mount[0].park == (3.0, 4.0)
    with pytest.raises(UserError, match="no park position"):
        flags("--park", "mount")
    with pytest.raises(UserError, match="set with its keypad"):
        flags("--mount", "lx200@sim", "--park", "3,4")
