"""Going through the library: what comes next, what came before, what stands in the field.

A search goes through the sky in strips of an hour of right ascension from north to south, the westernmost strip first:
what sets first is seen first. What may not be gone to is passed over. Pure functions of the candidates' order.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence

from gateway.library.deepsky import Candidate, key
from gateway.spherical import separation, wrap360

Visible = Callable[[float, float], bool]
"""Whether a J2000 place (degrees) may be gone to now."""


def first(candidates: Sequence[Candidate], visible: Visible, meridian: float) -> Candidate | None:
    """The one to begin with; ``meridian`` is the right ascension in the south now."""
    west = key(wrap360(meridian + 180.0) // 15.0 * 15.0, 90.0)
    return _walk(candidates, bisect_left(candidates, west), 1, visible)


def beside(candidates: Sequence[Candidate], visible: Visible, ra: float, dec: float, step: int) -> Candidate | None:
    """The next one after a place (``step`` 1) or the one before it (-1), not counting what stands at that place."""
    here = key(ra, dec)
    low = bisect_left(candidates, here)
    high = bisect_right(candidates, here._replace(row=1 << 60))
    return _walk(candidates, high if step > 0 else low - 1, step, visible)


def _walk(candidates: Sequence[Candidate], start: int, step: int, visible: Visible) -> Candidate | None:
    """Once round the sky."""
    count = len(candidates)
    for offset in range(count):
        candidate = candidates[(start + step * offset) % count]
        if visible(candidate.ra, candidate.dec):
            return candidate
    return None


def in_field(candidates: Sequence[Candidate], ra: float, dec: float, radius: float) -> list[Candidate]:
    """Those within ``radius`` degrees of a J2000 place, the nearest first."""
    near = [(separation(ra, dec, c.ra, c.dec), c) for c in candidates if abs(c.dec - dec) <= radius]
    return [candidate for distance, candidate in sorted(near) if distance <= radius]
