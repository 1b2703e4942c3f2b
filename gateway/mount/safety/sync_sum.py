"""The sum of all syncs since the alignment: small syncs add up to a large error.

The limits use the direction in which the mount believes to point. Each sync may be off by the limit for syncs
(``sync-limit``), and so may their sum, but no more: four syncs of 14 degrees would shift the horizon by 56 degrees. On
an equatorial mount a sync near the pole that is small on the sky turns the whole sky around the pole, so right
ascension counts in full there. A new alignment resets the sum.
"""

from __future__ import annotations

from math import cos, hypot, radians

from msgspec import Struct

from gateway.astro.spherical import separation, wrap180
from gateway.core.errors import SyncTooFar
from gateway.core.operations import Equatorial
from gateway.mount.policy import Limits


class SyncSum(Struct, frozen=True, omit_defaults=True):
    """The net offset in degrees: east (on the sky, or of the first axis of an equatorial mount) and north."""

    east: float = 0.0
    north: float = 0.0

    @property
    def size(self) -> float:
        """The length of the offset, degrees."""
        return hypot(self.east, self.north)

    def added(self, present: Equatorial, wanted: Equatorial, equatorial: bool = False) -> SyncSum:
        """Return the sum with one more sync, from the ``present`` position of the mount to the ``wanted`` one."""
        middle = 1.0 if equatorial else cos(radians((present.dec + wanted.dec) / 2.0))
        return SyncSum(self.east + wrap180(wanted.ra - present.ra) * middle, self.north + wanted.dec - present.dec)


class SyncTotal:
    """Owns ``value``, the sum of all syncs since the alignment of the mount; a previous run may have saved it."""

    def __init__(self) -> None:
        self.value = SyncSum()

    def add(self, present: Equatorial, wanted: Equatorial, equatorial: bool) -> None:
        self.value = self.value.added(present, wanted, equatorial)

    def forget(self) -> None:
        """Reset the sum: the mount was aligned again, or is not aligned."""
        self.value = SyncSum()


def check_sync(limits: Limits, present: Equatorial, wanted: Equatorial) -> None:
    """Raises SyncTooFar if a sync would move the sky by more than the limit."""
    distance = separation(present.ra, present.dec, wanted.ra, wanted.dec)
    if distance > limits.sync:
        raise SyncTooFar(f"Sync refused: {distance:.0f} degrees from the present position.")


def check_sum(limit: float, so_far: SyncSum, present: Equatorial, wanted: Equatorial, equatorial: bool) -> None:
    """Raises SyncTooFar if a sync takes the sum beyond the limit, unless it makes the sum smaller."""
    then = so_far.added(present, wanted, equatorial)
    if then.size > limit and then.size > so_far.size:
        raise SyncTooFar(f"Sync refused: {then.size:.0f} degrees off with those since the alignment.")
