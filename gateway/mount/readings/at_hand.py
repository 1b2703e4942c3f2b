"""What can be told without asking the mount: its last answers while they are fresh, site and clock as known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gateway.core import operations as op
from gateway.mount.link.line import MountLink
from gateway.mount.motion.wanted import WantedState
from gateway.mount.readings.cache import FRESH, MISSING, ReadingsCache
from gateway.mount.site.site_clock import SiteClock

#: An answer lives so many times as long as an exchange takes, at least.
EXCHANGES = 2.5


class AtHand:
    """``tell`` gives an answer, or MISSING; that somebody has asked is noted in the cache."""

    def __init__(
        self,
        now: Callable[[], float],
        link: MountLink,
        cache: ReadingsCache,
        wanted: WantedState,
        site_clock: SiteClock,
    ) -> None:
        self._now, self._link, self._cache, self._wanted, self._site_clock = now, link, cache, wanted, site_clock

    def tell(self, operation: op.Operation) -> Any:
        """What the mount said last, when it is fresh enough; MISSING when it must be asked."""
        kind = type(operation)
        if kind not in FRESH:
            known = self._site_clock.known(kind)
            return MISSING if known is None else known
        if kind is op.Slewing and self._wanted.goto_waits:
            return True
        now = self._now()
        value = self._cache.asked(kind, now)
        if value is not MISSING:
            return value
        return self._cache.fresh(kind, now, EXCHANGES * self._link.typical, self._link.state != "up")
