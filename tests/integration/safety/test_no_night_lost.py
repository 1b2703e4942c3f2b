"""No wrong source of site or time costs anybody a night: what is refused is refused without it, too."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.core.errors import Fault, NearSun
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge

DAY = 86400.0
#: A planned site where it is noon while it is night at 45 N 10 E.
FAR = (-20.0, -150.0)
SKY = [(float(azimuth), altitude) for azimuth in range(15, 360, 30) for altitude in (12.0, 35.0, 60.0)]


async def refused(bridge: Any) -> dict[tuple[float, float], Fault]:
    """Ask for gotos all over the sky, without beginning them -> those that are refused."""
    found: dict[tuple[float, float], Fault] = {}
    for place in SKY:
        there = bridge.controller.astrometry.equatorial_of(op.Horizontal(*place))
        try:
            await bridge.controller.admission.admit(op.Goto(there.ra, there.dec))
        except Fault as fault:
            found[place] = fault
    return found


def night(mount: str, driven: str, setting: op.Operation | None = None, **settings: Any) -> dict[Any, Fault]:
    found: list[dict[Any, Fault]] = []

    async def program() -> None:
        async with Bridge(mount, driven=driven, **settings) as bridge:
            if setting is not None:
                await bridge.controller.perform(setting)
                await asyncio.sleep(5.0)
            found.append(await refused(bridge))

    run(program())
    return found[0]


MOUNTS = [("cpc", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200")]


@pytest.mark.parametrize(("mount", "driven"), MOUNTS)
@pytest.mark.parametrize("ahead", [-20.5 * DAY, -7 * 3600.0, -2000 * DAY, 12 * 3600.0])
def test_computer_without_a_clock_battery_refuses_no_harmless_goto(mount: str, driven: str, ahead: float) -> None:
    doubtful = {"config": {"computer_clock": "doubtful"}, "host_ahead": ahead}
    assert night(mount, driven, **doubtful).keys() == night(mount, driven).keys()


@pytest.mark.parametrize("mount", ["cpc", "cge"])
@pytest.mark.parametrize(
    "setting", [op.SetSite(*FAR), op.SetClock(1768514400.0 + 40 * DAY, 0.0), op.SetSite(45.0, -10.0)]
)
def test_program_with_a_wrong_site_or_clock_causes_no_refused_goto(mount: str, setting: op.Operation) -> None:
    assert night(mount, "nexstar", setting).keys() == night(mount, "nexstar").keys()


def test_planned_site_in_the_configuration_causes_refusals_that_say_how_to_fix_it() -> None:
    """By it the Sun is up: its circle is closed, and every refusal says how to open it."""
    found, usual = night("cpc", "nexstar", config={"site": FAR}), night("cpc", "nexstar")
    lost = {place: fault for place, fault in found.items() if place not in usual}
    assert len(lost) <= len(SKY) // 3
    for fault in lost.values():
        assert isinstance(fault, NearSun)
        assert "the key site of the configuration" in str(fault)
