"""How fast a motion comes nearer to what it must not reach, reckoned ahead of what was seen.

Until the motors have their speed, it is the speed they were told; and what has grown from one look to the next may grow
by as much again, for motors gather speed, and a tube that leaves the pole falls faster and faster. Degrees a second.
"""

from __future__ import annotations

#: Motors do not reach their speed at once: what is measured in the first second is not yet all of it.
RUN_UP = 1.0
#: A part of the speed told that says which way a motion leads; a slower change is the way past a limit.
LEADS = 0.2


class Rates:
    """``began`` is told of every motion, ``ahead`` asked at every look for each limit by its name."""

    def __init__(self) -> None:
        self._began, self._told = -1e9, 0.0
        self._measured: dict[str, float] = {}

    def began(self, now: float, told: float) -> None:
        """A motion has begun; ``told`` is its speed where it is known, else 0."""
        self._began, self._told = now, told
        self._measured.clear()

    def ahead(self, limit: str, change: float, now: float, elapsed: float) -> float:
        """What a change between two looks means for the time after them."""
        rate, since = abs(change) / elapsed, now - self._began
        grown = max(0.0, rate - self._measured.get(limit, rate))
        self._measured[limit] = rate
        if since - elapsed < RUN_UP and rate > LEADS * self._told * _run_up(since - elapsed, since):
            return max(rate + grown, self._told)
        return rate + grown


def _run_up(first: float, last: float) -> float:
    """What part of its speed a motor has had on average between two moments, seconds after it was told to turn."""
    if last >= RUN_UP or last <= max(0.0, first):
        return 1.0
    return (max(0.0, first) + last) / 2.0 / RUN_UP
