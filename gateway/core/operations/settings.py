"""Operations that set values of a mount or a device of it, or move the focuser."""

from __future__ import annotations

from gateway.core.operations.values import Operation


class SetSite(Operation[None], frozen=True):
    """Set latitude and/or longitude (east positive) in degrees; None keeps the present value.

    With ``others``, the mount's own site is in force again, whatever clients have set. The mount is then sent the given
    site only if it reports none, or one of ``others``, the sites that the gateway had sent it.
    """

    latitude: float | None = None
    longitude: float | None = None
    others: tuple[SetSite, ...] | None = None


class SetClock(Operation[None], frozen=True):
    """Set UTC (Unix seconds) and the offset, local minus UTC in hours, of which ``dst`` hours are daylight saving.

    ``heard``: wait for the mount's own answer, if it comes soon. Raises Refused then if the mount refuses it.
    """

    unix: float
    offset: float
    dst: int | None = None
    heard: bool = False


class SetZone(Operation[None], frozen=True):
    """Set the zone in which this program reads the time, and nothing else: local minus UTC in hours. UTC stays."""

    offset: float


class ClockFromGps(Operation[None], frozen=True):
    """Set the mount's clock from its GPS receiver. Raises NoDevice if there is none or it has no fix."""


class SetGuideRate(Operation[None], frozen=True):
    """Set the autoguide rate of an axis as a fraction of sidereal."""

    axis: int
    rate: float


class Backlash(Operation[None], frozen=True):
    """Set the antibacklash of an axis, 0-99: in one sense of its motor (1, -1), or in both (0)."""

    axis: int
    value: int
    sense: int = 0


class PeriodicError(Operation[None], frozen=True):
    """Turn periodic error correction on or off, or toggle it (None), on one axis or both (None)."""

    axis: int | None = None
    on: bool | None = None


class Focus(Operation[None], frozen=True):
    """Move the focuser: +1 in, -1 out, 0 halt; speed 1-4."""

    direction: int
    speed: int = 2
