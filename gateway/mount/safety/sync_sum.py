"""The sum of all syncs since the alignment: small syncs add up to a large error.

Each sync may be off by the limit for syncs (``sync-limit``), and so may their sum, but no more. Near the zenith of an
alt-azimuth mount, and near the pole of an equatorial one, a sync that is small on the sky turns the first axis by up to
180 degrees, so the sum is also calculated for each axis: it shows where the tube is if the syncs were wrong. If a mount
may believe after a sync that it points in the other way (beyond the pole, or on the other side of the pier), there are
two possible sums, and both count. A new alignment resets the sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, radians

from msgspec import Struct

from gateway.astro.axes import Pair
from gateway.astro.spherical import separation, wrap180
from gateway.core.errors import SyncTooFar
from gateway.core.operations import Equatorial

#: Degrees by which a sync that corrects one axis may increase the sum of the other, because positions are rounded.
ROUNDING_DEGREES = 0.05


class SyncSum(Struct, frozen=True, omit_defaults=True):
    """The net offset by all syncs in degrees: east and north on the sky, and by how much the readings of each axis were
    turned (azimuth and altitude, or those that `Geometry` defines for an equatorial mount).

    After one of the syncs the mount may believe that it points in the other of the two ways. ``around`` is then the
    second possible value of ``turned``; else None.
    """

    east: float = 0.0
    north: float = 0.0
    turned: Pair = (0.0, 0.0)
    around: Pair | None = None

    @property
    def size(self) -> float:
        """The length of the offset on the sky, degrees."""
        return hypot(self.east, self.north)

    @property
    def axis_turns(self) -> tuple[Pair, ...]:
        """By how many degrees syncs may have turned the two axes since the alignment: one pair, or two."""
        return (self.turned,) if self.around is None else (self.turned, self.around)

    def with_sync(self, present: Equatorial, target: Equatorial, turns: Sequence[Pair]) -> SyncSum:
        """Return the sum after another sync from ``present`` to ``target``. ``turns``: by how much it turns the axes,
        and a second pair if the mount may then take its tube to be beyond the pole, or on the other side of the pier.
        """
        middle = cos(radians((present.dec + target.dec) / 2.0))
        around = None
        if self.around is not None:  # the mount has taken it for the other way, so the second axis turns that way
            around = _add_turns(self.around, (turns[0][0], turns[0][1] * (-1.0 if len(turns) > 1 else 1.0)))
        elif len(turns) > 1:
            around = _add_turns(self.turned, turns[1])
        east = self.east + wrap180(target.ra - present.ra) * middle
        return SyncSum(east, self.north + target.dec - present.dec, _add_turns(self.turned, turns[0]), around)


NO_SYNC = SyncSum()


def _add_turns(pair: Pair, turn: Pair) -> Pair:
    return wrap180(pair[0] + turn[0]), wrap180(pair[1] + turn[1])


class SyncTotal:
    """Owns ``value``, the sum of all syncs since the alignment of the mount; a previous run may have saved it.

    ``pending`` is the sum including the sync that is being sent; ``resync_reason`` says why the user should sync again.
    """

    def __init__(self) -> None:
        self.value = self.pending = SyncSum()
        self.resync_reason = ""

    def note_acknowledged(self) -> None:
        """Note that the mount has acknowledged the pending sync."""
        self.value, self.resync_reason = self.pending, ""

    def reset(self, reason: str = "") -> None:
        """Reset the sum after a new alignment, or because the alignment may be lost, as ``reason`` says."""
        self.value, self.resync_reason = SyncSum(), reason


def checked_sync_sum(
    sync_limit: float, old_sum: SyncSum, turns: Sequence[Pair], present: Equatorial, target: Equatorial
) -> SyncSum:
    """Return the sum with a sync. Raises SyncTooFar if the sync or an increased sum exceeds ``sync_limit`` on the sky.

    A sync that makes the sum of an axis smaller, and none larger, is accepted at any distance.
    """
    then = old_sum.with_sync(present, target, turns)
    sums = old_sum.turned, old_sum.around or old_sum.turned
    if all(is_correction(sync_limit, before, after) for before, after in zip(sums, then.axis_turns, strict=False)):
        return then
    distance = separation(present.ra, present.dec, target.ra, target.dec)
    ways_out = "Centre the object, align the mount again, or set another sync-limit."
    if distance > sync_limit:
        raise SyncTooFar(f"Sync refused: {distance:.0f} degrees from the present position. {ways_out}")
    if then.size > sync_limit and then.size > old_sum.size:
        raise SyncTooFar(f"Sync refused: {then.size:.0f} degrees off with those since the alignment. {ways_out}")
    return then


def is_correction(sync_limit: float, before: Pair, after: Pair) -> bool:
    """Whether a sync makes the sum of one axis smaller, and that of no axis larger (except by rounding, within the
    limit). ``before`` and ``after`` are the sums of the two axes.
    """
    sums = [(abs(old), abs(now)) for old, now in zip(before, after, strict=True)]
    larger = any(now > old and (now > old + ROUNDING_DEGREES or now > sync_limit) for old, now in sums)
    return not larger and any(now < old - ROUNDING_DEGREES for old, now in sums)
