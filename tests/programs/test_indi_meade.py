"""INDI's LX200 drivers on the simulated Meades themselves, without the gateway.

Each driver was written for one of the four telescopes; when it is content with the simulator, the
other tests may take the simulator's word for what a Meade does.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from . import scenario
from .meade import Meade
from .processes import Workshop, requires
from .product import start_meade
from .sky import NORTH, same_site, target_up
from .telescope import Telescope

ARCMINUTE = 1.01
"""LX200 commands carry a site in whole minutes of arc."""


def axes(truth: Meade, polar: bool) -> tuple[Callable[[], float], Callable[[], float]]:
    """What west and north increase in the northern hemisphere, in degrees.

    Against right ascension and along declination; along azimuth and altitude on a telescope without a wedge.
    """
    if polar:
        return (lambda: -truth.position().ra), (lambda: truth.position().dec)
    return (lambda: truth.horizontal()[0]), (lambda: truth.horizontal()[1])


def check_buttons(telescope: Telescope, truth: Meade, polar: bool) -> None:
    """Each arrow moves the mount its own way and stops when it is released."""
    telescope.choose_rate("3x")
    west, north = axes(truth, polar)
    assert scenario.moves(telescope, truth, "NORTH", north) > 0
    assert scenario.moves(telescope, truth, "SOUTH", north) < 0
    assert scenario.moves(telescope, truth, "WEST", west) > 0
    assert scenario.moves(telescope, truth, "EAST", west) < 0


@pytest.mark.parametrize(
    ("driver", "device", "model", "speed"),
    [
        pytest.param("indi_lx200classic", "LX200 Classic", "lx200", 3.0, id="lx200"),
        pytest.param("indi_lx200autostar", "LX200 Autostar", "autostar", 3.0, id="autostar"),
        pytest.param("indi_lx200gps", "LX200 GPS", "lx200gps", 3.0, id="lx200gps"),
        pytest.param("indi_lx200_16", "LX200 16", "lx200-16", 6.0, id="lx200-16"),
    ],
)
def test_indi_lx200_completes_a_night_on_the_simulated_meade(
    workshop: Workshop, driver: str, device: str, model: str, speed: float
) -> None:
    """Connect, read, goto, sync, move, abort: one session of a driver with its own telescope."""
    requires("indiserver", driver)
    wire, truth = start_meade(workshop, model, NORTH, speed=speed, tolerant=True)
    polar = truth.mode() == "P"
    telescope = Telescope(workshop, driver, device, wire)
    assert same_site(telescope.site(), NORTH, ARCMINUTE), telescope.site()
    telescope.client.wait_for("the first poll", lambda: any(telescope.shown()))
    scenario.shows_position(telescope, truth)
    scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, NORTH), exact_end=True)
    scenario.syncs(telescope, truth)
    check_buttons(telescope, truth, polar)
    scenario.aborts(telescope, truth, target_up(truth.position(), 70.0, NORTH))
