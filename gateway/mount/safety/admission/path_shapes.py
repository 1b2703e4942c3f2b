"""The way a tube takes when both axes of its mount turn at once, and whether it comes near the Sun.

Places are readings of the two axes in degrees; a reading of the second one beyond 90 is the other way of pointing. A
mount turns both axes straight to their goals. How fast each of them is nobody says, so a way has two shapes: both
arrive together, or both are equally fast and the one with less to do rests while the other goes on.
"""

from __future__ import annotations

from math import copysign, sqrt

from gateway.astro.axes import Pair
from gateway.astro.spherical import separation

#: How finely a way is looked at where it grazes the circle, degrees: half of it is the greatest error.
STEP = 0.2


def together(start: Pair, turn: Pair, turned: float) -> Pair:
    """Where the axes are when the longer turn is done so far and both arrive together."""
    part = turned / max(abs(turn[0]), abs(turn[1]), 1e-9)
    return start[0] + turn[0] * part, start[1] + turn[1] * part


def one_rests(start: Pair, turn: Pair, turned: float) -> Pair:
    """The same when both are equally fast."""
    first, second = (copysign(min(abs(whole), turned), whole) for whole in turn)
    return start[0] + first, start[1] + second


def clear(start: Pair, turn: Pair, sun: Pair, limit: float) -> bool:
    """Whether neither shape of the way from ``start`` by ``turn`` comes nearer to ``sun`` than ``limit`` degrees.

    Where the tube is far from the circle the next look can be far ahead: two axes at one degree each carry it no
    farther than the root of two.
    """
    length = max(abs(turn[0]), abs(turn[1]))
    for shape in (together, one_rests):
        turned = 0.0
        while True:
            distance = separation(*shape(start, turn, turned), *sun)
            if distance < limit:
                return False
            if turned >= length:
                break
            turned = min(length, turned + max(STEP, (distance - limit) / sqrt(2.0)))
    return True
