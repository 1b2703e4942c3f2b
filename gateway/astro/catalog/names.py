"""Names that people call objects by: Vega, Rigel Kent, Ring Nebula; case, spaces, hyphens and the like do not count.

Stars' names are this project's own list (``mappings/stars.toml``), with a Hipparcos number each; those of alignment
lists and charts have their places there, too, because ``goto Polaris`` is what somebody types who has nothing yet.
Names of nebulae, clusters and galaxies are OpenNGC's. A name that nobody has given is None; names that look like it are
suggested.
"""

from __future__ import annotations

from gateway.astro.catalog import deepsky, stars
from gateway.astro.catalog.objects import Entry, NotInstalled
from gateway.core.errors import alike
from gateway.core.tables import read_table

_TABLE = read_table("stars.toml")
#: Name -> Hipparcos number.
HIPPARCOS: dict[str, int] = _TABLE["numbers"]
#: Another name -> name.
ALSO: dict[str, str] = _TABLE["also"]
#: Name -> right ascension and declination, degrees, at the catalogue's epoch; proper motion, mas a year.
PLACES: dict[str, tuple[float, float, float, float]] = _TABLE["places"]
_BY_NUMBER = {HIPPARCOS[name]: place for name, place in PLACES.items()}
#: How like a name must be to be suggested, and how many are.
ALIKE, SUGGESTED = 0.72, 3


def by_number(number: int, year: float) -> tuple[float, float] | None:
    """Where the star of a Hipparcos number stands in that year (2026.5), J2000, degrees; None for all but these."""
    place = _BY_NUMBER.get(number)
    return None if place is None else stars.moved(*place, year)


def bare(name: str) -> str:
    """What two spellings of a name have in common."""
    letters = "".join(letter for letter in name.casefold() if letter.isalnum())
    return letters.removeprefix("the")


_STARS = {bare(name): HIPPARCOS[ALSO.get(name, name)] for name in (*HIPPARCOS, *ALSO)}


def star(name: str) -> int | None:
    return _STARS.get(bare(name))


def look_up(name: str, year: float) -> Entry | None:
    """The star or deep sky object of a name. Raises NotInstalled where the star's catalogue is missing."""
    number = star(name)
    if number is None:
        row = {bare(known): row for known, row in _deep_sky().items()}.get(bare(name))
        return None if row is None else deepsky.by_row(row)
    try:
        return stars.hipparcos(number, year)
    except NotInstalled:
        place = by_number(number, year)  # one of the bright stars that are known without it
        if place is None:
            raise
        return Entry(name, "*", *place)


def beginning(text: str, most: int) -> list[str]:
    """Names that begin so: the stars that mounts are aligned on first, other spellings last; the shorter the sooner."""
    typed = bare(text)
    spelled = {bare(known): known for known in (*_deep_sky(), *ALSO, *HIPPARCOS)}
    longer = [known for bared, known in spelled.items() if typed and bared.startswith(typed)]
    return sorted(longer, key=lambda known: (known in ALSO, known not in PLACES, len(known)))[:most]


def suggestions(name: str, more: tuple[str, ...] = ()) -> list[str]:
    """Names that begin like one that nobody has given, or look like it; ``more`` are names besides these."""
    spelled = {bare(known): known for known in (*_deep_sky(), *ALSO, *HIPPARCOS, *more)}
    typed = bare(name)
    longer = sorted((known for known in spelled if len(typed) > 2 and known.startswith(typed)), key=len)
    close = [*longer, *alike(typed, spelled, SUGGESTED, ALIKE)]
    return [spelled[known] for known in dict.fromkeys(close)][:SUGGESTED]


def _deep_sky() -> dict[str, int]:
    """None where their catalogue is not installed."""
    try:
        return deepsky.names()
    except NotInstalled:
        return {}
