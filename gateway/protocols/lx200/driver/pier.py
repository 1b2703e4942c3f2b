"""The side of the pier of a Meade that says ``G``, a German mount: no Meade tells it, so it follows the hour angle.

Such a mount chooses its side with every goto by the hour angle of the goal, and keeps it while it tracks on past the
meridian. Before the first goto the place where it is found counts as one. The letters are those of a German hand
control up to 5.24: W where the second motor's axis reads beyond the pole.
"""

from __future__ import annotations

from gateway.astro.spherical import SIDEREAL_ARCSECONDS, wrap180
from gateway.core.errors import Unsupported
from gateway.core.operations import PierSide
from gateway.protocols.base.driver import Steps
from gateway.protocols.lx200.driver.state import Lx200Driver, ask, ask_once


def chooses_side(mount: Lx200Driver, ra: float) -> None:
    """A goto to this right ascension was begun."""
    mount.side_by, mount.beyond_pole = (ra, mount.now()), None


def beyond_pole(mount: Lx200Driver) -> Steps:
    """-> whether the second axis is turned over the pole; by :GS and the last goto, or by :GR. False for a fork."""
    if not mount.german:
        return False
    if mount.beyond_pole is None:
        if mount.side_by is None:
            chooses_side(mount, (yield from ask(mount, "GR"))["ra"])
        sidereal = (yield from ask_once(mount, "GS"))["sidereal"]
        assert mount.side_by is not None
        ra, then = mount.side_by
        hour_angle = wrap180(sidereal - (mount.now() - then) * SIDEREAL_ARCSECONDS / 3600.0 - ra)
        mount.beyond_pole = (hour_angle > 0.0) if mount.southern else (hour_angle < 0.0)
    return mount.beyond_pole


def pier_side(mount: Lx200Driver, _: PierSide) -> Steps:
    """-> the letter. Raises Unsupported for a fork, which has no sides."""
    if not mount.german:
        raise Unsupported("A fork has no sides of the pier.")
    return "W" if (yield from beyond_pole(mount)) else "E"
