"""Going through the library: what comes next, what came before, what stands in the field.

A search goes through the sky in strips of an hour of right ascension from north to south, the westernmost strip first:
what sets first is seen first. What may not be gone to is passed over. Pure functions of the candidates' order.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence

from gateway.astro.catalog.deepsky import Candidate, order
from gateway.astro.spherical import separation, wrap360

_EVERY_ROW = 1 << 60
Visible = Callable[[float, float], bool]
"""Whether a J2000 place (degrees) may be gone to now."""


def first(candidates: Sequence[Candidate], visible: Visible, meridian: float) -> Candidate | None:
    """The one to begin with; ``meridian`` is the right ascension in the south now."""
    west = int(wrap360(meridian + 180.0) / 15.0), -90.0, 0
    return _walk(candidates, bisect_left(candidates, west, key=order), 1, visible)


def beside(candidates: Sequence[Candidate], visible: Visible, ra: float, dec: float, step: int) -> Candidate | None:
    """The next one after a place (``step`` 1) or the one before it (-1), not counting what stands at that place."""
    after = bisect_left(candidates, order((_EVERY_ROW, ra, dec)), key=order)
    before = bisect_left(candidates, order((0, ra, dec)), key=order) - 1
    return _walk(candidates, after if step > 0 else before, step, visible)


def _walk(candidates: Sequence[Candidate], start: int, step: int, visible: Visible) -> Candidate | None:
    """Once round the sky."""
    count = len(candidates)
    for offset in range(count):
        candidate = candidates[(start + step * offset) % count]
        if visible(*candidate[1:]):
            return candidate
    return None


def in_field(candidates: Sequence[Candidate], ra: float, dec: float, radius: float) -> list[Candidate]:
    """Those within ``radius`` degrees of a J2000 place, the nearest first."""
    near = [(separation(ra, dec, c[1], c[2]), c) for c in candidates if abs(c[2] - dec) <= radius]
    return [candidate for distance, candidate in sorted(near) if distance <= radius]
