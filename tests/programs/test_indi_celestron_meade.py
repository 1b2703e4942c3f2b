"""INDI's Celestron driver drives the four Meades through the gateway.

Each model stands in the northern hemisphere behind TCP and in the southern behind a pseudo
terminal; the simulated Meade is read beside it.  Arrows are judged by motor sense, for that is what
a NexStar client commands: this driver's "north" turns the second motor forwards on a German mount
that is east of its pier as the driver sees it, and backwards on every other, forks on a wedge too.
"""

from __future__ import annotations

import datetime
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import pytest

from . import scenario
from .meade import Meade
from .processes import Workshop, requires
from .product import Endpoint, start_celestron_gateway, start_meade
from .sky import NORTH, SOUTH, Site, same_site, target_up
from .telescope import Telescope

DRIVER, DEVICE = "indi_celestron_gps", "Celestron GPS"
ARCMINUTE = 1.01
"""LX200 commands carry a site in whole minutes of arc."""
SESSION = 60.0
"""Seconds that a driver's clock may be behind: it was read when the driver connected."""
STEP = 15.0
"""Seconds of arc in a second of time, the finest right ascension that a Meade tells; also its guide rate."""
LISTEN = 3.0
"""Seconds in which the sky passes a mount that does not track by three steps."""


@dataclass(frozen=True)
class Model:
    """One Meade, what the gateway presents over it, and what a client then sees."""

    name: str
    presented: str
    information: str
    build: str
    polar: bool = False
    speed: float = 3.0
    """How much faster than life the simulated mount slews: quick, yet seen under way at four polls a second."""
    tells_status: bool = True
    """Answers `:GW#`; on the others tracking cannot be switched off without losing the alignment."""

    def __str__(self) -> str:
        return self.name


AUTOSTAR = Model("autostar", "nexstar:6-8se", "6/8 SE", "Fork")
LX200GPS = Model("lx200gps", "nexstar:6-8se", "6/8 SE", "Fork")
LX200 = Model("lx200", "nexstar:cpc", "CPC", "Fork", polar=True, tells_status=False)
LX200_16 = Model("lx200-16", "nexstar:cpc", "CPC", "Fork", polar=True, speed=6.0, tells_status=False)
MODELS = (AUTOSTAR, LX200GPS, LX200, LX200_16)


def connect(workshop: Workshop, model: Model, meade: Endpoint, transport: str) -> Telescope:
    """A gateway over the Meade, and one process of the driver on it."""
    surface = start_celestron_gateway(workshop, meade, transport)
    assert surface.speaks == model.presented, surface
    return Telescope(workshop, DRIVER, DEVICE, surface)


def check_information(telescope: Telescope, model: Model) -> None:
    """The driver believes that it speaks to the hand control that is presented."""
    told = telescope.client.wait_for_vector("Firmware Info").values
    expected = (model.information, "4.21", model.build)
    assert (told["Model"], told["HC Version"], told["Mount Type"]) == expected, told


def axes(truth: Meade, model: Model, site: Site) -> tuple[Callable[[], float], Callable[[], float]]:
    """What a positive turn of the first and of the second motor increases, in degrees.

    On a polar mount the first motor's positive sense is west in the north and east in the south, the second motor's is
    towards the pole that is up.
    """
    if not model.polar:
        return (lambda: truth.horizontal()[0]), (lambda: truth.horizontal()[1])
    east = 1.0 if site.latitude < 0 else -1.0
    return (lambda: east * truth.position().ra), (lambda: -east * truth.position().dec)


def check_buttons(telescope: Telescope, truth: Meade, model: Model, site: Site) -> None:
    """Each arrow turns its motor the way the driver asked for, and stops when it is released.

    A Meade is a fork: its north and south buttons are reversed in this driver, as on every fork.
    """
    telescope.choose_rate("7x")
    first, second = axes(truth, model, site)
    assert scenario.moves(telescope, truth, "SOUTH", second) > 0
    assert scenario.moves(telescope, truth, "NORTH", second) < 0
    assert scenario.moves(telescope, truth, "WEST", first) > 0
    assert scenario.moves(telescope, truth, "EAST", first) < 0


def check_guiding(telescope: Telescope, truth: Meade) -> None:
    """A pulse on both axes moves the mount a little, and the opposite ones move it back.

    The driver guides equatorial mounts only.
    """
    shifts = []
    for directions in ("NW", "SE"):
        start = scenario.wait_still(telescope, truth)
        mark = len(telescope.client.history)
        for axis, direction in zip(("NS", "WE"), directions, strict=True):
            telescope.client.send(f"TELESCOPE_TIMED_GUIDE_{axis}", {f"TIMED_GUIDE_{direction}": "2000"})
        for axis in ("NS", "WE"):
            telescope.client.wait_for(f"end of guiding {axis}", partial(ended, telescope, mark, axis))
        here = scenario.wait_still(telescope, truth)
        shifts.append((here.ra - start.ra, here.dec - start.dec))
    for there, back in zip(*shifts, strict=True):
        assert there * back < 0, shifts
        assert all(STEP / 2 < abs(shift) * 3600.0 < 10 * STEP for shift in (there, back)), shifts


def ended(telescope: Telescope, mark: int, axis: str) -> bool:
    """Whether a guide pulse is over: the driver showed it under way and then shows it no longer."""
    states = [vector.state for vector in telescope.client.since(mark, f"TELESCOPE_TIMED_GUIDE_{axis}")]
    return "Busy" in states and states[-1] != "Busy"


def tracking_is(truth: Meade, letter: str) -> bool:
    """Whether `:GW#` tells T, tracking, or N, not tracking."""
    return truth.status()[1] == letter


def check_tracking(telescope: Telescope, truth: Meade, model: Model) -> None:
    """Off and on again where the mount can; elsewhere it keeps tracking, its alignment untouched."""
    for state, expected in (("TRACK_OFF", "N"), ("TRACK_ON", "T")):
        telescope.choose("TELESCOPE_TRACK_STATE", state)
        if model.tells_status:
            telescope.client.wait_for(f"tracking {expected}", partial(tracking_is, truth, expected))
        elif state == "TRACK_OFF":
            before = truth.position().ra
            telescope.client.listen(LISTEN)
            assert abs(truth.position().ra - before) * 3600.0 < 1.5 * STEP
            assert truth.mode() == "P"


def check_park(telescope: Telescope, truth: Meade, model: Model) -> None:
    """Park ends a goto at its place with tracking off where that can be; after unpark the mount tracks again."""
    telescope.park()
    assert not truth.goto_running()
    if model.tells_status:
        telescope.client.wait_for("tracking off", partial(tracking_is, truth, "N"))
    telescope.unpark()
    telescope.choose("TELESCOPE_TRACK_STATE", "TRACK_ON")
    if model.tells_status:
        telescope.client.wait_for("tracking on", partial(tracking_is, truth, "T"))
    assert truth.mode() == ("P" if model.polar else "A")


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("site", "transport"), [pytest.param(NORTH, "tcp", id="north-tcp"), pytest.param(SOUTH, "pty", id="south-pty")]
)
@pytest.mark.parametrize("model", MODELS, ids=str)
def test_indi_celestron_completes_a_night_on_a_meade(
    workshop: Workshop, model: Model, site: Site, transport: str
) -> None:
    """Connect, read, goto, sync, move, guide, track, abort, park: one session."""
    requires("indiserver", DRIVER)
    meade, truth = start_meade(workshop, model.name, site, speed=model.speed)
    telescope = connect(workshop, model, meade, transport)
    check_information(telescope, model)
    scenario.shows_position(telescope, truth)
    scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, site), exact_end=True)
    scenario.syncs(telescope, truth)
    check_buttons(telescope, truth, model, site)
    if model.polar:
        check_guiding(telescope, truth)
    check_tracking(telescope, truth, model)
    scenario.aborts(telescope, truth, target_up(truth.position(), 70.0, site))
    check_park(telescope, truth, model)


@pytest.mark.parametrize(("presented", "north"), [("cpc", -1.0), ("cge", 1.0)])
def test_indi_celestron_north_arrow_obeys_the_documented_setting(
    workshop: Workshop, presented: str, north: float
) -> None:
    """Reversed on a fork, unless its *Reverse* is set, and as it is written where a German mount is presented."""
    requires("indiserver", DRIVER)
    meade, truth = start_meade(workshop, "lx200", NORTH, speed=3.0)
    surface = start_celestron_gateway(workshop, meade, "tcp", "" if presented == "cpc" else presented)
    assert surface.speaks == f"nexstar:{presented}", surface
    telescope = Telescope(workshop, DRIVER, DEVICE, surface)
    scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, NORTH), exact_end=True)
    telescope.choose_rate("7x")
    assert scenario.moves(telescope, truth, "NORTH", lambda: truth.position().dec) * north > 0
    assert scenario.moves(telescope, truth, "SOUTH", lambda: truth.position().dec) * north < 0
    telescope.client.switch("TELESCOPE_REVERSE_MOTION", "REVERSE_NS")
    assert scenario.moves(telescope, truth, "NORTH", lambda: truth.position().dec) * north < 0


def test_indi_celestron_accepts_a_presented_starsense(workshop: Workshop) -> None:
    """Its version is below what the driver asks of others for park, time and sync, and all of these are there."""
    requires("indiserver", DRIVER)
    meade, truth = start_meade(workshop, "lx200gps", NORTH, speed=3.0)
    telescope = Telescope(workshop, DRIVER, DEVICE, start_celestron_gateway(workshop, meade, "tcp", "starsense"))
    told = telescope.client.wait_for_vector("Firmware Info").values
    assert (told["Model"], told["HC Version"], told["Mount Type"]) == ("6/8 SE", "1.20", "Fork"), told
    scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, NORTH), exact_end=True)
    scenario.syncs(telescope, truth)
    check_park(telescope, truth, LX200GPS)


@pytest.mark.parametrize("model", [AUTOSTAR, LX200GPS], ids=str)
def test_indi_celestron_reads_back_the_time_and_site_that_it_set(workshop: Workshop, model: Model) -> None:
    """Set on a Meade that is not aligned, read back by a second process of the driver."""
    requires("indiserver", DRIVER)
    meade, truth = start_meade(workshop, model.name, NORTH, aligned=False)
    surface = start_celestron_gateway(workshop, meade, "tcp")
    there = Site(-33.75, 115.75)  # this driver misreads degrees of longitude above 127
    first = Telescope(workshop, DRIVER, DEVICE, surface)
    scenario.sets_site(first, truth, there, ARCMINUTE)
    moment = datetime.datetime(2026, 3, 20, 20, 30, tzinfo=datetime.UTC)
    expected = scenario.sets_clock(first, truth, moment, 8)
    assert truth.clock()[1] == 8
    first.end()
    second = Telescope(workshop, DRIVER, DEVICE, surface)
    assert same_site(second.site(), there, ARCMINUTE), second.site()
    told, told_offset = second.clock()
    assert abs((told - expected()).total_seconds()) < SESSION, told
    assert told_offset == 8


def test_indi_celestron_takes_a_classic_for_aligned(workshop: Workshop) -> None:
    """A Meade that cannot tell counts as aligned, and this driver then sends neither time nor site."""
    requires("indiserver", DRIVER)
    meade, truth = start_meade(workshop, "lx200", NORTH, aligned=False)
    telescope = connect(workshop, LX200, meade, "tcp")
    telescope.client.set("GEOGRAPHIC_COORD", {"LAT": "-33.75", "LONG": "115.75", "ELEV": "0"}, ("Ok", "Alert", "Idle"))
    telescope.client.wait_for("refusal", lambda: any("aligned" in told for told in telescope.client.messages))
    assert same_site(truth.site(), NORTH, 0.0)
