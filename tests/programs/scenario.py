"""What a night with an INDI mount consists of, each step proved by the mount itself.

Every step takes the driver (`Telescope`) and the truth (a `HandControl` or a `Meade`) and compares the two.
"""

from __future__ import annotations

import datetime
import time
from collections.abc import Callable
from typing import Protocol

from .hand_control import HandControl
from .sky import Site, Spot, arcseconds, rounded, same_site, separation
from .telescope import Telescope, spot_of

NEAR = 30.0
"""Seconds of arc by which an arrival, a reading or a sync may be off."""
CLOCK = 20.0
"""Seconds by which a clock may be behind: each on the way tells whole seconds, and a loaded computer sets it late."""
STILL = 5.0
"""Seconds of arc that a standing mount may seem to move between two looks a quarter of a second apart."""


class Truth(Protocol):
    """A mount that is asked past the gateway."""

    def position(self) -> Spot:
        """Right ascension and declination."""

    def goto_running(self) -> bool:
        """Whether a goto is under way."""

    def site(self) -> Site:
        """Where it stands."""

    def clock(self) -> tuple[datetime.datetime, int]:
        """Universal Time, and the hours that local time is ahead of it."""


def shows_position(telescope: Telescope, truth: Truth) -> None:
    """The driver shows what the mount has, within a few of its polls."""

    def agrees() -> bool:
        return arcseconds(telescope.shown(), truth.position()) < NEAR

    telescope.client.wait_for("the mount's position at the driver", agrees)


def wait_still(telescope: Telescope, truth: Truth) -> Spot:
    """Wait until no goto runs and two looks agree; where the mount then stands."""

    def stands() -> bool:
        before = truth.position()
        telescope.client.listen(0.25)
        return not truth.goto_running() and arcseconds(before, truth.position()) < STILL

    telescope.client.wait_for("the mount stands still", stands)
    return truth.position()


def goes_to(telescope: Telescope, truth: Truth, target: Spot, *, exact_end: bool) -> None:
    """A goto arrives, and the driver sees it travel.

    `exact_end`: the driver asks the mount whether it has arrived (`:D#`, `L`) instead of comparing
    positions; then the slew has to be over, and at the target, in the very poll that ends it.
    """
    start = truth.position()
    shown = telescope.goto(target)
    ended_during_goto = truth.goto_running()
    if exact_end:
        assert not ended_during_goto, "the driver was told that the slew is over while it was not"
        assert arcseconds(spot_of(shown[-1]), target) < NEAR, shown[-3:]
    assert shown[-1].state != "Alert", telescope.client.messages[-3:]
    telescope.client.wait_for("arrival", lambda: arcseconds(truth.position(), target) < NEAR)
    wait_still(telescope, truth)
    assert arcseconds(truth.position(), target) < NEAR, (truth.position(), target)
    shows_position(telescope, truth)
    assert arcseconds(telescope.shown(), target) < NEAR, (telescope.shown(), target)
    under_way = {spot_of(vector) for vector in shown if vector.state == "Busy"}
    between = {spot for spot in under_way if min(separation(spot, start), separation(spot, target)) > 0.05}
    assert between, f"seen during the slew: {sorted(under_way)}"


def syncs(telescope: Telescope, truth: Truth) -> None:
    """A sync half a degree away becomes the mount's own position, once the gateway, too, has seen it at rest."""
    telescope.client.listen(1.0)
    here = truth.position()
    there = rounded(Spot(here.ra + 0.5, here.dec - 0.25))
    telescope.sync(there)
    telescope.client.wait_for("sync in the mount", lambda: arcseconds(truth.position(), there) < NEAR)
    shows_position(telescope, truth)


def axes(truth: HandControl, equatorial: bool) -> tuple[Callable[[], float], Callable[[], float]]:
    """How to read, in degrees, what north and south change, and what west and east change.

    Declination and right ascension of an equatorial mount; altitude and azimuth of another.
    """
    if equatorial:
        return (lambda: truth.position().dec), (lambda: truth.position().ra)
    return (lambda: truth.horizontal()[1]), (lambda: truth.horizontal()[0])


def moves(telescope: Telescope, truth: Truth, direction: str, read: Callable[[], float]) -> float:
    """An arrow button moves the mount until it is released. By how much `read` changed: signed degrees."""
    before, start = read(), truth.position()
    telescope.press(direction)
    telescope.client.wait_for(f"moving {direction}", lambda: separation(truth.position(), start) > 0.1)
    telescope.release(direction)
    wait_still(telescope, truth)
    return (read() - before + 180.0) % 360.0 - 180.0


def opposite_arrows(telescope: Telescope, truth: Truth, equatorial: bool) -> None:
    """Each arrow moves the mount, and the two arrows of an axis move it opposite ways.

    Which way is north depends on the driver, and in some on the pier side, so only the opposition is judged.
    """
    telescope.choose_rate("7x")
    north_south, west_east = axes(truth, equatorial)
    for one, other, read in (("NORTH", "SOUTH", north_south), ("WEST", "EAST", west_east)):
        there = moves(telescope, truth, one, read)
        back = moves(telescope, truth, other, read)
        assert there * back < 0, (one, there, other, back)


def tracks_again(telescope: Telescope, truth: HandControl, mode: int) -> None:
    """The hand control tracks in this mode, at the latest a moment after what was done to it."""
    telescope.client.wait_for(f"tracking mode {mode}", lambda: truth.tracking_mode() == mode)


def aborts(telescope: Telescope, truth: Truth, target: Spot) -> None:
    """The red button stops a goto far from its target."""
    start = truth.position()
    telescope.start_goto(target)
    telescope.client.wait_for("under way", lambda: separation(truth.position(), start) > 2.0)
    telescope.abort()
    telescope.client.wait_for("goto over", lambda: not truth.goto_running())
    stopped = wait_still(telescope, truth)
    assert separation(stopped, target) > 2.0, "the goto went on to its end"


def sets_site(telescope: Telescope, truth: Truth, site: Site, arcminutes: float) -> None:
    """A site told to the driver stands in the mount."""
    telescope.set_site(site)
    telescope.client.wait_for("site in the mount", lambda: same_site(truth.site(), site, arcminutes))


def sets_clock(
    telescope: Telescope, truth: Truth, moment: datetime.datetime, offset: int
) -> Callable[[], datetime.datetime]:
    """A Universal Time told to the driver runs in the mount; what it has to be from now on."""
    begin = time.monotonic()
    telescope.set_clock(moment, offset)

    def expected() -> datetime.datetime:
        return moment + datetime.timedelta(seconds=time.monotonic() - begin)

    def agrees() -> bool:
        return abs((truth.clock()[0] - expected()).total_seconds()) < CLOCK

    telescope.client.wait_for("Universal Time in the mount", agrees)
    return expected
