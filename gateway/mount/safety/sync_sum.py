"""The sum of all syncs since the alignment: small syncs add up to a large error.

Each sync may be off by the limit for syncs (``sync-limit``), and so may their sum, but no more. A sync counts by what
it turns: near the zenith of an alt-azimuth mount, and near the pole of an equatorial one, a sync that is small on the
sky turns the first axis by up to 180 degrees, and every later goto with it. So the sum is kept on the sky and for each
axis. By night plate solvers may sync there, a degree at a time. A new alignment resets the sum.
"""

from __future__ import annotations

from math import cos, hypot, radians

from msgspec import Struct

from gateway.astro.axes import Pair
from gateway.astro.spherical import separation, wrap180
from gateway.core.errors import SyncTooFar
from gateway.core.operations import Equatorial

#: Degrees: by night a sync this near is accepted however far it turns an axis.
NEARBY = 1.0
#: Degrees by which low precision may make the sum of one axis larger in a sync that makes the other's smaller.
ROUNDING = 0.05


class SyncSum(Struct, frozen=True, omit_defaults=True):
    """The net offset in degrees: east and north on the sky, and by how much each axis was turned.

    ``turned`` is what syncs have added to the readings of the two axes: azimuth and altitude, or those of an equatorial
    mount (`Geometry.axes`). Sums that earlier versions have saved do not have it.
    """

    east: float = 0.0
    north: float = 0.0
    turned: Pair | None = None

    @property
    def size(self) -> float:
        """The length of the offset on the sky, degrees."""
        return hypot(self.east, self.north)

    @property
    def axes(self) -> Pair:
        """By how many degrees syncs have turned each axis since the alignment."""
        return self.turned if self.turned is not None else (self.east, self.north)

    def added(self, present: Equatorial, wanted: Equatorial, turn: Pair) -> SyncSum:
        """Return the sum with one more sync, from ``present`` to ``wanted``, which turns the axes by ``turn``."""
        middle = cos(radians((present.dec + wanted.dec) / 2.0))
        first, second = (wrap180(total + more) for total, more in zip(self.axes, turn, strict=True))
        east = self.east + wrap180(wanted.ra - present.ra) * middle
        return SyncSum(east, self.north + wanted.dec - present.dec, (first, second))


class SyncTotal:
    """Owns ``value``, the sum of all syncs since the alignment of the mount; a previous run may have saved it.

    ``coming`` is the sum with the sync that was admitted and is being sent.
    """

    def __init__(self) -> None:
        self.value = self.coming = SyncSum()

    def carried_out(self) -> None:
        """The mount has acknowledged the sync."""
        self.value = self.coming

    def forget(self) -> None:
        """Reset the sum: the mount was aligned again, or is not aligned."""
        self.value = SyncSum()


def check_sync(
    limit: float, so_far: SyncSum, then: SyncSum, present: Equatorial, wanted: Equatorial, by_day: bool, pole: str
) -> None:
    """Raises SyncTooFar if a sync, or the sum ``then`` with it, is off by more than the limit on the sky or an axis.

    A sync that makes the sum of an axis smaller, and none larger, is accepted at any distance. ``by_day``: a Sun is up.
    ``pole`` is where the first axis turns far: at the zenith, or at the pole.
    """
    before, after = so_far.axes, then.axes
    if corrects(limit, before, after):
        return
    distance = separation(present.ra, present.dec, wanted.ra, wanted.dec)
    ways_out = "align the mount again, or set another sync-limit."
    if distance > limit:
        raise SyncTooFar(
            f"Sync refused: {distance:.0f} degrees from the present position. Center the object, {ways_out}"
        )
    if then.size > limit and then.size > so_far.size:
        raise SyncTooFar(
            f"Sync refused: {then.size:.0f} degrees off with those since the alignment. Check the object, {ways_out}"
        )
    if distance <= NEARBY and not by_day:
        return
    turn = max(abs(wrap180(now - old)) for old, now in zip(before, after, strict=True))
    total = max(abs(after[0]), abs(after[1]))
    if max(turn, total) > limit:
        since = "" if turn > limit else " with those since the alignment"
        raise SyncTooFar(
            f"Sync refused: it turns an axis by {turn if turn > limit else total:.0f} degrees{since}. "
            f"Sync on a star farther from the {pole}, {ways_out}"
        )


def corrects(limit: float, before: Pair, after: Pair) -> bool:
    """Whether a sync makes no axis's sum larger in amount, apart from rounding within the limit, and one smaller."""
    sums = [(abs(old), abs(now)) for old, now in zip(before, after, strict=True)]
    larger = any(now > old and (now > old + ROUNDING or now > limit) for old, now in sums)
    return not larger and any(now < old - ROUNDING for old, now in sums)
