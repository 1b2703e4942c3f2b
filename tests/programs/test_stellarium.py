"""Debian's Stellarium, with the gateway as its telescope: *External software or a remote computer*."""

from __future__ import annotations

import pytest

from .processes import Workshop, requires, wait_until
from .product import start_meade, start_simulator, start_stellarium_gateway
from .sky import NORTH, Spot, arcseconds
from .stellarium import Planetarium

#: Aldebaran, J2000, at the epoch of the night.
STAR = Spot(68.9838, 16.5079)
NEAR = 30.0
"""Seconds of arc by which the marker may be off."""


@pytest.mark.parametrize("mount", ["nexstar", "lx200"])
def test_the_marker_is_where_the_mount_is(workshop: Workshop, mount: str) -> None:
    """Before the slew, and after Ctrl+1: on the star, whose place of date is 20 minutes of arc away."""
    requires("stellarium", "Xvfb", "xdotool")
    if mount == "nexstar":
        wire, truth = start_simulator(workshop, "nexstar:6-8se", NORTH, speed=4.0)
    else:
        wire, truth = start_meade(workshop, "lx200gps", NORTH, speed=4.0)
    surface = start_stellarium_gateway(workshop, wire, mount)
    planetarium = Planetarium(workshop, surface.port, "Aldebaran", NORTH)
    first = planetarium.marker()
    assert first is not None and 300.0 < arcseconds(first, truth.position()) < 2400.0, (
        "it is in J2000, the mount is not"
    )
    planetarium.slew()
    wait_until("the slew", truth.goto_running, 10.0)
    wait_until("arrival", lambda: not truth.goto_running(), 120.0)

    def there() -> bool:
        marker = planetarium.marker()
        return marker is not None and arcseconds(marker, STAR) < NEAR

    wait_until("the marker is on the star", there, 20.0)
