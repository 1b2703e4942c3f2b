"""No farther past the meridian than the owner allows: there the tube of an equatorial mount comes to its pier.

Gotos are checked by where they lead. Motion by hand and tracking are watched; a mount that may be a German one and does
not tell the side that its tube is on is not.
"""

from __future__ import annotations

from gateway.astro.spherical import wrap180
from gateway.core.errors import PastMeridian
from gateway.mount.policy import AT_LIMIT, Limits
from gateway.mount.safety.view import ALLOWED, Verdict, View

#: Farther past the meridian than that, a tube has gone round under the pole and not against the pier.
AROUND_THE_POLE = 90.0


def check_hour_angle(limits: Limits, hour_angle: float) -> None:
    """Raises PastMeridian for a target too far from the meridian for a mount that cannot change sides."""
    if limits.hour_angle is not None and abs(wrap180(hour_angle)) > limits.hour_angle + AT_LIMIT:
        raise PastMeridian


def check_shaft(limits: Limits, first: float) -> None:
    """The same by the first axis of a German mount, which reads 90 degrees with the counterweight shaft down.

    Past the meridian the shaft stands above level. Raises PastMeridian.
    """
    if limits.hour_angle is not None and abs(wrap180(first - 90.0)) - 90.0 > limits.hour_angle + AT_LIMIT:
        raise PastMeridian


def can_be_told(german: bool | None, side: str | None) -> bool:
    """Whether anybody knows how far past the meridian it is: a German mount must have told its side."""
    return german is not None and (bool(side) or not german)


def past_meridian(hour_angle: float, side: str | None) -> float:
    """How many degrees a tube stands beyond the meridian, towards the pier; negative where it is free.

    ``side`` is the side of the pier that the tube of a German mount is on. On the west side it looks east and has the
    pier before it once the hour angle is positive; on the east side it is the other way round. Without a side it is a
    fork on a wedge, whose hour angle counts in both directions.
    """
    hour_angle = wrap180(hour_angle)
    past = abs(hour_angle) if side is None else hour_angle if side == "W" else -hour_angle
    return past if side is None or past <= AROUND_THE_POLE else past - 360.0


def meridian(view: View) -> Verdict:
    """What leads past the meridian ends at the limit of the hour angle, a goto excepted: it may change sides."""
    before, last, changes = view.seen.before, view.seen.last, view.seen.changes
    limit = view.limits.hour_angle
    equatorial = view.status is not None and view.status.equatorial
    if limit is None or not equatorial or view.moving.slewing or not can_be_told(view.german, view.side):
        return ALLOWED
    if before is None or last is None or changes is None or before.hour_angle is None or last.hour_angle is None:
        return ALLOWED
    side, earlier = view.side if view.german else None, view.seen.earlier
    then, now = past_meridian(before.hour_angle, side), past_meridian(last.hour_angle, side)
    if now <= then:
        return ALLOWED
    rate = view.ahead(changes.hour_angle, None if earlier is None else earlier.hour_angle)
    if now > limit - view.margin(rate):
        return Verdict(f"the hour angle limit ({now / 15.0:.2f} hours past the meridian)")
    return view.until(limit - now, rate, "the hour angle limit")
