"""INDI's two SynScan drivers on a simulated SynScan, and through the gateway on mounts that are none.

And the other way round: INDI's LX200 driver drives a simulated SynScan. Both drivers were written for Sky-Watcher's own
hand control, so what they are content with is what such programs need.
"""

from __future__ import annotations

import datetime
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from . import scenario
from .processes import Workshop, requires
from .product import Endpoint, start_gateway, start_meade, start_simulator, start_synscan_gateway
from .sky import NORTH, SOUTH, Site, arcseconds, same_site, target_up
from .synscan import AsShown
from .telescope import Telescope

SPEED = 6.0
"""How much faster than life the simulated mount slews."""
SESSION = 60.0
"""Seconds that the driver's clock may be behind: it was read when the driver connected."""


@dataclass(frozen=True)
class Driver:
    program: str
    device: str

    def on(self, workshop: Workshop, surface: Endpoint) -> Telescope:
        return Telescope(workshop, self.program, self.device, surface)


NEW = Driver("indi_synscan_telescope", "SynScan")
LEGACY = Driver("indi_synscanlegacy_telescope", "SynScan Legacy")


@dataclass(frozen=True)
class Behind:
    """A mount behind the gateway; ``mode`` is its own reply to ``t`` while it tracks, None on a Meade."""

    mount: str
    mode: int | None
    equatorial: bool

    def __str__(self) -> str:
        return self.mount.replace(":", "-")


def start(workshop: Workshop, behind: Behind, site: Site) -> tuple[Endpoint, AsShown]:
    protocol, _, model = behind.mount.partition(":")
    if protocol == "lx200":
        wire, meade = start_meade(workshop, model, site, speed=3.0)
        return wire, AsShown(meade)
    wire, hand_control = start_simulator(workshop, behind.mount, site, speed=SPEED)
    return wire, AsShown(hand_control)


def tracks(truth: Any, mode: int | None) -> Callable[[bool], bool]:
    """Whether the mount tracks, by its own words."""
    if mode is None:
        return lambda on: bool(truth.status()[1] == ("T" if on else "N"))
    return lambda on: bool(truth.tracking_mode() == (mode if on else 0))


@pytest.mark.parametrize("mount", ["nexstar:synscan", "nexstar:synscan-az"])
def test_indi_synscan_accepts_the_simulated_hand_control(workshop: Workshop, mount: str) -> None:
    """The driver is content with the simulator, without the gateway."""
    requires("indiserver", NEW.program)
    wire, hand_control = start_simulator(workshop, mount, NORTH, speed=SPEED)
    truth = AsShown(hand_control)
    telescope = NEW.on(workshop, wire)
    scenario.shows_position(telescope, truth)
    scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, NORTH), exact_end=False)
    scenario.syncs(telescope, truth)
    scenario.opposite_arrows(telescope, truth, equatorial=mount.endswith("synscan"))
    scenario.aborts(telescope, truth, target_up(truth.position(), 70.0, NORTH))


MOUNTS = [
    pytest.param(Behind("nexstar:cge", 2, True), NORTH, id="cge-north"),
    pytest.param(Behind("nexstar:cge", 3, True), SOUTH, id="cge-south"),
    pytest.param(Behind("nexstar:6-8se", 1, False), NORTH, id="6-8se"),
    pytest.param(Behind("lx200:autostar", None, False), NORTH, id="autostar"),
    pytest.param(Behind("lx200:lx200gps", None, False), SOUTH, id="lx200gps"),
]


@pytest.mark.sampled(every=2)
@pytest.mark.parametrize(("behind", "site"), MOUNTS)
def test_indi_synscan_completes_a_night_through_the_gateway(workshop: Workshop, behind: Behind, site: Site) -> None:
    """Connect, read, goto, sync, arrows, track, park: one session, on a serial line."""
    requires("indiserver", NEW.program)
    wire, truth = start(workshop, behind, site)
    surface = start_synscan_gateway(workshop, wire, behind.mount.partition(":")[0], "pty")
    assert surface.speaks == ("nexstar:synscan" if behind.equatorial else "nexstar:synscan-az")
    telescope = NEW.on(workshop, surface)
    told = telescope.client.wait_for_vector("MOUNT_STATUS").values
    assert told["MI_FW_VERSION"].startswith("4.39"), told
    assert told["MI_MOUNT_MODEL"] == ("EQ6 GOTO Series" if behind.equatorial else "AZ GOTO Series"), told
    scenario.shows_position(telescope, truth)
    scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, site), exact_end=False)
    scenario.syncs(telescope, truth)
    scenario.opposite_arrows(telescope, truth, behind.equatorial)
    tracking, vectors = tracks(truth, behind.mode), telescope.client.vectors
    for shown, chosen, state in (("TRACK_ON", "TRACK_OFF", False), ("TRACK_OFF", "TRACK_ON", True)):
        # what the driver shows already it does not send, and after an arrow it shows tracking off for a moment
        telescope.client.wait_for(shown, lambda one=shown: vectors["TELESCOPE_TRACK_STATE"].values[one] == "On")  # type: ignore[misc]
        telescope.choose("TELESCOPE_TRACK_STATE", chosen)
        telescope.client.wait_for(f"tracking {state}", lambda state=state: tracking(state))  # type: ignore[misc]
    telescope.park()
    assert not truth.goto_running()
    telescope.client.wait_for("tracking off after park", lambda: tracking(False))
    telescope.unpark()
    telescope.client.wait_for("tracking on after unpark", lambda: tracking(True))


@pytest.mark.sampled(every=2)
@pytest.mark.parametrize(("behind", "site"), MOUNTS)
def test_indi_synscan_abort_stops_a_goto_and_tracking(workshop: Workshop, behind: Behind, site: Site) -> None:
    """The red button stops a goto, and tracking with it, as this driver has it.

    Over TCP: on a serial line the driver discards its own ``M`` if a poll follows before it was read (`tcflush`).
    """
    requires("indiserver", NEW.program)
    wire, truth = start(workshop, behind, site)
    telescope = NEW.on(workshop, start_synscan_gateway(workshop, wire, behind.mount.partition(":")[0], "tcp"))
    scenario.aborts(telescope, truth, target_up(truth.position(), 70.0, site))
    tracking = tracks(truth, behind.mode)
    telescope.client.wait_for("tracking off", lambda: tracking(False))


@pytest.mark.sampled(every=2)
@pytest.mark.parametrize(
    "behind",
    [Behind("nexstar:cge", 2, True), Behind("nexstar:cpc", 1, False), Behind("lx200:lx200gps", None, False)],
    ids=str,
)
def test_older_indi_synscan_driver_completes_a_night(workshop: Workshop, behind: Behind) -> None:
    """It reads version and model on a serial line alone; an alt-az mount it drives to its goal by the arrows."""
    requires("indiserver", LEGACY.program)
    wire, truth = start(workshop, behind, NORTH)
    telescope = LEGACY.on(workshop, start_synscan_gateway(workshop, wire, behind.mount.partition(":")[0], "pty"))
    # The driver defines the vector before it has read the hand control.
    told = telescope.client.wait_for_value("BASIC_MOUNT_INFO", "FW_VERSION").values
    assert told["FW_VERSION"].startswith("4.39"), told
    assert told["MOUNT_CODE"] == ("0" if behind.equatorial else "128"), told
    scenario.shows_position(telescope, truth)
    if behind.equatorial:
        scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, NORTH), exact_end=False)
        scenario.syncs(telescope, truth)
        scenario.aborts(telescope, truth, target_up(truth.position(), 70.0, NORTH))
    scenario.opposite_arrows(telescope, truth, behind.equatorial)


@pytest.mark.parametrize("behind", [Behind("nexstar:cge", 2, True), Behind("lx200:autostar", None, False)], ids=str)
def test_indi_synscan_reads_back_the_time_and_site_that_it_set(workshop: Workshop, behind: Behind) -> None:
    """Set by one process of the driver, read back by a second; the driver connects to aligned mounts only."""
    requires("indiserver", NEW.program)
    wire, _ = start(workshop, behind, NORTH)
    surface = start_synscan_gateway(workshop, wire, behind.mount.partition(":")[0], "tcp")
    there = Site(48.25, 115.75)  # this driver misreads degrees of longitude above 127
    first = NEW.on(workshop, surface)
    first.set_site(there)
    moment = datetime.datetime(2026, 3, 20, 20, 30, tzinfo=datetime.UTC)
    first.set_clock(moment, 8)
    first.client.listen(2.0)
    first.end()
    second = NEW.on(workshop, surface)
    assert same_site(second.site(), there, 1.01), second.site()
    told, offset = second.clock()
    assert abs((told - moment).total_seconds()) < SESSION, told
    assert offset == 8


@pytest.mark.sampled(every=2)
@pytest.mark.parametrize(
    ("mount", "site", "mode"),
    [
        pytest.param("nexstar:synscan/3.36", NORTH, 2, id="german-north"),
        pytest.param("nexstar:synscan", SOUTH, 2, id="german-south"),
        pytest.param("nexstar:synscan-az", NORTH, 1, id="alt-az"),
    ],
)
def test_indi_lx200_completes_a_night_on_a_synscan(workshop: Workshop, mount: str, site: Site, mode: int) -> None:
    """Goto, sync, arrows, abort: the coordinates of an LX200 are of date, those of the mount of J2000."""
    requires("indiserver", "indi_lx200autostar")
    wire, truth = start_simulator(workshop, mount, site, speed=SPEED)
    surface = start_gateway(workshop, wire, "autostar", "tcp")
    telescope = Telescope(workshop, "indi_lx200autostar", "LX200 Autostar", surface)
    scenario.shows_position(telescope, truth)
    scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, site), exact_end=True)
    if not mount.endswith("/3.36"):  # it has no sync; the gateway keeps an offset
        scenario.syncs(telescope, truth)
    telescope.choose_rate("3x")
    north_south, west_east = scenario.axes(truth, mode == 2)
    assert scenario.moves(telescope, truth, "NORTH", north_south) > 0
    assert scenario.moves(telescope, truth, "SOUTH", north_south) < 0
    west = scenario.moves(telescope, truth, "WEST", west_east)
    assert west * scenario.moves(telescope, truth, "EAST", west_east) < 0
    assert mode == 1 or west < 0
    scenario.tracks_again(telescope, truth, mode)
    there = target_up(truth.position(), 70.0, site)
    scenario.aborts(telescope, truth, there)
    telescope.client.listen(3.0)  # an old one would go on now
    assert not truth.goto_running()
    assert arcseconds(truth.position(), there) > 3600.0
