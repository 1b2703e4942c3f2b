"""Date and time of day as the clock commands of a hand control carry them: a field each, the year since 2000."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime

_FIELDS = ("month", "day", "hour", "minute", "second")


def fields_of(local: datetime) -> dict[str, int]:
    """The fields of a date and time."""
    return {"year": local.year % 100, **{name: getattr(local, name) for name in _FIELDS}}


def unix_of(fields: Mapping[str, int], century: int = 2000) -> float:
    """Unix seconds of fields, read as if they were UTC. Raises ValueError for a date or time that there is not."""
    month, day, hour, minute, second = (fields[name] for name in _FIELDS)
    return datetime(century + fields["year"], month, day, hour, minute, second, tzinfo=UTC).timestamp()
