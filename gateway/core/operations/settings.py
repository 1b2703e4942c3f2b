"""Operations that set what a mount or one of its devices goes by, and the focuser."""

from __future__ import annotations

from gateway.core.operations.values import Operation


class SetSite(Operation[None], frozen=True):
    """Latitude and/or longitude (east positive) in degrees; None keeps what is there.

    With ``others`` the mount's own site counts again, whatever programs have set: it is told the latitude and longitude
    given here only where it has one of the others by us, or tells none at all.
    """

    latitude: float | None = None
    longitude: float | None = None
    others: tuple[SetSite, ...] | None = None


class SetClock(Operation[None], frozen=True):
    """UTC as Unix seconds and the offset local minus UTC in hours; ``dst`` hours of it are daylight saving, if told."""

    unix: float
    offset: float
    dst: int | None = None


class ClockFromGps(Operation[None], frozen=True):
    """Set the mount's clock from its GPS unit. Raises NoDevice when there is none or it is not linked."""


class SetGuideRate(Operation[None], frozen=True):
    """Autoguide rate of an axis as a fraction of sidereal."""

    axis: int
    rate: float


class Backlash(Operation[None], frozen=True):
    """Antibacklash of an axis, 0-99: in one sense of its motor (1, -1), or in both (0)."""

    axis: int
    value: int
    sense: int = 0


class PeriodicError(Operation[None], frozen=True):
    """Periodic error correction on, off, or the other way round (None), on one axis or both (None)."""

    axis: int | None = None
    on: bool | None = None


class Focus(Operation[None], frozen=True):
    """Move the focuser: +1 in, -1 out, 0 halt; speed 1-4."""

    direction: int
    speed: int = 2
