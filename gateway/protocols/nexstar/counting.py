"""How a hand control counts: how fast its keys and drives are, and what its clock commands carry.

The speeds of its keys 1 to 9 are those of its family, ``mappings/nexstar/rates.toml``; the drives of its motors have
codes of their own among the variable rates. Date and time of day are a field each, the year since 2000.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache

from gateway.astro.spherical import SIDEREAL_ARCSECONDS
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Model

#: Degrees a second.
SIDEREAL = SIDEREAL_ARCSECONDS / 3600.0
#: Variable rates that are none: the motor follows the sky at its own rate of that name.
DRIVE_CODES = {"sidereal": 0xFFFF, "solar": 0xFFFE, "lunar": 0xFFFD}
_FIELDS = ("month", "day", "hour", "minute", "second")


@cache
def rate_tables() -> dict[str, Model]:
    """The tables by their names, read once."""
    tables: dict[str, Model] = load("nexstar").extra("rates.toml")
    return tables


def key_speed(rates: Model, key: int) -> float:
    """Degrees a second at a key."""
    sidereal, degrees = rates["sidereal"], rates["degrees"]
    if key <= len(sidereal):
        return float(sidereal[key - 1]) * SIDEREAL
    return float(degrees[key - len(sidereal) - 1])


def fields_of(local: datetime) -> dict[str, int]:
    """The fields of a date and time."""
    return {"year": local.year % 100, **{name: getattr(local, name) for name in _FIELDS}}


def unix_of(fields: Mapping[str, int], century: int = 2000) -> float:
    """Unix seconds of fields, read as if they were UTC. Raises ValueError for a date or time that there is not."""
    month, day, hour, minute, second = (fields[name] for name in _FIELDS)
    return datetime(century + fields["year"], month, day, hour, minute, second, tzinfo=UTC).timestamp()
