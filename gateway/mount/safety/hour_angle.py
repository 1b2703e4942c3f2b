"""How far the tube is past the meridian, where a German mount meets its pier and the cables of a fork tighten.

If the mount reports its axes, the first axis tells it, whatever the mount believes about the sky. Otherwise it follows
from the hour angle and, on a German mount, from the side of the pier that the mount has told at rest. During a goto
neither is used: the tube may change sides, and the side that is told is already that of the goal. Angles are degrees.
"""

from __future__ import annotations

from msgspec import Struct

from gateway.astro.axes import Build, Geometry
from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.core.errors import PastMeridian
from gateway.mount.context import Context
from gateway.mount.policy import AT_LIMIT, Limits

#: Degrees past the meridian beyond which a tube has passed under the pole and no longer turns towards the pier.
AROUND_THE_POLE = 90.0
#: Since these exchanges with the mount (``Driver.exchanges``) the axes are read for the hour angle.
SINCE = 2


class PastNow(Struct, frozen=True):
    """How far the tube is past the meridian, towards the pier; negative on the free side. ``rate``: how fast that
    changes, degrees a second; ``earlier``: its rate before that, None if unknown.
    """

    degrees: float
    rate: float
    earlier: float | None = None


def told_by_axes(mount: Context) -> bool:
    """Whether the mount itself reports its axes."""
    driver = mount.driver
    return driver.exchanges >= SINCE and driver.implementation(op.AxisPosition) is not None


def past_by_axes(mount: Context, axes: op.Horizontal | op.GotoAxes) -> float | None:
    """Return how far these axis readings of an equatorial mount are past the meridian; None without a hemisphere.

    The first axis of a German mount reads 90 with the counterweight shaft down. Past the meridian the shaft is above
    horizontal. A fork on its wedge counts from north, and its hour angle in both directions.
    """
    if mount.driver.german:
        return abs(wrap180(axes.az - 90.0)) - 90.0
    site = mount.sources.site()
    if site is None:
        return None
    return abs(wrap180(axes.az - Geometry(Build.WEDGE, site.latitude).axes(0.0, 0.0, False)[0]))


def meridian_known(german: bool | None, side: str | None) -> bool:
    """Whether the distance past the meridian is known. A German mount must have reported its pier side."""
    return german is not None and (bool(side) or not german)


def past_meridian(hour_angle: float, side: str | None) -> float:
    """Return by how many degrees the tube is past the meridian, towards the pier; negative on the free side.

    ``side`` is the side of the pier that the tube of a German mount is on. On the west side the tube looks east, and
    the pier is in its way once the hour angle is positive; on the east side it is the other way round. Without a side
    the mount is a fork on a wedge, and its hour angle counts in both directions.
    """
    hour_angle = wrap180(hour_angle)
    past = abs(hour_angle) if side is None else hour_angle if side == "W" else -hour_angle
    return past if side is None or past <= AROUND_THE_POLE else past - 360.0


def check_hour_angle(limits: Limits, hour_angle: float) -> None:
    """Raises PastMeridian if a target is too far from the meridian for a mount that cannot change the pier side."""
    if limits.hour_angle is not None and abs(wrap180(hour_angle)) > limits.hour_angle + AT_LIMIT:
        raise PastMeridian


def check_shaft(limits: Limits, first: float) -> None:
    """Like ``check_hour_angle``, by the reading of the first axis of a German mount. Raises PastMeridian.

    The axis reads 90 degrees with the counterweight shaft down. Past the meridian the shaft is above horizontal.
    """
    if limits.hour_angle is not None and abs(wrap180(first - 90.0)) - 90.0 > limits.hour_angle + AT_LIMIT:
        raise PastMeridian
