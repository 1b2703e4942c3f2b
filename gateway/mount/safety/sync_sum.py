"""The sum of all syncs since the alignment: small syncs add up to a large error.

Each sync, and the sum of all, may be off by at most ``sync-limit``. A sync counts by its turn of the axes: near the
zenith (alt-azimuth) or the pole (equatorial), a sync that is small on the sky turns the first axis, and every later
goto, by up to 180 degrees. So there is a sum on the sky and, by day, a sum for each axis. A new alignment resets them.
If a sync may turn the axes in either of two ways, as beyond the pole or on the other side of the pier, all possible
sums are stored, and the largest counts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import cos, hypot, radians

from msgspec import Struct

from gateway.astro.axes import Pair
from gateway.astro.spherical import separation, wrap180
from gateway.core.errors import SyncTooFar
from gateway.core.operations import Equatorial

#: Degrees by which low precision may make the sum of an axis larger in a sync that makes the other's smaller.
ROUNDING = 0.05
#: Degrees: sums nearer to each other count as equal; and how many different sums are stored.
SAME, MOST = 0.5, 4
#: The turns that a sync may make, for each of the sums that are possible before it.
Turns = Sequence[Sequence[Pair]]


class SyncSum(Struct, frozen=True, omit_defaults=True):
    """The net offset in degrees: east and north on the sky, and by how much each axis was turned.

    ``turned`` is the sum of the turns of the two axes by syncs: azimuth and altitude, or those of an equatorial mount
    (`Geometry.axes`). ``otherwise`` are the other possible sums, if the tube may point the other way round than the
    mount assumes.
    """

    east: float = 0.0
    north: float = 0.0
    turned: Pair = (0.0, 0.0)
    otherwise: tuple[Pair, ...] = ()

    @property
    def size(self) -> float:
        """The length of the offset on the sky, degrees."""
        return hypot(self.east, self.north)

    @property
    def axes(self) -> tuple[Pair, ...]:
        """By how many degrees syncs may have turned the two axes since the alignment: one pair, or several."""
        return (self.turned, *self.otherwise)

    def steps(self, turns: Turns) -> Iterator[tuple[Pair, Pair]]:
        """Yield every pair of a sum of the axes that is possible now and a sum that is possible after a sync."""
        for before, ways in zip(self.axes, turns, strict=True):
            for way in ways:
                yield before, (wrap180(before[0] + way[0]), wrap180(before[1] + way[1]))

    def added(self, present: Equatorial, wanted: Equatorial, turns: Turns) -> SyncSum:
        """Return the sum after another sync from ``present`` to ``wanted``; ``turns`` are its possible rotations."""
        middle = cos(radians((present.dec + wanted.dec) / 2.0))
        turned, *otherwise = _different(after for _, after in self.steps(turns))
        east = self.east + wrap180(wanted.ra - present.ra) * middle
        return SyncSum(east, self.north + wanted.dec - present.dec, turned, tuple(otherwise))


NO_SYNC = SyncSum()


def _different(sums: Iterable[Pair]) -> list[Pair]:
    """Return the sums without those that equal an earlier sum."""
    distinct: list[Pair] = []
    for pair in sums:
        if not any(max(abs(wrap180(a - b)) for a, b in zip(pair, other, strict=True)) < SAME for other in distinct):
            distinct.append(pair)
    return distinct[:MOST]


class SyncTotal:
    """Owns ``value``, the sum of all syncs since the alignment of the mount; a previous run may have saved it.

    ``coming`` is the sum with the sync that was admitted and is being sent; ``doubt`` is the reason why the user should
    sync again.
    """

    def __init__(self) -> None:
        self.value = self.coming = SyncSum()
        self.doubt = ""

    def carried_out(self) -> None:
        """The mount has acknowledged the sync."""
        self.value, self.doubt = self.coming, ""

    def forget(self, doubt: str = "") -> None:
        """Reset the sum: the mount was aligned again, is not aligned, or is in ``doubt``."""
        self.value, self.doubt = SyncSum(), doubt


def check_sync(
    limit: float, so_far: SyncSum, turns: Turns, present: Equatorial, wanted: Equatorial, by_day: bool, pole: str
) -> SyncSum:
    """Return the sum with a sync. Raises SyncTooFar if either is off by more than the limit: on the sky, or by day an
    axis.

    A sync that makes the sum of an axis smaller, and none larger, is accepted at any distance. ``by_day``: a Sun is up.
    ``pole`` is where the first axis turns far: at the zenith, or at the pole.
    """
    then, steps = so_far.added(present, wanted, turns), list(so_far.steps(turns))
    if all(corrects(limit, before, after) for before, after in steps):
        return then
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
    if not by_day:
        return then
    turn = max(abs(wrap180(now - old)) for before, after in steps for old, now in zip(before, after, strict=True))
    total = max(abs(change) for _, after in steps for change in after)
    if max(turn, total) > limit:
        may = "may turn" if len(steps) > 1 else "turns"
        since = "" if turn > limit else " with those since the alignment"
        raise SyncTooFar(
            f"Sync refused: it {may} an axis by {turn if turn > limit else total:.0f} degrees{since}. "
            f"Sync on a star farther from the {pole}, {ways_out}"
        )
    return then


def corrects(limit: float, before: Pair, after: Pair) -> bool:
    """Whether a sync makes the sum of no axis larger (apart from rounding, within the limit), and that of at least one
    axis smaller.
    """
    sums = [(abs(old), abs(now)) for old, now in zip(before, after, strict=True)]
    larger = any(now > old and (now > old + ROUNDING or now > limit) for old, now in sums)
    return not larger and any(now < old - ROUNDING for old, now in sums)
