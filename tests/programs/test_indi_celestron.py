"""INDI's Celestron driver on the simulated hand control itself, without the gateway.

It is the most demanding NexStar program there is; when it is content with the simulator, the other
tests may take the simulator's word for what a NexStar mount does.
"""

from __future__ import annotations

import datetime

import pytest

from . import scenario
from .hand_control import HandControl
from .processes import Workshop, requires
from .product import Endpoint, start_simulator
from .sky import NORTH, SOUTH, Site, same_site, target_up
from .telescope import Telescope

DRIVER, DEVICE = "indi_celestron_gps", "Celestron GPS"
SPEED = 6.0
"""How much faster than life the simulated mount slews."""
ARCSECOND = 1.01 / 60
"""NexStar commands carry a site in whole seconds of arc."""
SESSION = 60.0
"""Seconds that the driver's clock may be behind: it was read when the driver connected."""


def connect(workshop: Workshop, mount: Endpoint) -> Telescope:
    """One process of the driver on the simulator."""
    return Telescope(workshop, DRIVER, DEVICE, mount)


def check_park(telescope: Telescope, truth: HandControl, mode: int) -> None:
    """Park ends with tracking off; after unpark the mount can be told to track again."""
    telescope.park()
    assert truth.tracking_mode() == 0
    assert not truth.goto_running()
    telescope.unpark()
    telescope.choose("TELESCOPE_TRACK_STATE", "TRACK_ON")
    scenario.tracks_again(telescope, truth, mode)


@pytest.mark.parametrize(
    ("mount", "site", "mode", "info"),
    [
        pytest.param("nexstar:6-8se", NORTH, 1, ("6/8 SE", "4.21", "Fork"), id="fork-north"),
        pytest.param("nexstar:cge", NORTH, 2, ("CGE", "4.21", "GEM"), id="german-north"),
        pytest.param("nexstar:cge", SOUTH, 3, ("CGE", "4.21", "GEM"), id="german-south"),
        pytest.param("nexstar:avx/starsense", NORTH, 2, ("AVX", "1.20", "GEM"), id="starsense"),
    ],
)
def test_indi_celestron_completes_a_night_on_the_simulated_hand_control(
    workshop: Workshop, mount: str, site: Site, mode: int, info: tuple[str, str, str]
) -> None:
    """Connect, read, goto, sync, move, track, abort, park: one session."""
    requires("indiserver", DRIVER)
    wire, truth = start_simulator(workshop, mount, site, speed=SPEED)
    telescope = connect(workshop, wire)
    firmware = telescope.client.wait_for_vector("Firmware Info").values
    assert (firmware["Model"], firmware["HC Version"], firmware["Mount Type"]) == info
    assert float(firmware["Ra Version"]) > 1.0 and float(firmware["Dec Version"]) > 1.0, firmware
    assert truth.tracking_mode() == mode
    scenario.shows_position(telescope, truth)
    scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, site), exact_end=False)
    scenario.syncs(telescope, truth)
    scenario.opposite_arrows(telescope, truth, equatorial=mode != 1)
    for state, expected in (("TRACK_OFF", 0), ("TRACK_ON", mode)):
        telescope.choose("TELESCOPE_TRACK_STATE", state)
        scenario.tracks_again(telescope, truth, expected)
    scenario.aborts(telescope, truth, target_up(truth.position(), 70.0, site))
    scenario.goes_to(telescope, truth, target_up(truth.position(), 30.0, site), exact_end=False)
    check_park(telescope, truth, mode)


def test_indi_celestron_reads_back_the_time_and_site_that_it_set(workshop: Workshop) -> None:
    """Set by one driver process on a hand control that is not aligned, read back by a second."""
    requires("indiserver", DRIVER)
    wire, truth = start_simulator(workshop, "nexstar:6-8se", NORTH, aligned=False)
    assert not truth.aligned()
    there = Site(-33.75, 115.75)  # this driver misreads degrees of longitude above 127
    first = connect(workshop, wire)
    scenario.sets_site(first, truth, there, ARCSECOND)
    moment = datetime.datetime(2026, 3, 20, 20, 30, tzinfo=datetime.UTC)
    expected = scenario.sets_clock(first, truth, moment, 8)
    assert truth.clock()[1] == 8
    first.end()
    second = connect(workshop, wire)
    assert same_site(second.site(), there, ARCSECOND), second.site()
    told, told_offset = second.clock()
    assert abs((told - expected()).total_seconds()) < SESSION, told
    assert told_offset == 8
