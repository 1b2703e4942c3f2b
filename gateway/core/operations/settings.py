"""Operations that set values of the mount or of its devices, or move the focuser."""

from __future__ import annotations

from gateway.core.operations.values import Operation


class SetSite(Operation[None], frozen=True):
    """Set latitude and/or longitude (east positive) in degrees; None keeps the present value.

    ``others`` is given if a client wants the mount's own site again. It lists the sites that clients have set through
    the gateway; latitude and longitude are then sent only if the mount reports no site or one of these.
    """

    latitude: float | None = None
    longitude: float | None = None
    others: tuple[SetSite, ...] | None = None  # sent earlier by the gateway


class SetClock(Operation[None], frozen=True):
    """Set UTC (Unix seconds) and the offset, local minus UTC in hours, of which ``dst`` hours are daylight saving.

    With ``heard`` it waits a short time for the mount's reply, and raises Refused if the mount refuses the value.
    """

    unix: float  # UTC, Unix seconds
    offset: float  # local minus UTC, hours
    dst: int | None = None
    heard: bool = False  # wait for the mount's reply


class SetZone(Operation[None], frozen=True):
    """Set the UTC offset (local minus UTC, hours) for the times that this client reads, not for the mount's clock."""

    offset: float  # local minus UTC, hours


class ClockFromGps(Operation[None], frozen=True):
    """Set the mount's clock from its GPS receiver. Raises NoDevice if there is none or it has no fix."""


class SetGuideRate(Operation[None], frozen=True):
    """Set the autoguide rate of an axis as a fraction of sidereal."""

    axis: int
    rate: float  # fraction of sidereal


class Backlash(Operation[None], frozen=True):
    """Set the backlash compensation of an axis, 0-99: for one sense of its motor (1, -1), or for both (0)."""

    axis: int
    value: int  # 0-99
    sense: int = 0  # of the motor, 0: both


class PeriodicError(Operation[None], frozen=True):
    """Turn periodic error correction on or off, or toggle it (None), on one axis or both (None)."""

    axis: int | None = None  # None: both
    on: bool | None = None  # None: toggle


class Focus(Operation[None], frozen=True):
    """Move the focuser: +1 in, -1 out, 0 halt; speed 1-4."""

    direction: int  # 1 in, -1 out, 0 halt
    speed: int = 2  # 1-4
