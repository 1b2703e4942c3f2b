"""The stars that people call by name: those of alignment lists and charts, from ``mappings/stars.toml``.

Some have their places there, too, and not only in the catalogue: ``goto Polaris`` is what somebody types who has
nothing yet.
"""

from __future__ import annotations

from gateway.astro.catalog.stars import moved
from gateway.core.tables import read_table

_TABLE = read_table("stars.toml")
#: Name -> Hipparcos number.
HIPPARCOS: dict[str, int] = _TABLE["numbers"]
#: Another name -> name.
ALSO: dict[str, str] = _TABLE["also"]
#: Name -> right ascension and declination, degrees, at the catalogue's epoch; proper motion, mas a year.
PLACES: dict[str, tuple[float, float, float, float]] = _TABLE["places"]
_BY_NUMBER = {HIPPARCOS[name]: place for name, place in PLACES.items()}


def by_number(number: int, year: float) -> tuple[float, float] | None:
    """Where the star of a Hipparcos number stands in that year (2026.5), J2000, degrees; None for all but these."""
    place = _BY_NUMBER.get(number)
    return None if place is None else moved(*place, year)
