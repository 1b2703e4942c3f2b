"""What the rules may know of a mount, and nothing more: values, and functions that tell one. Nothing here acts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from gateway.core import operations as op
from gateway.mount.context import Context
from gateway.mount.motion.wanted import Moving
from gateway.mount.safety.rules.sun import SunAvoidance
from gateway.mount.safety.stop_timing import StopTiming
from gateway.mount.site.astrometry import SiteAstrometry
from gateway.protocols.base.driver import Driver


class Readings(Protocol):
    """What the mount told last (None before the first time), and how old that is in seconds."""

    def value(self, kind: type[op.Operation]) -> Any: ...
    def age(self, kind: type[op.Operation], now: float) -> float: ...


class MountInputs(NamedTuple):
    """``exchange`` tells what an exchange with the mount takes, ``period`` is how often positions are asked in motion,
    ``being_set`` whether the mount has still to hear of a site or a time that was set.
    """

    driver: Driver
    now: Callable[[], float]
    readings: Readings
    astrometry: SiteAstrometry
    suns: SunAvoidance
    moving: Callable[[], Moving]
    context: Context
    exchange: Callable[[], float]
    period: float
    being_set: Callable[[], bool] = lambda: False

    @property
    def timing(self) -> StopTiming:
        """As things are on the line now."""
        return StopTiming(self.exchange(), self.driver.position_reads, self.period)

    @property
    def site_known(self) -> bool:
        return self.astrometry.site_clock.site() is not None

    @property
    def fastest(self) -> float:
        """Degrees a second of the mount's fastest motion."""
        return self.driver.speed(op.Rate(name="max"))

    def speed(self, moving: op.Move | op.MoveAxis) -> float:
        """Degrees a second of a motion by hand."""
        return self.driver.speed(moving.rate)
