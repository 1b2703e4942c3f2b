"""The five INDI LX200 drivers drive a NexStar mount through the gateway.

Each driver runs through TCP in the northern and through a pseudo terminal in the southern
hemisphere, over alt-azimuth and equatorial mounts; the simulated hand control is read beside it.
"""

from __future__ import annotations

import datetime
from dataclasses import dataclass

import pytest

from . import scenario
from .hand_control import HandControl
from .processes import Workshop, requires
from .product import Endpoint, start_gateway, start_simulator
from .sky import NORTH, SOUTH, Site, arcseconds, same_site, spot_at, target_up
from .telescope import Telescope

SPEED = 6.0
"""How much faster than life the simulated mount slews: quick, yet seen under way at four polls a second."""


@dataclass(frozen=True)
class Driver:
    """One INDI driver: what it is called, what the gateway presents to it, and what it can do."""

    program: str
    device: str
    model: str
    asks_end: bool = True
    """Asks `:D#` during a slew; LX200 Basic compares positions instead."""
    buttons: bool = True
    """Has arrow buttons, tracking modes, time and site."""
    unparks: bool = False

    def __str__(self) -> str:
        return self.program.removeprefix("indi_")


BASIC = Driver("indi_lx200basic", "LX200 Basic", "autostar", asks_end=False, buttons=False)
CLASSIC = Driver("indi_lx200classic", "LX200 Classic", "lx200", unparks=True)
AUTOSTAR = Driver("indi_lx200autostar", "LX200 Autostar", "autostar")
GPS = Driver("indi_lx200gps", "LX200 GPS", "lx200gps", unparks=True)
SIXTEEN = Driver("indi_lx200_16", "LX200 16", "lx200-16")

FORK, GERMAN = "nexstar:6-8se", "nexstar:cge"

EAST_OF_GREENWICH = Site(48.25, 11.5)
WEST_OF_GREENWICH = Site(-33.75, -70.75)

ARCMINUTE = 1.01
"""LX200 commands carry a site in whole minutes of arc."""
SESSION = 60.0
"""Seconds that a driver's clock may be behind: it was read when the driver connected."""


def connect(workshop: Workshop, driver: Driver, surface: Endpoint) -> Telescope:
    """One process of a driver on the gateway."""
    return Telescope(workshop, driver.program, driver.device, surface)


def check_buttons(telescope: Telescope, truth: HandControl, site: Site, equatorial: bool) -> None:
    """Each arrow moves the mount its own way, stops when released, and leaves the tracking as it was.

    On an alt-azimuth mount north and south are up and down, and west and east turn the azimuth.
    """
    mode = truth.tracking_mode()
    telescope.choose_rate("3x")
    north_south, west_east = scenario.axes(truth, equatorial)
    assert scenario.moves(telescope, truth, "NORTH", north_south) > 0
    assert scenario.moves(telescope, truth, "SOUTH", north_south) < 0
    west = scenario.moves(telescope, truth, "WEST", west_east)
    east = scenario.moves(telescope, truth, "EAST", west_east)
    if equatorial:
        assert west < 0 < east, (west, east)
    elif site.latitude > 0:
        assert east < 0 < west, (west, east)
    else:
        assert west * east < 0, (west, east)
    scenario.tracks_again(telescope, truth, mode)


def check_tracking(telescope: Telescope, truth: HandControl, equatorial: bool) -> None:
    """Every tracking rate keeps the mount tracking; land mode switches it off, the old mode on again."""
    mode = truth.tracking_mode()
    for rate in ("TRACK_SOLAR", "TRACK_LUNAR", "TRACK_SIDEREAL"):
        telescope.choose("TELESCOPE_TRACK_MODE", rate)
        scenario.tracks_again(telescope, truth, mode)
    own = "Polar" if equatorial else "AltAz"
    assert own in telescope.client.vectors["Alignment"].on()
    telescope.choose("Alignment", "Land")
    scenario.tracks_again(telescope, truth, 0)
    telescope.choose("Alignment", own)
    scenario.tracks_again(telescope, truth, mode)


def check_horizontal_goto(telescope: Telescope, truth: HandControl, site: Site, equatorial: bool) -> None:
    """LX200 16 can send the mount to an azimuth and an altitude: a fork by its axes, which no sync has moved.

    It takes the manual's "0: no fault" of `:MA#` for a refusal and shows no slew; the mount goes.
    """
    telescope.client.send("HORIZONTAL_COORD", {"ALT": "50", "AZ": "120"})

    def arrived() -> bool:
        if truth.goto_running():
            return False
        if not equatorial:
            azimuth, altitude = truth.horizontal()
            return abs(azimuth - 120.0) < 0.2 and abs(altitude - 50.0) < 0.2
        return arcseconds(truth.position(), spot_at(120.0, 50.0, site, truth.clock()[0])) < 600.0

    telescope.client.wait_for("arrival at azimuth 120°, altitude 50°", arrived)


def check_park(telescope: Telescope, truth: HandControl, driver: Driver) -> None:
    """Parking ends with tracking off.

    LX200 Classic follows an unpark with a sync to 0h, 0°: the mount must not believe it.
    """
    telescope.park()
    scenario.tracks_again(telescope, truth, 0)
    parked = scenario.wait_still(telescope, truth) if driver.unparks else truth.position()
    if driver.unparks:
        telescope.unpark()
        telescope.client.listen(1.0)
        assert arcseconds(truth.position(), parked) < 600.0, (parked, truth.position())


NIGHTS = [
    pytest.param(BASIC, FORK, NORTH, "tcp", id="basic-fork-north-tcp"),
    pytest.param(CLASSIC, GERMAN, NORTH, "tcp", id="classic-german-north-tcp"),
    pytest.param(AUTOSTAR, FORK, NORTH, "tcp", id="autostar-fork-north-tcp"),
    pytest.param(GPS, FORK, NORTH, "tcp", id="gps-fork-north-tcp"),
    pytest.param(SIXTEEN, GERMAN, NORTH, "tcp", id="16-german-north-tcp"),
    pytest.param(BASIC, GERMAN, SOUTH, "pty", id="basic-german-south-pty"),
    pytest.param(CLASSIC, FORK, SOUTH, "pty", id="classic-fork-south-pty"),
    pytest.param(AUTOSTAR, GERMAN, SOUTH, "pty", id="autostar-german-south-pty"),
    pytest.param(GPS, GERMAN, SOUTH, "pty", id="gps-german-south-pty"),
    pytest.param(SIXTEEN, FORK, SOUTH, "pty", id="16-fork-south-pty"),
]


@pytest.mark.sampled(every=2)
@pytest.mark.parametrize(("driver", "mount", "site", "transport"), NIGHTS)
def test_indi_lx200_completes_a_night_on_a_nexstar_mount(
    workshop: Workshop, driver: Driver, mount: str, site: Site, transport: str
) -> None:
    """Connect, read, goto, sync, move, track, abort, park: one session of one driver."""
    requires("indiserver", driver.program)
    equatorial = mount == GERMAN
    wire, truth = start_simulator(workshop, mount, site, speed=SPEED)
    surface = start_gateway(workshop, wire, driver.model, transport)
    telescope = connect(workshop, driver, surface)
    mode = truth.tracking_mode()
    scenario.shows_position(telescope, truth)
    scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, site), exact_end=driver.asks_end)
    scenario.syncs(telescope, truth)
    if driver.buttons:
        check_buttons(telescope, truth, site, equatorial)
        check_tracking(telescope, truth, equatorial)
    scenario.aborts(telescope, truth, target_up(truth.position(), 70.0, site))
    scenario.tracks_again(telescope, truth, mode)
    scenario.goes_to(telescope, truth, target_up(truth.position(), 30.0, site), exact_end=driver.asks_end)
    if driver is SIXTEEN:
        check_horizontal_goto(telescope, truth, site, equatorial)
    if driver.buttons:
        check_park(telescope, truth, driver)


def evening(hour: int) -> datetime.datetime:
    """A Universal Time unlike the simulator's own."""
    return datetime.datetime(2026, 3, 20, hour, 30, 0, tzinfo=datetime.UTC)


# At 23:30 UT and two hours ahead the local date is the next one.  The drivers for the LX200 GPS and
# the 16" send the date of Greenwich along with the local time, so they are tried when both agree.
@pytest.mark.parametrize(
    ("driver", "mount", "there", "moment", "offset"),
    [
        pytest.param(CLASSIC, FORK, EAST_OF_GREENWICH, evening(23), 2, id="classic"),
        pytest.param(AUTOSTAR, GERMAN, WEST_OF_GREENWICH, evening(2), -5, id="autostar"),
        pytest.param(GPS, GERMAN, EAST_OF_GREENWICH, evening(20), 2, id="gps"),
        pytest.param(SIXTEEN, FORK, WEST_OF_GREENWICH, evening(20), -5, id="16"),
    ],
)
def test_indi_lx200_time_and_site_reach_the_hand_control(
    workshop: Workshop, driver: Driver, mount: str, there: Site, moment: datetime.datetime, offset: int
) -> None:
    """Set by one driver process: in the hand control, and read back by a second driver process."""
    requires("indiserver", driver.program)
    wire, truth = start_simulator(workshop, mount, NORTH, aligned=False)
    assert not truth.aligned()
    surface = start_gateway(workshop, wire, driver.model, "tcp")
    first = connect(workshop, driver, surface)
    scenario.sets_site(first, truth, there, ARCMINUTE)
    expected = scenario.sets_clock(first, truth, moment, offset)
    first.end()
    second = connect(workshop, driver, surface)
    assert same_site(second.site(), there, ARCMINUTE), second.site()
    told, told_offset = second.clock()
    assert abs((told - expected()).total_seconds()) < SESSION, told
    assert told_offset == offset


def test_indi_lx200_site_does_not_reach_an_aligned_hand_control(workshop: Workshop) -> None:
    """An aligned mount would lose its pointing: the gateway keeps the new site for its clients."""
    requires("indiserver", AUTOSTAR.program)
    wire, truth = start_simulator(workshop, FORK, NORTH)
    surface = start_gateway(workshop, wire, AUTOSTAR.model, "tcp")
    before = truth.position()
    first = connect(workshop, AUTOSTAR, surface)
    first.set_site(WEST_OF_GREENWICH)
    first.set_clock(evening(20), -5)
    first.end()
    second = connect(workshop, AUTOSTAR, surface)
    assert same_site(second.site(), WEST_OF_GREENWICH, ARCMINUTE), second.site()
    assert abs((second.clock()[0] - evening(20)).total_seconds()) < SESSION
    assert same_site(truth.site(), NORTH, 0.0)
    assert arcseconds(truth.position(), before) < scenario.NEAR
