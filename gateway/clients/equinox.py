"""Converts between the J2000 coordinates of a client and the coordinates of date that everything else uses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from msgspec.structs import replace

from gateway.astro.ephemeris.sky import Sky
from gateway.core import operations as op


class Equinox(Protocol):
    """Between a surface's coordinates and the controller's of date; None where they are the same."""

    def inward(self, operation: op.Operation) -> op.Operation: ...
    def outward(self, operation: op.Operation, value: object) -> object: ...


class J2000:
    """Turns a client's J2000 places into places of date, and answers the other way."""

    def __init__(self, sky: Sky, unix: Callable[[], float]) -> None:
        self._sky, self._unix = sky, unix

    def inward(self, operation: op.Operation) -> op.Operation:
        """What the client asked for, in coordinates of date."""
        if isinstance(operation, op.Goto | op.Sync | op.ToJ2000 | op.Choose):
            ra, dec = self._sky.to_of_date(operation.ra, operation.dec, self._unix())
            return replace(operation, ra=ra, dec=dec)
        return operation

    def outward(self, operation: op.Operation, value: object) -> object:
        """What the controller answered, in J2000."""
        if isinstance(value, op.Chosen) and value.place is not None:
            place = op.Equatorial(*self._sky.to_j2000(value.place.ra, value.place.dec, self._unix()))
            return replace(value, place=place)
        if isinstance(operation, op.Position | op.ToEquinoxOfDate | op.PlanetPlace | op.MoonPlace) and isinstance(
            value, op.Equatorial
        ):
            return op.Equatorial(*self._sky.to_j2000(value.ra, value.dec, self._unix()))
        return value
