"""ASCOM's judge on six mounts: every check is ok, but for the issues that are listed here with their reasons."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from gateway.diagnostics.rehearsal.stage import RehearsalGateway
from tests.conformance.ascom.methods import METHODS
from tests.conformance.ascom.properties import CONNECTING, PROPERTIES, disconnect
from tests.conformance.ascom.telescope import Ascom, Issue, Skipped, Telescope
from tests.support import exact_sky

START = 1769634000.0
MOST = 2


class Mount(NamedTuple):
    """A simulated mount, its latitude, what its owner tells it before, and the issues that remain with their reason."""

    model: str
    driven: str
    latitude: float
    told: bytes
    issues: dict[str, str]


COARSE = (
    "these motors count quarters of an arcsecond a second, and both turn in every direction: over 5 s that is up to "
    "0.6 arcseconds an axis, of right ascension near the pole ten times as much"
)
ALTAZ = {"PulseGuide north and south": COARSE, "PulseGuide east and west": COARSE}
CLASSIC = {
    "A slew right after UTCDate": "a classic calculates its planets for seconds after each date, and takes no order",
    "Answers in time": "the same: its answer to a new date takes seconds, and the goto waits before it is refused",
}
MOUNTS = {
    "CPC": Mount("cpc", "nexstar", 45.0, b"", ALTAZ),
    "CGEM north": Mount("cgem", "nexstar", 45.0, b"", {}),
    "CGEM south": Mount("cgem", "nexstar", -34.0, b"", {}),
    "GT": Mount("gt", "nexstar", 45.0, b"", ALTAZ),
    "LX200GPS polar": Mount("lx200gps", "lx200", 45.0, b":AP#", {}),
    "LX200 classic": Mount("lx200", "lx200", 45.0, b"", CLASSIC),
}
CHECKS = {**CONNECTING, **PROPERTIES, **METHODS, "Disconnect": disconnect}


async def judged(mount: Mount) -> dict[str, str]:
    """Return what was wrong with each check that applies to the mount, empty if nothing."""
    found: dict[str, str] = {}
    async with RehearsalGateway(
        mount.model, start=START, driven=mount.driven, presented="alpaca", site=(mount.latitude, 10.0), named=True,
        config={"sun": 0.0},
    ) as own:  # fmt: skip
        own.sim.feed(mount.told)
        exact_sky.load(own.controller.astrometry.sky)
        scope = Telescope(own)
        for name, check in CHECKS.items():
            try:
                await check(scope)
                found[name] = ""
            except (Issue, Ascom) as error:
                found[name] = str(error)
            except Skipped:
                pass
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", MOUNTS)
async def test_ascom_conformance_check_finds_exactly_the_listed_issues(name: str) -> None:
    mount = MOUNTS[name]
    found = await judged(mount)
    issues = {check: words for check, words in found.items() if words}
    assert issues.keys() == mount.issues.keys(), issues
    assert len(issues) <= MOST
    assert len(found) > len(CHECKS) / 2
