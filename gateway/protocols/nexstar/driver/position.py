"""Where the mount points, and what it is told about it."""

from __future__ import annotations

from gateway.astro.spherical import fold_declination, wrap180, wrap360
from gateway.core.operations import Equatorial, Horizontal, HorizontalPosition, PierSide, Position, Sync
from gateway.protocols.base.driver import Send, Steps
from gateway.protocols.nexstar.driver.state import POLE_AXES, NexStar
from gateway.protocols.nexstar.driver.tracking import native_mode


def position(mount: NexStar, _: Position) -> Steps:
    """``e`` or ``E``, folded past the pole, with the offset of a sync that the hand control could not take."""
    answer = yield Send("e" if mount.knows("e") else "E")
    mount.beyond_pole = abs(wrap180(answer["dec"])) > 90.0
    ra, dec = fold_declination(answer["ra"], answer["dec"])
    ra, dec = fold_declination(ra + mount.offset[0], dec + mount.offset[1])
    mount.last = Equatorial(ra, dec)
    return mount.last


def axis_readings(mount: NexStar) -> Send:
    """The readings of the axes, as precisely as this version tells them."""
    return Send("z" if mount.knows("z") else "Z")


def horizontal_position(mount: NexStar, _: HorizontalPosition) -> Steps:
    """A fork's own azimuth and altitude; None where the axes are equatorial (the controller derives it then)."""
    mode = native_mode(mount)
    if mount.german or (mode is not None and mode.equatorial) or mount.displaced:
        return None
    answer = yield axis_readings(mount)
    return Horizontal(az=wrap360(answer["az"]), alt=max(-90.0, min(90.0, answer["alt"])))


def pier_side(mount: NexStar, _: PierSide) -> Steps:
    """``p``: E or W; a fork is always E.

    A German mount before ``p`` tells it by its declination axis: on the W side that reads beyond the pole. The letter
    is then that of its age, which is the northern one everywhere (``NexStar.tube_side``).
    """
    if not mount.german:
        return "E"
    if mount.knows("p"):
        answer = yield Send("p")
        return answer["side"]
    answer = yield axis_readings(mount)
    return "W" if wrap180(answer["alt"] - POLE_AXES[1]) > 0.0 else "E"


def sync(mount: NexStar, operation: Sync) -> Steps:
    """``s`` or ``S``; before 4.10 an offset kept here and added to everything the mount says."""
    if mount.knows("s"):
        yield Send("s", {"ra": operation.ra, "dec": operation.dec})
        return
    answer = yield Send("e" if mount.knows("e") else "E")
    ra, dec = fold_declination(answer["ra"], answer["dec"])
    mount.offset = (wrap180(wrap360(operation.ra) - ra), operation.dec - dec)
