"""The operations: everything that a program can mean, as values.

A surface yields them and a driver carries them out; neither knows the other. They are frozen, so that they can be
logged, compared, replayed and named in a table. Angles are degrees, right ascension included. Right ascension and
declination are of the equinox of date unless a surface is set to J2000. Longitudes count positive to the EAST; a UTC
offset is local time minus UTC, in hours. Motion is either on the *sky* (``Move``) or of one *axis* (``MoveAxis``).
"""

from __future__ import annotations

from gateway.core.operations.base import Fields, Operation, Read, Values
from gateway.core.operations.motions import (
    AbortMotion,
    AbortSlew,
    Choose,
    Goto,
    GotoAxes,
    GotoHorizontal,
    Hibernate,
    Home,
    Move,
    MoveAxis,
    Park,
    PassThrough,
    Pulse,
    PulseAxis,
    SetHome,
    SetTracking,
    StopAxis,
    Sync,
    TrackRate,
    Unpark,
    Wake,
)
from gateway.core.operations.reads import (
    AxisPosition,
    DriveRate,
    GetClock,
    GetGps,
    GetIdentity,
    GetSite,
    GetStatus,
    GuideRate,
    HomeState,
    HorizontalPosition,
    MoonPlace,
    Own,
    PierSide,
    PlanetPlace,
    Position,
    SiderealTime,
    Slewing,
    ToEquinoxOfDate,
    ToJ2000,
    Zenith,
)
from gateway.core.operations.settings import (
    Backlash,
    ClockFromGps,
    Focus,
    PeriodicError,
    SetClock,
    SetGuideRate,
    SetSite,
)
from gateway.core.operations.values import (
    Chosen,
    Direction,
    Equatorial,
    Gps,
    Horizontal,
    Identity,
    Moment,
    Place,
    Pulsed,
    Rate,
    Status,
    Tracking,
)

__all__ = (
    "AbortMotion",
    "AbortSlew",
    "AxisPosition",
    "Backlash",
    "Choose",
    "Chosen",
    "ClockFromGps",
    "Direction",
    "DriveRate",
    "Equatorial",
    "Fields",
    "Focus",
    "GetClock",
    "GetGps",
    "GetIdentity",
    "GetSite",
    "GetStatus",
    "Goto",
    "GotoAxes",
    "GotoHorizontal",
    "Gps",
    "GuideRate",
    "Hibernate",
    "Home",
    "HomeState",
    "Horizontal",
    "HorizontalPosition",
    "Identity",
    "Moment",
    "MoonPlace",
    "Move",
    "MoveAxis",
    "Operation",
    "Own",
    "Park",
    "PassThrough",
    "PeriodicError",
    "PierSide",
    "Place",
    "PlanetPlace",
    "Position",
    "Pulse",
    "PulseAxis",
    "Pulsed",
    "Rate",
    "Read",
    "SetClock",
    "SetGuideRate",
    "SetHome",
    "SetSite",
    "SetTracking",
    "SiderealTime",
    "Slewing",
    "Status",
    "StopAxis",
    "Sync",
    "ToEquinoxOfDate",
    "ToJ2000",
    "TrackRate",
    "Tracking",
    "Unpark",
    "Values",
    "Wake",
    "Zenith",
)


def named(name: str) -> type[Operation] | None:
    """The operation class of that name, or None."""
    found: object = globals().get(name)
    if isinstance(found, type) and issubclass(found, Operation) and found not in (Operation, Read):
        return found
    return None
