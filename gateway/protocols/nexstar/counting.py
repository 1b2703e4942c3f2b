"""Number formats of a hand control: key speeds, drive rate codes, and the fields of its clock commands.

The speeds of keys 1 to 9 depend on the mount family and come from ``mappings/nexstar/rates.toml``. The drive rates
(sidereal, solar, lunar) are reserved codes among the variable rates. The clock commands have one field each for year
(since 2000), month, day, hour, minute and second.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache

from gateway.astro.spherical import SIDEREAL_ARCSEC_PER_S
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Model

#: The sidereal rate, degrees a second.
SIDEREAL = SIDEREAL_ARCSEC_PER_S / 3600.0
#: Variable rates that are codes, not speeds: the motor follows the sky at its own rate of that name.
DRIVE_CODES = {"sidereal": 0xFFFF, "solar": 0xFFFE, "lunar": 0xFFFD}
_DATE_PARTS = ("month", "day", "hour", "minute", "second")


@cache
def rate_tables() -> dict[str, Model]:
    """Return mount family -> its row of ``rates.toml``: the speeds of rate keys 1 to 9. The file is read once."""
    tables: dict[str, Model] = load("nexstar").extra_table("rates.toml")
    return tables


def key_speed(rate_table: Model, key: int) -> float:
    """Return the speed of a hand-control key (1-9), degrees a second."""
    sidereal, degrees = rate_table["sidereal"], rate_table["degrees"]
    if key <= len(sidereal):
        return float(sidereal[key - 1]) * SIDEREAL
    return float(degrees[key - len(sidereal) - 1])


def clock_fields(local_time: datetime) -> dict[str, int]:
    """Return the fields of a clock command for a local date and time."""
    return {"year": local_time.year % 100, **{name: getattr(local_time, name) for name in _DATE_PARTS}}


def unix_time(fields: Mapping[str, int], century: int = 2000) -> float:
    """Return the Unix seconds of clock fields, read as UTC; ``century`` is added to the year. Raises ValueError."""
    month, day, hour, minute, second = (fields[name] for name in _DATE_PARTS)
    return datetime(century + fields["year"], month, day, hour, minute, second, tzinfo=UTC).timestamp()
